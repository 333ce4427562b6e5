# What whittle's ancestors could do: every command of tests/ANCESTORS.md runs, and every test that it
# names is there.
tests=$(realpath "$(dirname "$0")/..")
. "$(dirname "$0")/lib.sh"
use_temp
w=${WHITTLE:?}

expect 0 "$w" generate -o in.ply --faces 10K -q
expect 0 "$w" generate -o open.ply --faces 10K --shape terrain -q
expect 0 "$w" reduce in.ply -o in.off --faces 100% -q
expect 0 "$w" reduce in.ply -o in.obj --faces 100% -q
printf 'OFF\n8 6 0\n%s\n' '1 -1 1
1 1 1
-1 1 1
-1 -1 1
-1 -1 -1
-1 1 -1
1 1 -1
1 -1 -1
4 0 1 2 3
4 4 5 6 7
4 7 6 1 0
4 3 2 5 4
4 1 6 5 2
4 3 4 7 0' >quads.off

# Pictures and pages need libraries that a build may lack: then their rows are for other builds.
absent() {
	grep -q 'without libpng\|built without three.js' err
}

rows=0
while IFS='|' read -r _ ability command test _; do
	command=${command//\`/}
	read -ra words <<<"$command"
	[ "${words[0]:-}" = whittle ] || continue
	rows=$((rows + 1))
	"$w" "${words[@]:1}" >out 2>err || absent || fail "$ability: ${command}: $(cat err)"
	IFS=': ' read -r file name <<<"$test"
	[ -f "$tests/$file" ] || fail "$ability: there is no $file"
	[ -z "$name" ] || grep -q "^static void $name(" "$tests/$file" || fail "$ability: $file has no $name"
done <"$tests/ANCESTORS.md"
[ "$rows" -gt 35 ] || fail "only $rows rows were found"

# what their own words give as numbers
[ "$(sed -n 2p half.off | cut -d' ' -f1)" -le "$(($(sed -n 2p in.off | cut -d' ' -f1) / 10 + 1))" ] ||
	fail "more than a tenth of the vertices is left"
expect 0 "$w" info melax.ply --json
grep -q '"vertices": 207' out || fail "not 207 vertices"
expect 0 "$w" info lod-500.obj --json
[ "$(grep -c '^f ' lod-500.obj)" -le 500 ] || fail "a level has too many faces"
[ -z "$(ls temp)" ] || fail "temporary files are left"
exit $((failures > 0))
