# What is done to a result besides collapses: --smooth and --normals.
. "$(dirname "$0")/lib.sh"
use_temp
w=${WHITTLE:?}

# rms A B: the distance, in millionths of the diagonal
rms() {
	"$w" compare "$1" "$2" --samples 20K --json | python3 -c '
import json, sys
print(json.load(sys.stdin)["rms_millionths"])'
}

expect 0 "$w" generate -o in.ply --faces 20K --noise 0.3 -q
expect 0 "$w" generate -o clean.ply --faces 20K --noise 0 -q
expect 0 "$w" reduce in.ply -o plain.ply --faces 10K -q
expect 0 "$w" reduce in.ply -o smooth.ply --faces 10K --smooth 10 -q
expect 0 "$w" check smooth.ply --strict
python3 -c "import sys; sys.exit(not $(rms smooth.ply clean.ply) < 0.8 * $(rms plain.ply clean.ply))" ||
	fail "smoothing does not bring the noisy mesh nearer to the one without noise"
expect 0 "$w" reduce in.ply -o two.ply --levels 10K,1K --smooth 10 -q
cmp -s smooth.ply two-10000.ply || fail "a smoothed level is another than a run of its own"
expect 0 "$w" reduce in.ply -o next.ply --levels 10K,1K -q
expect 0 "$w" reduce in.ply -o last.ply --levels 10K,1K --normals --smooth 10 -q
grep -aq 'property float nx' last-1000.ply || fail "no normals"
grep -aq 'property float nx' two-1000.ply && fail "normals that nobody asked for"

# new normals are the faces' ones; those that a file has are replaced, with what else is there
expect 0 "$w" reduce in.ply -o n.ply --faces 1K --normals --ascii -q
expect 0 "$w" reduce n.ply -o again.ply --faces 1K --normals --ascii -q
cmp -s n.ply again.ply || fail "normals worked out anew are others"
sed '/end_header/,$ s/^\([^ ]* [^ ]* [^ ]*\) [^ ]* [^ ]* [^ ]*$/\1 1 0 0/' n.ply >wrong.ply
cmp -s n.ply wrong.ply && fail "the test changes no normal"
expect 0 "$w" reduce wrong.ply -o right.ply --faces 1K --normals --ascii -q
cmp -s n.ply right.ply || fail "wrong normals are not replaced"
for to in obj off glb; do
	expect 0 "$w" reduce in.ply -o "n.$to" --faces 1K --normals -q
done
grep -q '^vn ' n.obj || fail "no normals in OBJ"
head -1 n.off | grep -q '^NOFF' || fail "no normals in OFF"

# what does not go together
expect 5 "$w" reduce in.ply -o x.ply --faces 15K --smooth 1 --cluster-faces 2K --final-faces 5K
grep -q 'final-faces' err || fail "a streamed result is not told"
expect 2 "$w" progressive in.ply -o x.pmesh --faces 1K --smooth 1
expect 2 "$w" reduce in.ply -o x.ply --faces 1K --smooth -1
[ ! -e x.ply ] && [ ! -e x.pmesh ] || fail "an output of a failure"
exit $((failures > 0))
