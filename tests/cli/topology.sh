# whittle reduce --topology, on a scan with many parts, holes and handles, in several clusters:
# keep keeps them all, simplify reaches counts that keep cannot, and what is left is a manifold.
. "$(dirname "$0")/lib.sh"
expect 2 "$WHITTLE" reduce x.ply -o y.ply --faces 1K --topology lose
grep -q 'keep or simplify' err || fail "words for a wrong value: $(cat err)"

# look FILE: prints what check says as KEY=VALUE words
look() {
	"$WHITTLE" check "$1" --json | python3 -c '
import json, sys
r = json.load(sys.stdin)
names = ("faces", "components", "boundary_loops", "euler", "nonmanifold_edges", "nonmanifold_vertices")
print(*("%s=%d" % (k, r[k]) for k in names))'
}
scan=$WHITTLE_DATA/scans/meshlab_lato000.ply
if [ ! -e "$scan" ] || ! python3 -c 'import json' 2>/dev/null; then
	echo "skipped: needs python3 and $scan"
	exit 77
fi
options="--no-progress --cluster-faces 8K --micro-faces 2K --final-faces 10K"
before=$(look "$scan" | cut -d' ' -f2-)

# shellcheck disable=SC2086
expect 0 "$WHITTLE" reduce "$scan" -o kept.ply --faces 5K $options --report kept.json
[ "$(look kept.ply | cut -d' ' -f2-)" = "$before" ] || fail "kept: $(look kept.ply), was $before"
for threads in 1 2; do
	# shellcheck disable=SC2086
	expect 0 "$WHITTLE" reduce "$scan" -f -o $threads.ply --faces 200 $options --threads $threads \
		--topology simplify --report simple.json
done
grep -q 'topology: .* removed' out err || fail "nothing said of the topology: $(cat out err)"
cmp -s 1.ply 2.ply || fail "other bytes with other threads"
[[ "$(look 1.ply)" == "faces=200 "*" nonmanifold_edges=0 nonmanifold_vertices=0" ]] ||
	fail "simplified: $(look 1.ply)"
python3 - <<'E2' || fail "the reports"
import json
kept, simple = json.load(open("kept.json")), json.load(open("simple.json"))
assert kept["parameters"]["topology"] == "keep" and simple["parameters"]["topology"] == "simplify"
assert not any(kept["topology"].values())
t = simple["topology"]
print(t)
assert t["holes_closed"] + t["bridges_cut"] + t["shells_removed"] > 0
assert simple["output"]["faces"] == 200 and not simple["target"]["exhausted"]
E2

# not a manifold: vertices that would be in the way are split
cat >book.py <<'E2'
n = 12
v = [(0, 0, y) for y in range(n + 1)]
f = []
for k, (cx, cy) in enumerate(((1, 0), (-1, 1), (-1, -1))):
    base = len(v)
    v += [(cx * x, cy * x, y) for x in range(1, n + 1) for y in range(n + 1)]
    at = lambda x, y: y if x == 0 else base + (x - 1) * (n + 1) + y
    for x in range(n):
        for y in range(n):
            a, b, c, d = at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)
            f += [(a, b, c), (a, c, d)]
print("ply\nformat ascii 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z" % len(v))
print("element face %d\nproperty list uchar int vertex_indices\nend_header" % len(f))
print("\n".join(" ".join(map(str, p)) for p in v))
print("\n".join("3 " + " ".join(map(str, t)) for t in f))
E2
python3 book.py >book.ply
expect 4 "$WHITTLE" reduce book.ply -o stuck.ply --faces 6
grep -q 'topology simplify' err || fail "no advice: $(cat err)"
! grep -q 'attributes none' err || fail "advice that is of no use: $(cat err)"
expect 0 "$WHITTLE" reduce book.ply -o open.ply --faces 6 --topology simplify --report split.json
grep -q '"nonmanifold_vertices_split": 2[0-9]' split.json || fail "split: $(grep split split.json)"
[[ "$(look open.ply)" == "faces=6 components=3 "*" nonmanifold_edges=0 nonmanifold_vertices=0" ]] ||
	fail "a book: $(look open.ply)"

# A sphere with a boundary where only some clusters have one (cap), or in all of them, with a value
# at each face (holes), streamed: a count that is odd, and the topology as it was in the last round.
cat >sphere.py <<'E3'
import math, random, sys
random.seed(1)
n, m = 80, 120
v = [(0, 0, 1)]
for i in range(1, n):
    for j in range(m):
        a, b = math.pi * i / n, 2 * math.pi * j / m
        r = 1 + 0.02 * math.sin(9 * a) * math.cos(7 * b) + 0.003 * random.random()
        v.append((r * math.sin(a) * math.cos(b), r * math.sin(a) * math.sin(b), r * math.cos(a)))
v.append((0, 0, -1))
at = lambda i, j: 1 + (i - 1) * m + j % m
f = []
for j in range(m):
    f += [(0, at(1, j), at(1, j + 1)), (len(v) - 1, at(n - 1, j + 1), at(n - 1, j))]
    for i in range(1, n - 1):
        f += [(at(i, j), at(i + 1, j), at(i + 1, j + 1)), (at(i, j), at(i + 1, j + 1), at(i, j + 1))]
cap = sys.argv[1] == "cap"
f = [t for t in f if (sum(sum(v[i]) for i in t) < 4.5 if cap else random.random() > 0.03)]
print("ply\nformat ascii 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z" % len(v))
print("element face %d\nproperty list uchar int vertex_indices" % len(f))
print("end_header" if cap else "property float heat\nend_header")
print("\n".join(" ".join("%.6g" % x for x in p) for p in v))
print("\n".join("3 " + " ".join(map(str, t)) + ("" if cap else " 1") for t in f))
E3
python3 sphere.py cap >cap.ply
python3 sphere.py holes >holes.ply
small="-q -f --micro-faces 0 --threads 2"
# shellcheck disable=SC2086
expect 0 "$WHITTLE" reduce cap.ply -o odd.ply --faces 6001 --cluster-faces 2000 --final-faces 2000 $small
grep -qa '^element face 6001$' odd.ply || fail "an odd count of a mesh with a boundary: $(grep -a face odd.ply)"
for faces in 3000 3001; do
	# shellcheck disable=SC2086
	expect 0 "$WHITTLE" reduce holes.ply -o whole.ply --faces $faces --topology simplify \
		--cluster-faces 1000 --final-faces 1000 $small
	grep -qa "^element face $faces$" whole.ply || fail "$faces with values at faces: $(grep -a face whole.ply)"
done

[ $failures -eq 0 ] || exit 1
echo "topology: ok"
