# bench/error: the course of it, with a stand-in for CGAL that is whittle itself.
bench=$(realpath "$(dirname "$0")/../../bench/error")
. "$(dirname "$0")/lib.sh"

if ! command -v python3 >/dev/null; then
	echo "skipped: no python3"
	exit 77
fi

cat >peer <<'END'
#!/bin/bash
# peer --normalise IN OUT | peer IN OUT N% METHOD [OUT N%]...
set -e
[ "$1" = --normalise ] && exec cp "$2" "$3"
in=$1 method=$4
echo "$method" >>methods
set -- "${@:2:2}" "${@:5}"
for (( ; $# > 0; )); do
	"$WHITTLE" reduce -q -f "$in" -o "$1" --to ply --faces "$2" --cluster-faces 0 --micro-faces 0
	shift 2
done
END
chmod +x peer

error() {
	expect 0 python3 "$bench" --work work --whittle "$WHITTLE" --peer "$PWD/peer" \
		--only sphere --generated 40K --ratios 10,1 --samples 20K --variants default "$@"
}

error
# no more than some per cent worse in clusters than in one: the ratios are what they should be
[ "$(grep -Ec '^\| sphere \| (10|1) % \| [0-9]+ \| [0-9. /]+ \| (0\.9|1\.0)' out)" -eq 2 ] ||
	fail "rows: $(cat out)"
grep -q '^| rms | [01]\.[0-9]* ' out || fail "no median: $(cat out)"
grep -q '^Topology changed: none.$' out || fail "topology: $(cat out)"
grep -q 'Fewer than 32' out && fail "too few clusters"
cmp -s out work/results.md || fail "results.md is something else"
python3 - <<-'END' || fail "results.json"
	import json
	rows = json.load(open("work/results.json"))
	assert [r["ratio"] for r in rows] == ["10", "1"]
	assert all(r["status"] == 0 and r["clusters"] >= 32 for r in rows)
	assert all(0 < r["whittle"]["quality_p5"] < r["whittle"]["quality_mean"] < 1 for r in rows)
	assert all(0 < r["whittle"]["normal_mean"] < r["whittle"]["normal_rms"] < 90 for r in rows)
END

# references are made once, a course for each method; results may go elsewhere
error --results again --seams
[ "$(tr '\n' ' ' <methods)" = "lt gh " ] || fail "CGAL ran again: $(cat methods)"
grep -q '"seams"' again/results.json || fail "no seams"

expect 1 python3 "$bench" --work work --whittle "$WHITTLE" --only nothing
grep -q 'no such mesh' err || fail "an unknown mesh is not named"

[ "$failures" -eq 0 ] || exit 1
echo "bench/error: ok"
