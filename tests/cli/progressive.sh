# whittle progressive and replay as a user meets them: records, levels, text, words and statuses.
. "$(dirname "$0")/lib.sh"
use_temp
w=${WHITTLE:?}

expect 0 "$w" generate -o in.ply --faces 20K -q
expect 0 "$w" progressive in.ply -o a.pmesh --faces 700 --cluster-faces 5K --micro-faces 1K
expect 0 "$w" reduce in.ply -o direct.ply --faces 700 --cluster-faces 5K --micro-faces 1K -q
expect 0 "$w" replay a.pmesh
grep -q "to 700 faces" out || fail "the record does not say what it holds"
expect 0 "$w" replay a.pmesh -o base.ply --faces 700
cmp -s direct.ply base.ply || fail "the base is not what reduce leaves"
expect 0 "$w" progressive in.ply -o one.pmesh --faces 700 -q
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
[ -z "$(ls temp)" ] || fail "temporary files are left"
[ ! -e x.ply ] && [ ! -e b.pmesh ] || fail "an output of a failure"
exit $((failures > 0))
