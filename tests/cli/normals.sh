# Normals of OBJ (vn): vertices' own, and those of corners along hard edges.
. "$(dirname "$0")/lib.sh"
command -v python3 >/dev/null || {
	echo "skipped: no python3"
	exit 77
}

# lens.py make KIND...: KIND.obj, two bumpy caps that meet in a sharp ring, with normals of corners
# ("hard"), also with texture coordinates ("mapped"), or one normal a vertex, of its number ("soft",
# "back": counted back)
# lens.py look KIND FILE [KIND FILE]...: what became of each, a line a file: normals of another length
# than 1, or far off their face, or of the other cap; on the ring: normals that the file did not have;
# edges that are open where equal positions are one
cat >lens.py <<'END'
import glb, math, struct, sys
RINGS, SECTORS = 20, 60
f32 = lambda x: struct.unpack("f", struct.pack("f", x))[0]

def height(x, y):
    return 0.6 * (1 - x * x - y * y) * (1 + 0.2 * math.sin(5 * x + 1) * math.cos(4 * y))

def normal(x, y, up):
    e = 1e-5
    n = (-(height(x + e, y) - height(x - e, y)) / 2 / e, -(height(x, y + e) - height(x, y - e)) / 2 / e, 1)
    length = math.sqrt(sum(v * v for v in n))
    return [f32(round(v / length, 6)) * (1, 1, up)[k] for k, v in enumerate(n)]

def lens():
    places, corner, faces = [], {}, []
    def vertex(i, j, up):
        key = (i, j % SECTORS if i else 0, up if i < RINGS else 0)
        if key not in corner:
            corner[key] = len(places)
            a = 2 * math.pi * (j % SECTORS) / SECTORS
            x, y = i / RINGS * math.cos(a), i / RINGS * math.sin(a)
            places.append((x, y, up * height(x, y) if i < RINGS else 0.0))
        v = corner[key]
        return v, up
    for up in (1, -1):
        for i in range(RINGS):
            for j in range(SECTORS):
                q = [vertex(i, j, up), vertex(i + 1, j, up), vertex(i + 1, j + 1, up), vertex(i, j + 1, up)]
                for t in ((0, 1, 2), (0, 2, 3)):
                    t = [q[k] for k in t]
                    if len({v for v, _ in t}) == 3:
                        faces.append(t if up > 0 else t[::-1])
    return places, faces

def make(kind, path):
    places, faces = lens()
    with open(path, "w") as o:
        o.write("".join("v %.6f %.6f %.6f\n" % p for p in places))
        if kind in ("soft", "back"):
            for x, y, z in places:
                o.write("vn %.6f %.6f %.6f\n" % tuple(normal(x, y, -1 if z < 0 else 1)))
            for t in faces:
                at = [v + 1 if kind == "soft" else v - len(places) for v, _ in t]
                o.write("f " + " ".join("%d//%d" % (v, v) for v in at) + "\n")
            return
        number, listed = {}, []
        for t in faces:
            for c in t:
                if c not in number:
                    number[c] = len(listed)
                    listed.append(c)
        for v, up in reversed(listed): # not in the order of the vertices
            o.write("vn %.6f %.6f %.6f\n" % tuple(normal(*places[v][:2], up)))
            if kind == "mapped":
                o.write("vt %.6f %.6f\n" % tuple(places[v][k] * 0.2 + (0.5, 0.5 + up * 0.25)[k] for k in (0, 1)))
        for t in faces:
            at = [(v + 1, len(listed) - number[v, up]) for v, up in t]
            o.write("f " + " ".join("%d/%d/%d" % (v, n, n) if kind == "mapped" else "%d//%d" % (v, n) for v, n in at) + "\n")

def load_obj(kind, path):
    places, listed, faces, vt = [], [], [], 0
    for line in open(path):
        w = line.split()
        if w[0] == "v": places.append(tuple(f32(float(x)) for x in w[1:4]))
        elif w[0] == "vn": listed.append(tuple(f32(float(x)) for x in w[1:]))
        elif w[0] == "vt": vt += 1
        elif w[0] == "f":
            c = [x.split("/") for x in w[1:]]
            assert all(len(x) == 3 and bool(x[1]) == (kind == "mapped") for x in c), line
            assert kind != "soft" or all(x[0] == x[2] for x in c), line
            faces.append(([int(x[0]) - 1 for x in c], [listed[int(x[2]) - 1] for x in c]))
    return places, faces

def with_vertices(places, normals, tri):
    one = {}
    first = [one.setdefault(p, i) for i, p in enumerate(places)]
    return places, [([first[i] for i in t], [normals[i] for i in t]) for t in tri]

