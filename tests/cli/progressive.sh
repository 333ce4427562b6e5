# whittle progressive and replay as a user meets them: records, levels, text, words and statuses.
. "$(dirname "$0")/lib.sh"
use_temp
w=${WHITTLE:?}

expect 0 "$w" generate -o in.ply --faces 20K -q
expect 0 "$w" progressive in.ply -o a.pmesh --faces 700 --cluster-faces 5K --micro-faces 1K
expect 0 "$w" reduce in.ply -o direct.ply --faces 700 --cluster-faces 5K --micro-faces 1K --round-keep 0.5 -q
expect 0 "$w" replay a.pmesh
grep -q "to 700 faces" out || fail "the record does not say what it holds"
expect 0 "$w" replay a.pmesh -o base.ply --faces 700
cmp -s direct.ply base.ply || fail "the base is not what reduce leaves"
expect 0 "$w" progressive in.ply -o even.pmesh --faces 700 --cluster-faces 3K -q
expect 0 "$w" reduce in.ply -o direct.ply --faces 700 --cluster-faces 3K --micro-faces 0 --round-keep 0.5 -q -f
expect 0 "$w" replay even.pmesh -o base.ply --faces 700 -f
cmp -s direct.ply base.ply || fail "the base of short rounds is not what reduce leaves"
expect 2 "$w" reduce in.ply -o x.ply --faces 700 --round-keep 1
expect 0 "$w" progressive in.ply -o one.pmesh --faces 700 --cluster-faces 0 -q
expect 0 "$w" reduce in.ply -o direct.ply --faces 700 --cluster-faces 0 --micro-faces 0 -q -f
expect 0 "$w" replay one.pmesh -o base.ply --faces 700 -f
cmp -s direct.ply base.ply || fail "the base of one cluster is not what reduce leaves"
expect 0 "$w" replay a.pmesh -o - --ratio 0.25 -q
head -1 out | grep -q '^ply' || fail "no mesh on standard output"
expect 2 "$w" replay a.pmesh --text ./same -o same -f
expect 0 "$w" replay a.pmesh --text lines --faces 5000 -o some.obj
[ "$(grep -c '^v ' some.obj)" -gt 2000 ] || fail "the level has too few vertices"
all=$(head -1 lines | cut -d' ' -f1)
[ "$(wc -l <lines)" -eq $((all + 1 - $(grep -c '^v ' some.obj))) ] || fail "lines are missing"
expect 0 "$w" replay a.pmesh -o whole.ply -q
expect 0 "$w" compare in.ply whole.ply
grep -q "= 0.00 millionths of the diagonal" out || fail "the finest level is not the input"

expect 4 "$w" replay one.pmesh -o less.ply --faces 100
grep -q "no fewer than 700 faces" err || fail "too small a target is not told"
cmp -s direct.ply less.ply || fail "the base was not written"
expect 2 "$w" replay a.pmesh -o less.ply
expect 2 "$w" replay a.pmesh -o x.ply --faces none
expect 2 "$w" progressive in.ply -o b.pmesh --levels 1K,100
expect 3 "$w" replay in.ply -o x.ply
grep -q "no record of whittle progressive" err || fail "another file is not named"
head -c 30000 a.pmesh >cut.pmesh
expect 3 "$w" replay cut.pmesh -o x.ply
expect 5 "$w" progressive in.ply -o b.pmesh --memory 14M --cluster-faces 2K --micro-faces 1K

# between two levels: frames of a morph, meshes and pictures from a camera that stands still
expect 0 "$w" replay a.pmesh -o few.ply --faces 1000 -q
expect 0 "$w" replay a.pmesh -o many.ply --faces 8000 -q
expect 0 "$w" replay a.pmesh -o many-again.ply --faces 8000 --towards 1K --geomorph 0 -q
cmp -s many.ply many-again.ply || fail "a morph does not begin at its level"
expect 0 "$w" replay a.pmesh -o 'm%f.ply' --faces 1000 --towards 8000 --frames 3 -q
cmp -s many.ply m0002.ply || fail "the last frame is not the level"
cmp -s m0000.ply m0001.ply && fail "nothing moves"
expect 2 "$w" replay a.pmesh -o 'm%f.ply' --faces 1000 --towards 8000 --frames 4
[ ! -e m0003.ply ] || fail "a frame in spite of one that was in the way"
grep -q "m0000.ply' exists already" err || fail "the frame in the way is not named"
long=$(printf 'x%.0s' $(seq 252)).ply
expect 2 "$w" replay a.pmesh -o "$long" --faces 1000 --towards 8000 --frames 3
grep -q "names of the frames are too long" err || fail "too long a name is not told"
for wrong in "--geomorph 1.5" "--geomorph nan" "--geomorph -1" "--frames 1" "--frames -3" "--towards 1K" \
	"--geomorph 0.5 --frames 3" "--geomorph 0.5 --text lines" "--geomorph 0.5 --towards 0"; do
	# shellcheck disable=SC2086
	expect 2 "$w" replay a.pmesh -o x.ply --faces 1000 $wrong
done
expect 2 "$w" replay a.pmesh -o - --frames 3
expect 2 "$w" replay a.pmesh -o x.ply --page x.html
expect 2 "$w" replay a.pmesh --page a.pmesh -f
expect 2 "$w" replay a.pmesh --geomorph 0.5
expect 4 "$w" replay a.pmesh -o less.ply --faces 8000 --towards 10 --geomorph 1 -f
if "$w" render few.ply -o few.png --size 90x60 -q 2>err; then
	expect 0 "$w" replay a.pmesh -o p.png --faces 1000 --towards 8000 --frames 3 --size 90x60 -q
	cmp -s p-0000.png p-0001.png && fail "nothing moves in the pictures"
	[ -s p-0002.png ] || fail "frames are missing"
	expect 3 "$w" replay a.pmesh -o p.png --frames 3 --colours -f
	expect 1 "$w" replay a.pmesh -o none/p.png --frames 3
else
	grep -q 'without libpng' err || fail "render"
fi
[ -z "$(ls temp)" ] || fail "temporary files are left"
[ ! -e x.ply ] && [ ! -e b.pmesh ] || fail "an output of a failure"
exit $((failures > 0))
