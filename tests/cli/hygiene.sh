# What goes before a mesh is reduced: vertices that are not finite, near vertices, copies of faces,
# small components; each is counted, and nothing depends on clusters, threads or memory.
. "$(dirname "$0")/lib.sh"
expect 2 "$WHITTLE" reduce x.ply -o y.ply --faces 1K --weld -1
grep -q 'weld.*distance from 0 on' err || fail "words for a wrong distance: $(cat err)"
expect 2 "$WHITTLE" reduce x.ply -o y.ply --faces 1K --weld 0.1x
expect 2 "$WHITTLE" reduce x.ply -o y.ply --faces 1K --min-component 0
if ! python3 -c 'import json' 2>/dev/null; then
	echo "skipped: needs python3"
	exit 77
fi

# A wavy square; a strip of 200 faces over all of it; 40 fans of 1 to 40 faces, and copies of faces,
# some of them turned over; one face of no area.
cat >mesh.py <<'E2'
import math, struct, sys
n = 64
v = [(x, y, math.sin(x / 5) * math.cos(y / 7)) for y in range(n) for x in range(n)]
f = []
for y in range(n - 1):
    for x in range(n - 1):
        a = y * n + x
        f += [(a, a + 1, a + n + 1), (a, a + n + 1, a + n)]
f += [f[i] for i in range(0, 700, 100)] + [f[i][::-1] for i in range(50, 300, 50)]
base = len(v)
v += [(x * 0.63, 10 + 0.4 * x + y * 0.2, 5) for x in range(101) for y in range(2)]
for x in range(100):
    a = base + 2 * x
    f += [(a, a + 2, a + 3), (a, a + 3, a + 1)]
for k in range(1, 41):
    base = len(v)
    at = (k * 1.5, k * 37 % 60, 9)
    v.append(at)
    v += [(at[0] + 0.2 * math.cos(i / 7), at[1] + 0.2 * math.sin(i / 7), 9) for i in range(k + 1)]
    f += [(base, base + i + 1, base + i + 2) for i in range(k)]
v += [(0, 0, -9), (1, 0, -9), (2, 0, -9)]
f.append((len(v) - 3, len(v) - 2, len(v) - 1))
soup = sys.argv[1] == "soup"
nan = sys.argv[1] == "nan"
if soup:
    jitter = lambda i: (i * 2654435761 % 1000) / 1000 * 0.0005
    v, f = ([tuple(x + jitter(3 * i + k) for x in v[t[k]]) for i, t in enumerate(f) for k in range(3)],
            [(3 * i, 3 * i + 1, 3 * i + 2) for i in range(len(f))])
if nan:
    v[70] = (math.nan, 1, 2)
    v[71] = (1, math.inf, 2)
out = sys.stdout.buffer
out.write(b"ply\nformat binary_little_endian 1.0\nelement vertex %d\n" % len(v))
out.write(b"property float x\nproperty float y\nproperty float z\nproperty uchar red\n")
out.write(b"element face %d\nproperty list uchar int vertex_indices\nend_header\n" % len(f))
for i, p in enumerate(v):
    out.write(struct.pack("<fffB", *p, i % 256))
for t in f:
    out.write(struct.pack("<Biii", 3, *t))
E2
for kind in plain soup nan; do
	python3 mesh.py $kind >$kind.ply
done

# found KEY... : values of the report's hygiene
found() {
	python3 - "$@" <<'E2'
import json, sys
r = json.load(open("report.json"))
print(*(r["hygiene"][k] for k in sys.argv[1:]), r["output"]["components"])
E2
}

# tidy INPUT "OPTIONS" "KEYS" "VALUES" [WAY...]: the same counts and bytes in each way
one="--cluster-faces 0"
many="--cluster-faces 1000 --threads 1 --memory 32M"
kept="--cluster-faces 1000 --threads 2 --run-dir run --resume"
tidy() {
	local input=$1 options=$2 keys=$3 want=$4 got first=
	shift 4
	for way in "$@"; do
		# shellcheck disable=SC2086
		expect 0 "$WHITTLE" reduce "$input" -f -o out.ply --faces 100% --no-progress $options $way \
			--report report.json
		# shellcheck disable=SC2086
		got=$(found $keys)
		[ "$got" = "$want" ] || fail "$input $options $way: $got instead of $want"
		[ "$way" = "$one" ] && continue
		[ -z "$first" ] && first=$(cksum <out.ply)
		[ "$(cksum <out.ply)" = "$first" ] || fail "$input $options $way: other bytes"
	done
}
tidy plain.ply --drop-duplicates "duplicate_faces zero_area_faces" "12 1 43" "$one"
tidy plain.ply "--min-component 2" "small_components small_component_faces duplicate_faces" "2 2 12 41" "$many"
tidy plain.ply "--min-component 200 --drop-duplicates" "small_components small_component_faces small_component_vertices" \
	"41 821 903 2" "$one" "$many" "$kept"
tidy plain.ply "--min-component 201" "small_components small_component_faces" "42 1021 1" "$many"
tidy soup.ply "--weld 0.001" "welded_vertices collapsed_faces duplicate_faces" "$(
	python3 - <<'E2'