def load_ply(kind, path):
    data = open(path, "rb").read()
    end = data.index(b"end_header\n") + 11
    head = data[:end].decode().split("\n")
    nv, nf = (int(l.split()[2]) for l in head if l.startswith("element"))
    named = [l.split()[-1] for l in head if l.startswith("property")]
    assert named == ["x", "y", "z", "nx", "ny", "nz", "vertex_indices"] + ["texcoord"] * (kind == "mapped"), named
    rows = [struct.unpack_from("<6f", data, end + 24 * i) for i in range(nv)]
    face = "<B3iB6f" if kind == "mapped" else "<B3i"
    tri = [struct.unpack_from(face, data, end + 24 * nv + struct.calcsize(face) * i)[1:4] for i in range(nf)]
    assert len(data) == end + 24 * nv + struct.calcsize(face) * nf
    return with_vertices([r[:3] for r in rows], [r[3:] for r in rows], tri)

def load_glb(kind, path):
    _, at, ids = glb.load(path)
    assert ("TEXCOORD_0" in at) == (kind == "mapped")
    return with_vertices(at["POSITION"], at["NORMAL"], [ids[i:i + 3] for i in range(0, len(ids), 3)])

def look(kind, path):
    places, faces = {"obj": load_obj, "ply": load_ply, "glb": load_glb}[path[-3:]](kind, path)
    # a GLB's are made as long as 1 again
    same = (lambda n: tuple(round(v, 4) for v in n)) if path.endswith("glb") else tuple
    old_places, old = lens()
    old = {same(normal(*old_places[v][:2], up)) for t in old for v, up in t}
    long = off = other = fresh = 0
    edges, ring = {}, {}
    for ids, normals in faces:
        p = [places[i] for i in ids]
        u, v = [[p[k][i] - p[0][i] for i in range(3)] for k in (1, 2)]
        n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
        length = math.sqrt(sum(x * x for x in n))
        for i, m in zip(ids, normals):
            long += abs(math.sqrt(sum(x * x for x in m)) - 1) > 1e-5
            other += m[2] * n[2] <= 0
            off += sum(a * b for a, b in zip(n, m)) < 0.8 * length
            if places[i][2] == 0: ring.setdefault(i, set()).add(m)
        for k in range(3):
            e = tuple(sorted((p[k], p[(k + 1) % 3])))
            edges[e] = edges.get(e, 0) + 1
    fresh = sum(same(m) not in old for r in ring.values() for m in r)
    print(path, len(faces), "faces", long, "long", off, "off", other, "of the other cap", fresh, "fresh",
          sum(c != 2 for c in edges.values()), "open;", len(ring) > 15 and {len(r) for r in ring.values()})

if sys.argv[1] == "make":
    for kind in sys.argv[2:]: make(kind, kind + ".obj")
else:
    for kind, path in zip(sys.argv[2::2], sys.argv[3::2]): look(kind, path)
END

# looks KIND FILE FACES: will be looked at: whole, the ring sharp
seen=()
looks() {
	seen+=("$1" "$2")
	echo "$2 $3 faces 0 long 0 off 0 of the other cap 0 fresh 0 open; {2}" >>wanted
}

expect 0 python3 lens.py make hard mapped soft back
pieces=(--cluster-faces 1000 --micro-faces 300 --final-faces 1500)
streamed=(--cluster-faces 1000 --final-faces 400)

# in one piece, in clusters, streamed; threads and memory change nothing; other formats double vertices
for kind in hard mapped; do
	expect 0 "$WHITTLE" reduce $kind.obj -o $kind-one.obj --faces 600
	grep -q 'carried over: .*normals of corners$' out || fail "not named: $(cat out)"
	! grep -q 'not carried' out || fail "left behind: $(cat out)"
	looks $kind $kind-one.obj 600
	expect 0 "$WHITTLE" reduce -q $kind.obj -o $kind-pieces.obj --faces 600 "${pieces[@]}" --threads 2
	looks $kind $kind-pieces.obj 600
	expect 0 "$WHITTLE" reduce -q $kind.obj -o again.obj -f --faces 600 "${pieces[@]}" --threads 1 --memory 48M
	cmp -s $kind-pieces.obj again.obj || fail "threads or memory changed the bytes"
	for to in obj ply glb; do
		expect 0 "$WHITTLE" reduce -q $kind.obj -o $kind-streamed.$to --faces 1200 "${streamed[@]}"
		looks $kind $kind-streamed.$to 1200
		[ $to = obj ] && continue # above
		expect 0 "$WHITTLE" reduce -q $kind.obj -o $kind-one.$to --faces 600
		looks $kind $kind-one.$to 600
	done