soup, kept = 3 * (63 * 63 * 2 + 12 + 200 + 820 + 1), 64 * 64 + 202 + 40 * 2 + 820 + 3
print(soup - kept, 0, 12, 43)
E2
)" "$one" "$many" "$kept"
tidy nan.ply --drop-invalid "invalid_vertices invalid_faces" "2 10 43" "$many"
expect 3 "$WHITTLE" reduce nan.ply -f -o out.ply --faces 100
grep -q 'vertex 70: x is nan.*--drop-invalid' err || fail "a vertex that is not finite: $(cat err)"
expect 3 "$WHITTLE" reduce plain.ply -f -o out.ply --faces 100 --min-component 1M
grep -q 'lower --min-component' err || fail "nothing left: $(cat err)"
expect 2 "$WHITTLE" reduce plain.ply -f -o out.ply --faces 100 --weld 1e-30
grep -q 'too small a distance' err || fail "a distance that nothing can tell: $(cat err)"
expect 5 "$WHITTLE" reduce soup.ply -f -o out.ply --faces 4K --weld 0.001 --memory 13M
grep -q 'use --memory' err || fail "a ceiling: $(cat err)"
size=$(sed 's/.*use --memory \([0-9]*M\).*/\1/' err)
expect 0 "$WHITTLE" reduce soup.ply -f -o out.ply --faces 4K --weld 0.001 --memory "$size"
expect 0 "$WHITTLE" plan soup.ply --faces 100 --weld 0.001

# what stays is counted in the result, as check does: a face that looks the other way, two sheets at a vertex
awk 'BEGIN {
	for (y = 0; y <= 40; y++) for (x = 0; x <= 40; x++) print "v", x, y, (x * y) % 7 / 10
	for (y = 0; y < 40; y++) for (x = 0; x < 40; x++) {
		a = 41 * y + x + 1; b = a + 1; c = a + 42; d = a + 41
		print (x == 20 && y == 20) ? "f " c " " b " " a : "f " a " " b " " c
		print "f", a, c, d
	}
	print "v 50 0 0\nv 50 1 0\nf 1 1682 1683"
	print "v 60 0 0\nv 61 0 0\nv 62 0 0\nf 1684 1685 1686\nv 70 0 0\nv 71 0 0\nv 70 1 0\nf 1687 1688 1689\nf 1687 1688 1689"
}' >turned.obj
for way in "--threads 2" "--cluster-faces 1000 --final-faces 1000"; do
	# shellcheck disable=SC2086
	expect 0 "$WHITTLE" reduce turned.obj -q -f -o out.ply --faces 3100 --report report $way
	for key in misoriented_edges nonmanifold_vertices nonmanifold_edges duplicate_faces zero_area_faces folded_edges; do
		expect 0 "$WHITTLE" check --no-progress --json out.ply
		[ "$(sed -n "s/.*\"$key\": \([0-9]*\).*/\1/p" out)" = "$(sed -n "s/.*\"$key\": \([0-9]*\).*/\1/p" report | tail -1)" ] ||
			fail "$way: $key of the report: $(grep $key out report)"
	done
	grep -q '"misoriented_edges": [4-6]' report || fail "$way: no face is turned: $(grep misor report)"
	grep -q '"nonmanifold_vertices": 1' report || fail "$way: no vertex of two sheets"
	grep -q '"duplicate_faces": 1,' report || fail "$way: no face is there twice"
	grep -q '"zero_area_faces": 1,' report || fail "$way: no face without area"
done

# what faces and corners carry stays with them, past those that go: texture coordinates are places, materials sides
awk -v n=60 'function corner(x, y) { print "v", x, y, 0; print "vt", x / n, y / n; count++ }
function face(a) { print "f " a "/" a, a + 1 "/" a + 1, a + 2 "/" a + 2 }
function triangle(ax, ay, bx, by, cx, cy) {
	corner(ax, ay); corner(bx, by); corner(cx, cy); face(count - 2)
}
BEGIN {
	for (y = 0; y < n; y++) for (x = 0; x < n; x++) {
		print "usemtl", x < n / 2 ? "left" : "right"
		if (x % 7 == 3) { corner(x, y); print "f", count "/" count, count "/" count, count "/" count }
		if (y % 9 == 4) { print "v nan 0 0\nvt 9 9"; count++; print "f", count - 1 "/" count - 1, count "/" count, count - 2 "/" count - 2 }
		triangle(x, y, x + 1, y, x + 1, y + 1); triangle(x, y, x + 1, y + 1, x, y + 1)
		if (x == y) triangle(x, y, x + 1, y, x + 1, y + 1)
	}
	print "usemtl left"; triangle(200, 200, 201, 200, 200, 201)
}' >skin.obj
for way in "--threads 2" "--cluster-faces 1000 --final-faces 1000 --threads 1"; do
	# shellcheck disable=SC2086
	expect 0 "$WHITTLE" reduce skin.obj -f -o out.obj --faces 2000 --drop-invalid --weld 0 --min-component 3 $way
	! grep 'not carried over' out || fail "$way: something is left behind"
	python3 - <<'END' || fail "$way: texture coordinates or materials are others'"
v, vt, sides, material = [], [], set(), None
for line in open("out.obj"):
    w = line.split()
    if not w or w[0][0] == "#":
        continue
    if w[0] == "v":
        v.append([float(x) for x in w[1:4]])
    elif w[0] == "vt":
        vt.append([float(x) for x in w[1:3]])
    elif w[0] == "usemtl":
        material = w[1]
    elif w[0] == "f":
        for c in w[1:]:
            i, t = (int(x) - 1 for x in c.split("/"))
            assert all(abs(v[i][k] / 60 - vt[t][k]) < 1e-5 for k in (0, 1)), (line, v[i], vt[t])
        x = sum(v[int(c.split("/")[0]) - 1][0] for c in w[1:]) / 3
        assert (x < 30) == (material == "left"), (line, x, material)
        sides.add(material)
assert sides == {"left", "right"} and max(p[0] for p in v) <= 60
END
done

[ "$failures" -eq 0 ] && echo "hygiene: ok"
exit $((failures > 0))