done
expect 0 python3 lens.py look "${seen[@]}"
cmp -s wanted out || fail "$(diff wanted out) $(cat err)"
expect 2 "$WHITTLE" reduce hard.obj -o never.obj --faces 600 --weight-of normal=1
expect 0 "$WHITTLE" reduce hard.obj -o bare.obj --faces 600 --attributes none
grep -q 'not carried over: normals$' out || fail "not named: $(cat out)"
! grep -q '^vn' bare.obj || fail "normals all the same"

# vertices' own normals are properties of vertices, as those of PLY
for kind in soft back; do
	expect 0 "$WHITTLE" reduce $kind.obj -o $kind-out.obj --faces 600 --weight-of normal=0.1
	grep -q 'carried over: nx, ny, nz (normal)$' out || fail "not named: $(cat out)"
	! grep -q 'not carried' out || fail "left behind: $(cat out)"
done
cmp -s soft-out.obj back-out.obj || fail "relative indices mean something else"
expect 0 "$WHITTLE" reduce -q soft.obj -o again.obj -f --faces 600 --weight-of normal=0.1 --threads 1 --memory 48M
cmp -s soft-out.obj again.obj || fail "threads or memory changed the bytes"
expect 0 "$WHITTLE" reduce -q soft.obj -o soft.ply --faces 600 --weight-of normal=0.1
expect 0 "$WHITTLE" reduce -q soft.ply -o from-ply.obj --faces 599 # every face of its own number
expect 0 python3 lens.py look soft soft-out.obj soft from-ply.obj
grep -q '^soft-out.obj 600 faces 0 long .* 0 open; False$' out || fail "soft: $(cat out err)"
grep -q '^from-ply.obj 598 faces 0 long .* 0 open; False$' out || fail "from PLY: $(cat out err)"

# odd ones: a normal that the file does not have; faces without; one a face, which tell nothing; none used
square='v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nvn 0 0 2\nvn 0 0.6 0.8\nvn 1 nan inf\n'
odd() { printf "$square$1" >odd.obj; }
odd 'f 1//9 2//0 3//-9\nf 1//1 3//2 4//-1\nf 1 2 5\nf 1 2//2 4\n'
expect 0 "$WHITTLE" reduce -q odd.obj -o odd-out.obj --faces 100% --min-component 1
[ "$(grep -c '^f [0-9]*//[0-9]* [0-9]*//[0-9]* [0-9]*//[0-9]*$' odd-out.obj)" = 1 ] || fail "odd: $(cat odd-out.obj)"
[ "$(grep -c '^f [0-9]* [0-9]* [0-9]*$' odd-out.obj)" = 3 ] || fail "odd: $(cat odd-out.obj)"
expect 0 "$WHITTLE" reduce -q odd.obj -o odd.ply --ascii --faces 100%
! grep -q nan odd.ply || fail "no number: $(cat odd.ply)"
odd 'f 1//1 2//1 3//1\nf 1//2 3//2 4//2\n'
expect 0 "$WHITTLE" reduce odd.obj -o odd.ply -f --faces 1
grep -q 'not carried over: normals of flat faces$' out || fail "not named: $(cat out)"
odd 'f 1 2 3\nf 1 3 4\n'
expect 0 "$WHITTLE" reduce odd.obj -o odd.ply -f --faces 1
grep -q 'not carried over: normals$' out || fail "not named: $(cat out)"
odd 'f 1//1 2//2 3//3\nf -5//-3 -3//-1 4//4\n' # the fourth has none
expect 0 "$WHITTLE" reduce -q odd.obj -o odd.ply -f --ascii --faces 100%
grep -qx '0 1 0 0 0 0' odd.ply || fail "no normal is not 0: $(cat odd.ply)"
odd 'f 1//1 2//x 3/2/1/7\n'
expect 0 "$WHITTLE" reduce -q odd.obj -o odd.ply -f --faces 100%

# a real scan with hard edges, and many faults
scan=${WHITTLE_DATA:-}/scans/venusm.obj
if [ -r "$scan" ]; then
	expect 0 "$WHITTLE" reduce "$scan" -o scan.obj --faces 40%
	grep -q 'carried over: normals of corners$' out || fail "not named: $(cat out)"
	expect 0 "$WHITTLE" reduce -q "$scan" -o scan-streamed.obj --faces 40% --cluster-faces 4000 --final-faces 2000
	for f in scan.obj scan-streamed.obj; do
		[ "$(grep -c '^f [0-9]*//[0-9]* [0-9]*//[0-9]* [0-9]*//[0-9]*$' $f)" -ge 17342 ] || fail "$f: faces without normals"
	done
else
	echo "no scan: $scan"
fi

[ "$failures" -eq 0 ] || exit 1
echo "normals: ok"
