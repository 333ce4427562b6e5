# Texture coordinates, materials and other things of faces and corners, from the command.
. "$(dirname "$0")/lib.sh"
command -v python3 >/dev/null || {
	echo "skipped: no python3"
	exit 77
}

# atlas.py make N FORMAT FILE: a ball of six charts of N x N squares, with two materials; "doubled": in
# which each vertex has texture coordinates, so that those on borders of charts are there twice or
# three times, with a quality and a normal; "off": the same of text without these
# atlas.py charts FILE: of any mesh, how many charts it has, and triangles turned over in them
# atlas.py look FILE: what became of it: triangles turned over in the texture, corners outside their
# chart, corners on borders that the file did not have, faces of a wrong material, edges that are open
# where equal positions are one
cat >atlas.py <<'END'
import glb, math, struct, sys
SIDES = (((1,0,0),(0,1,0),(0,0,1)), ((-1,0,0),(0,0,1),(0,1,0)), ((0,1,0),(0,0,1),(1,0,0)),
         ((0,-1,0),(1,0,0),(0,0,1)), ((0,0,1),(1,0,0),(0,1,0)), ((0,0,-1),(0,1,0),(1,0,0)))
f32 = lambda x: struct.unpack("f", struct.pack("f", x))[0]

def chart(f):
    return f % 3 / 3 + 0.02, f // 3 / 2 + 0.02, 1 / 3 - 0.04, 1 / 2 - 0.04

def ball(n):
    known, places, faces = {}, [], []
    def vertex(p):
        key = tuple(round(x * 1e9) for x in p)
        if key not in known:
            known[key] = len(places)
            length = math.sqrt(sum(x * x for x in p))
            q = [x / length for x in p]
            r = 1 + 0.05 * math.sin(7 * q[0]) * math.sin(9 * q[1] + 2) * math.sin(8 * q[2] + 1)
            places.append([f32(round(r * x, 6)) for x in q])
        return known[key]
    for f, (out, a, b) in enumerate(SIDES):
        u, v, su, sv = chart(f)
        def corner(i, j):
            s, t = (math.tan((2 * x / n - 1) * math.pi / 4) for x in (i, j))
            return vertex([out[k] + s * a[k] + t * b[k] for k in range(3)]), \
                (f32(round(u + su * i / n, 6)), f32(round(v + sv * j / n, 6)))
        for j in range(n):
            for i in range(n):
                q = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)]
                faces.append((f, (q[0], q[1], q[2])))
                faces.append((f, (q[0], q[2], q[3])))
    return places, faces

def make_doubled(places, faces, form, path):
    seen, vertices, tri = {}, [], []
    for f, corners in faces:
        ids = []
        for v, uv in corners:
            if (v, f) not in seen:
                seen[v, f] = len(vertices)
                vertices.append((*places[v], 1 - v / 9999, *uv))
            ids.append(seen[v, f])
        tri.append(ids)
    order = sorted(range(len(vertices)), key=lambda i: i * 7919 % 10007) # copies are not side by side
    place = {old: new for new, old in enumerate(order)}
    with open(path, "wb") as o:
        if form == "off":
            o.write(("STOFF\n%d %d 0\n" % (len(vertices), len(tri))).encode())
            for i in order: o.write(("%.9g %.9g %.9g %.9g %.9g\n" % (*vertices[i][:3], *vertices[i][4:])).encode())
            for t in tri: o.write(("3 %d %d %d\n" % tuple(place[i] for i in t)).encode())
            return
        o.write(("ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty float x\nproperty float y\n"
            "property float z\nproperty float quality\nproperty float s\nproperty float t\nelement face %d\n"
            "property list uchar int vertex_indices\nend_header\n" % (len(vertices), len(tri))).encode())
        for i in order: o.write(struct.pack("<6f", *vertices[i]))
        for t in tri: o.write(struct.pack("<B3i", 3, *(place[i] for i in t)))

def make(n, form, path):
    places, faces = ball(n)
    if form in ("doubled", "off"):
        return make_doubled(places, faces, form, path)
    if form == "obj":
        with open(path, "w") as o:
            o.write("mtllib some ball.mtl\n" + "".join("v %.6f %.6f %.6f\n" % tuple(p) for p in places))
            vt = {}
            for f, corners in faces: # each chart has its own
                for v, uv in corners:
                    if (f, uv) not in vt:
                        vt[f, uv] = len(vt) + 1
                        o.write("vt %.6f %.6f 0\n" % uv)
            last, count, total = -1, len(places), len(vt)
            for i, (f, corners) in enumerate(faces):
                if f != last:
                    o.write("g side %d\nusemtl %s\n" % (f, "skin" if f < 3 else "old bone"))
                last = f
                at = [(v + 1, vt[f, uv]) for v, uv in corners]
                if i % 3 == 0: # counted back
                    at = [(v - count - 1, t - total - 1) for v, t in at]
                o.write("f " + " ".join("%d/%d" % x for x in at) + "\n")
        return
    if form == "holes": # pinholes in all charts
        faces = [f for i, f in enumerate(faces) if i % 61 != 30]
    head = "ply\nformat %s 1.0\ncomment TextureFile a b.png\ncomment TextureFile c.png\n" \
        "element vertex %d\nproperty float x\nproperty float y\nproperty float z\n" \
        "element face %d\nproperty uchar red\nproperty list uchar int vertex_indices\n" \
        "property list uchar float texcoord\nproperty int texnumber\nend_header\n" % (
            "ascii" if form == "text" else "binary_little_endian", len(places), len(faces))
    with open(path, "wb") as o:
        o.write(head.encode())
        for p in places:
            o.write(("%.9g %.9g %.9g\n" % tuple(p)).encode() if form == "text" else struct.pack("<3f", *p))
        for f, c in faces:
            uv = [x for _, t in c for x in t]
            ids = [v for v, _ in c]
            if form == "text":
                o.write(("%d 3 %d %d %d 6 " % (40 * f, *ids) + " ".join("%.9g" % x for x in uv) + " %d\n" % (f // 3)).encode())
            else:
                o.write(struct.pack("<BB3iB6fi", 40 * f, 3, *ids, 6, *uv, f // 3))

def load_obj(path):
    places, vt, faces, label = [], [], [], [None, None]
    for line in open(path):
        w = line.split(None, 1)
        if w[0] == "v": places.append(tuple(map(float, w[1].split())))
        elif w[0] == "vt": vt.append(tuple(f32(float(x)) for x in w[1].split()[:2]))
        elif w[0] == "usemtl": label[0] = ("skin", "old bone").index(w[1].strip())
        elif w[0] == "g": label[1] = int(w[1].split()[1])
        elif w[0] == "f":
            c = [x.split("/") for x in w[1].split()]
            faces.append(([int(x[0]) - 1 for x in c], [vt[int(x[1]) - 1] for x in c], *label))
    return places, faces

def side_of(uv): # by the texture coordinates alone
    for f in range(6):
        u, v, su, sv = chart(f)
        if all(u - 0.02 <= x <= u + su + 0.02 and v - 0.02 <= y <= v + sv + 0.02 for x, y in uv): return f
    return 9

def load_off(path):
    w = open(path).read().split()
    assert w[0] == "STOFF"
    nv, nf, at = int(w[1]), int(w[2]), list(map(float, w[4:]))
    rows = [at[5 * i:5 * i + 5] for i in range(nv)]
    tri = [list(map(int, at[5 * nv + 4 * i + 1:5 * nv + 4 * i + 4])) for i in range(nf)]
    return with_vertices([r[:3] for r in rows], [r[3:] for r in rows], tri)

def load_glb(path):
    _, at, ids = glb.load(path)
    return with_vertices(at["POSITION"], [(u, 1 - v) for u, v in at["TEXCOORD_0"]],
        [ids[i:i + 3] for i in range(0, len(ids), 3)])

def with_vertices(places, uv, tri):
    one = {}
    first = [one.setdefault(tuple(p), i) for i, p in enumerate(places)]
    faces = []
    for t in tri:
        side = side_of([uv[i] for i in t])
        faces.append(([first[i] for i in t], [tuple(f32(x) for x in uv[i]) for i in t], side // 3, side))
    return [tuple(p) for p in places], faces

def load_doubled(head, data):
    assert [l.split()[-1] for l in head if l.startswith("property")] == ["x", "y", "z", "quality", "s", "t", "vertex_indices"], head
    nv, nf = (int(l.split()[2]) for l in head if l.startswith("element"))
    rows = [struct.unpack_from("<6f", data, 24 * i) for i in range(nv)]
    tri = [struct.unpack_from("<B3i", data, 24 * nv + 13 * i)[1:] for i in range(nf)]
    assert len(data) == 24 * nv + 13 * nf
    return with_vertices([r[:3] for r in rows], [r[4:] for r in rows], tri)

def load_ply(path):
    data = open(path, "rb").read()
    end = data.index(b"end_header\n") + 11
    head = data[:end].decode().split("\n")
    if "property float s" in head:
        return load_doubled(head, data[end:])
    assert "comment TextureFile a b.png" in head and "comment TextureFile c.png" in head, head
    nv, nf = (int(l.split()[2]) for l in head if l.startswith("element"))
    places = [struct.unpack_from("<3f", data, end + 12 * i) for i in range(nv)]
    at, faces = end + 12 * nv, []
    for i in range(nf):
        n, a, b, c, m, *uv, red, number = struct.unpack_from("<B3iB6fBi", data, at)
        at += struct.calcsize("<B3iB6fBi")
        assert n == 3 and m == 6 and red % 40 == 0
        faces.append(([a, b, c], [tuple(uv[2 * k:2 * k + 2]) for k in range(3)], number, red // 40))
    assert at == len(data)
    return places, faces

def look(path, n):
    places, faces = {"obj": load_obj, "ply": load_ply, "off": load_off, "glb": load_glb}[path[-3:]](path)
    q = (lambda uv: tuple(round(x, 5) for x in uv)) if path.endswith("glb") else tuple # v counts from the other side there
    old = {(f, q(uv)) for f, c in ball(n)[1] for _, uv in c}
    turned = outside = wrong = fresh = 0
    edges, wedges = {}, {}
    for ids, uv, label, side in faces:
        (a, b), (c, d), (g, h) = uv
        turned += (c - a) * (h - b) - (d - b) * (g - a) <= 0
        u, v, su, sv = chart(side)
        outside += any(not (u - 1e-6 <= x <= u + su + 1e-6 and v - 1e-6 <= y <= v + sv + 1e-6) for x, y in uv)
        wrong += label != side // 3
        for k in range(3):
            wedges.setdefault(ids[k], set()).add((side, q(uv[k])))
            e = tuple(sorted((places[ids[k]], places[ids[(k + 1) % 3]])))
            edges[e] = edges.get(e, 0) + 1
    borders = [w for w in wedges.values() if len(w) > 1]
    fresh = sum(not w <= old for w in borders)
    print(len(faces), "faces", turned, "turned", outside, "outside", wrong, "wrong", fresh, "fresh",
          sum(c != 2 for c in edges.values()), "open;", len(borders) > 20, len({f[3] for f in faces}))

def charts(path): # of any mesh: charts, and triangles turned over against most of their chart
    places, faces = load_obj(path) if path.endswith("obj") else load_scan(path)
    up, corner = list(range(len(faces))), {}
    def root(i):
        while up[i] != i: up[i] = up[up[i]]; i = up[i]
        return i
    for i, (ids, uv, *_) in enumerate(faces):
        for k in range(3):
            a, b = sorted(((ids[k], uv[k]), (ids[(k + 1) % 3], uv[(k + 1) % 3])))
            up[root(i)] = root(corner.setdefault((a, b), i))
    signs = {}
    for i, (ids, uv, *_) in enumerate(faces):
        (a, b), (c, d), (g, h) = uv
        s = signs.setdefault(root(i), [0, 0])
        area = (c - a) * (h - b) - (d - b) * (g - a)
        if area: s[area > 0] += 1
    print(len(faces), "faces", len(signs), "charts", sum(min(s) for s in signs.values()), "turned")

def load_scan(path):
    data = open(path, "rb").read()
    end = data.index(b"end_header\n") + 11
    nv, nf = (int(l.split()[2]) for l in data[:end].decode().split("\n") if l.startswith("element"))
    rows = [struct.unpack_from("<B3IB6f", data, end + 12 * nv + 38 * i) for i in range(nf)]
    return None, [(r[1:4], [tuple(r[5 + 2 * k:7 + 2 * k]) for k in range(3)]) for r in rows]

if sys.argv[1] == "charts": charts(sys.argv[2])
elif sys.argv[1] == "make": make(int(sys.argv[2]), sys.argv[3], sys.argv[4])
else: look(sys.argv[2], int(sys.argv[3]))
END

# looks FILE FACES: whole, its charts too
looks() {
	expect 0 python3 atlas.py look "$1" 24
	grep -qx "$2 faces 0 turned 0 outside 0 wrong 0 fresh 0 open; True 6" out || fail "$1: $(cat out)"
}

python3 atlas.py make 24 obj ball.obj || fail "make"
python3 atlas.py make 24 binary ball.ply || fail "make"
python3 atlas.py make 24 text text.ply || fail "make"

# all in one piece; in micro-clusters and clusters; streamed. Threads and memory change nothing
pieces=(--cluster-faces 2000 --micro-faces 500 --final-faces 3000)
streamed=(--cluster-faces 1000 --final-faces 400)
for input in ball.obj ball.ply; do
	kind=${input#ball.}
	expect 0 "$WHITTLE" reduce $input -o one.$kind --faces 10%
	grep -q 'carried over: texture coordinates of corners' out || fail "not named: $(cat out)"
	! grep -q 'not carried' out || fail "left behind: $(cat out)"
	looks one.$kind 690
	expect 0 "$WHITTLE" reduce -q $input -o pieces.$kind --faces 10% "${pieces[@]}" --threads 2
	looks pieces.$kind 690
	expect 0 "$WHITTLE" reduce -q $input -o again.$kind --faces 10% "${pieces[@]}" --threads 1 --memory 48M
	cmp -s pieces.$kind again.$kind || fail "threads or memory changed the bytes of $kind"
	expect 0 "$WHITTLE" reduce -q $input -o streamed.$kind --faces 20% "${streamed[@]}" --threads 2
	looks streamed.$kind 1382
	expect 0 "$WHITTLE" reduce -q $input -o again.$kind -f --faces 20% "${streamed[@]}" --threads 1
	cmp -s streamed.$kind again.$kind || fail "threads changed the bytes of a streamed $kind"
done
grep -qx 'mtllib some ball.mtl' one.obj || fail "the library of materials is gone"

# the files that a result needs are named: what they have to be put beside, where it is not there
printf 'newmtl skin\nmap_Kd the skin.jpg\nnewmtl old bone\nmap_Kd bone.png\n' >'some ball.mtl'
mkdir away
expect 0 "$WHITTLE" reduce ball.obj -o near.obj --faces 10% --report near.json
grep -qx 'refers to some ball.mtl, the skin.jpg, bone.png' out || fail "not named: $(cat out)"
grep -q '"refers_to": "some ball.mtl, the skin.jpg, bone.png"' near.json || fail "not in the report"
expect 0 "$WHITTLE" reduce ball.obj -o away/far.ply --faces 10%
grep -qx 'refers to some ball.mtl, the skin.jpg, bone.png: put them beside it.*' out || fail "not named: $(cat out)"
expect 0 "$WHITTLE" reduce ball.obj -o away/far.stl --faces 10%
! grep -q 'refers to' out || fail "STL refers to nothing: $(cat out)"

# names of materials and groups come through PLY, and the materials' textures with them
expect 0 "$WHITTLE" reduce ball.obj -o named.ply --faces 20%
grep -q 'carried over: texture coordinates of corners, material of faces, group of faces$' out || fail "not named: $(cat out)"
! grep -q 'not carried' out || fail "left behind: $(cat out)"
for line in 'MaterialFile some ball.mtl' 'Material skin' 'Material old bone' 'Group g side 5'; do
	grep -aqx "comment $line" named.ply || fail "no comment: $line"
done
expect 0 "$WHITTLE" reduce named.ply -o named.obj --faces 50%
! grep -q 'not carried' out || fail "left behind: $(cat out)"
grep -qx 'mtllib some ball.mtl' named.obj || fail "the library of materials is gone"
looks named.obj 690
expect 0 "$WHITTLE" reduce ball.ply -o numbers.obj --faces 10%
grep -q 'not carried over: red of faces, texnumber of faces, names of texture files$' out || fail "not named: $(cat out)"

# text says the same as binary; what is left out on request
expect 0 "$WHITTLE" reduce -q text.ply -o from-text.ply --faces 10%
cmp -s one.ply from-text.ply || fail "text gives another result than binary"
expect 0 "$WHITTLE" reduce -q ball.ply -o text-out.ply --faces 10% --ascii
expect 0 "$WHITTLE" reduce -q text-out.ply -o back.ply --faces 100% --ascii
cmp -s text-out.ply back.ply || fail "copied text differs"
expect 0 "$WHITTLE" reduce ball.ply -o bare.ply --faces 10% --attributes none
grep -q 'not carried over: red of faces, texcoord of faces, texnumber of faces' out || fail "not named: $(cat out)"
expect 0 "$WHITTLE" reduce ball.ply -o some.ply --faces 10% --attributes texture
grep -q 'not carried over: red of faces, texnumber of faces' out || fail "not named: $(cat out)"
expect 2 "$WHITTLE" reduce ball.ply -o never.ply --faces 10% --attributes texnummer

# texture coordinates of vertices: what is cut along the borders of charts is joined for the work, and
# cut again; in windows and clusters, too; from any format to any other that has room for them
python3 atlas.py make 24 doubled doubled.ply || fail "make"
python3 atlas.py make 24 off doubled.off || fail "make"
expect 0 "$WHITTLE" reduce doubled.ply -o one-doubled.ply --faces 10% --report doubled.json
grep -q 'carried over: s, t (texture), quality (scalar)' out || fail "not named: $(cat out)"
! grep -q 'not carried' out || fail "left behind: $(cat out)"
grep -q '"joined_vertices": *292' doubled.json || fail "not counted: $(grep vertices doubled.json)"
looks one-doubled.ply 690
expect 0 "$WHITTLE" reduce -q doubled.ply -o few.ply --faces 2%
looks few.ply 138
expect 0 "$WHITTLE" reduce -q doubled.ply -o pieces-doubled.ply --faces 10% "${pieces[@]}" --threads 2
looks pieces-doubled.ply 690
expect 0 "$WHITTLE" reduce -q doubled.ply -o again-doubled.ply --faces 10% "${pieces[@]}" --threads 1 --memory 48M
cmp -s pieces-doubled.ply again-doubled.ply || fail "threads or memory changed the bytes"
expect 0 "$WHITTLE" reduce -q doubled.ply -o streamed-doubled.ply --faces 20% "${streamed[@]}" --threads 2
looks streamed-doubled.ply 1382
expect 0 "$WHITTLE" reduce -q doubled.ply -o resumed-doubled.ply --faces 20% "${streamed[@]}" --run-dir run --resume
cmp -s streamed-doubled.ply resumed-doubled.ply || fail "a run with a folder gives another result"
expect 0 "$WHITTLE" reduce -q doubled.off -o one.off --faces 10%
looks one.off 690
expect 0 "$WHITTLE" reduce -q doubled.ply -o from-doubled.obj --faces 10%
grep -q '^vt ' from-doubled.obj || fail "no vt"
sed 's/^comment TextureFile a b.png$/comment TextureFile a "b".png/; /c.png/d' text.ply >single.ply
expect 0 "$WHITTLE" reduce -q single.ply -o single.glb --faces 10%
grep -aq '"uri":"a%20%22b%22.png"' single.glb || fail "no picture named: $(head -c 1500 single.glb)"
for input in ball.obj ball.ply doubled.ply; do
	for kind in off glb; do
		expect 0 "$WHITTLE" reduce -q $input -o to.$kind -f --faces 10%
		looks to.$kind 690
		expect 0 "$WHITTLE" reduce -q $input -o to.$kind -f --faces 20% "${streamed[@]}"
		looks to.$kind 1382
	done
done

# a real scan
scan=${WHITTLE_DATA:-}/scans/openmvs_scene_mesh_texture.ply
if [ -r "$scan" ]; then
	expect 0 "$WHITTLE" reduce -q "$scan" -o scan.ply --faces 10%
	before=$(python3 atlas.py charts "$scan") after=$(python3 atlas.py charts scan.ply)
	[ "${after#* faces }" = "${before#* faces }" ] || fail "a scan: $before; then $after"
else
	echo "no scan: $scan"
fi

# a run that is resumed
expect 0 "$WHITTLE" reduce -q ball.ply -o resumed.ply --faces 20% "${streamed[@]}" --run-dir run --resume
cmp -s streamed.ply resumed.ply || fail "a run with a folder gives another result"

# texture coordinates that a file does not have, and corners without any
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 nan\nf 1/1 2/2 3/9\nf 2 4 3/-1\n' >odd.obj
expect 0 "$WHITTLE" reduce -q odd.obj -o odd.ply --faces 100%
grep -q 'texcoord' odd.ply || fail "no texture coordinates"

# changes of topology carry it along: pinholes close, in the texture too
python3 atlas.py make 24 holes holes.ply || fail "make"
for extra in "" "--cluster-faces 2000 --micro-faces 500 --final-faces 3000"; do
	expect 0 "$WHITTLE" reduce holes.ply -o closed.ply -f --faces 690 --topology simplify --attributes all $extra
	! grep -q 'not carried' out || fail "left behind: $(cat out)"
	grep -q '[0-9][0-9] holes closed' out || fail "no holes closed: $(cat out)"
	expect 0 python3 atlas.py look closed.ply 24
	grep -qE '^(689|690) faces 0 turned 0 outside 0 wrong 0 fresh [0-9]+ open; True 6$' out || fail "closed: $(cat out)"
done
expect 0 "$WHITTLE" reduce -q holes.ply -o again.ply -f --faces 690 --topology simplify --threads 1 $extra
cmp -s closed.ply again.ply || fail "threads changed the bytes"

# a label of one byte is all that faces have
printf 'ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 2\nproperty list uchar int vertex_indices\nproperty uchar part\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 7\n3 0 2 3 9\n' >part.ply
expect 0 "$WHITTLE" reduce -q part.ply -o parts.ply --faces 2 --ascii --min-component 1
[ "$(tail -2 parts.ply | sort)" = "$(printf '3 0 1 3 7\n3 0 3 2 9')" ] || fail "labels: $(cat parts.ply)"

# labels like a chessboard's hold every vertex, and the advice says what frees them
python3 - >board.ply <<'E2'
n = 8
print("ply\nformat ascii 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z" % (n + 1) ** 2)
print("element face %d\nproperty list uchar int vertex_indices\nproperty uchar part\nend_header" % (2 * n * n))
for i in range((n + 1) ** 2):
    print(i % (n + 1), i // (n + 1), 0)
for i in range(n * n):
    a = i // n * (n + 1) + i % n
    for b, c in ((a + 1, a + n + 2), (a + n + 2, a + n + 1)):
        print(3, a, b, c, (i // n + i) % 2)
E2
expect 4 "$WHITTLE" reduce board.ply -o stuck.ply --faces 4 --topology simplify
grep -q 'attributes none' err || fail "no advice: $(cat err)"
expect 0 "$WHITTLE" reduce board.ply -o free.ply --faces 4 --topology simplify --attributes none

# a list of texture coordinates that is neither two for each corner nor empty is damage
listed() {
	printf 'ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 2\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 0\n3 0 2 3 %s\n' "$1" >listed.ply
}
for list in '5 0 0 1 0 1' '7 0 0 1 0 1 1 0' '1 0' '3 0 1 2' '12 0 0 0 0 0 0 0 0 0 0 0 0'; do
	listed "$list"
	expect 3 "$WHITTLE" reduce listed.ply -o never.ply --faces 1
	grep -q "listed.ply', face 1 (line 16): texcoord has ${list%% *} values for 3 corners" err || fail "$list: $(cat err)"
	python3 - <<-'END' || fail "no binary"
		text = open("listed.ply").read().replace("format ascii", "format binary_big_endian")
		import struct
		head, body = text.split("end_header\n")
		rows = [l.split() for l in body.splitlines()]
		out = b"".join(struct.pack(">3f", *map(float, r)) for r in rows[:4])
		for r in rows[4:]:
		    out += struct.pack(">B3iB", 3, *map(int, r[1:4]), int(r[4])) + b"".join(struct.pack(">f", float(x)) for x in r[5:])
		open("binary.ply", "wb").write((head + "end_header\n").encode() + out)
	END
	expect 3 "$WHITTLE" reduce binary.ply -o never.ply --faces 1
	grep -q "binary.ply', face 1 (byte [0-9]*): texcoord has ${list%% *} values for 3 corners" err || fail "$list: $(cat err)"
	expect 0 "$WHITTLE" reduce -q listed.ply -o without.ply -f --faces 2 --attributes none
done
for list in 0 '6 0 0 1 0 1 1'; do
	listed "$list"
	expect 0 "$WHITTLE" reduce -q listed.ply -o with.ply -f --faces 2
done

# a picture with it; the same with windows; without a texture to be found
python3 - <<'END' || fail "no picture made"
import struct, zlib
rows = b"".join(b"\0" + bytes((255 * (x < 8), 255 * (y < 8), 40)[k] for x in range(16) for k in range(3)) for y in range(16))
chunk = lambda t, d: struct.pack(">I", len(d)) + t + d + struct.pack(">I", zlib.crc32(t + d))
open("skin.png", "wb").write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 16, 16, 8, 2, 0, 0, 0)) +
    chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))
open("some ball.mtl", "w").write("newmtl skin\nmap_Kd skin.png\nnewmtl old bone\nmap_Kd -s 1 1 1 skin.png\n")
END
if "$WHITTLE" render -q ball.obj -o plain.png --size 60x40 2>err; then
	expect 0 "$WHITTLE" render -q ball.obj -o named.png --size 60x40 --texture
	cmp -s plain.png named.png && fail "the texture is not seen"
	expect 0 "$WHITTLE" reduce -q ball.obj -o whole.ply --faces 6900
	expect 0 "$WHITTLE" render -q whole.ply -o whole.png --size 60x40 --texture
	expect 0 "$WHITTLE" render -q whole.ply -o same.png --size 60x40 --texture=skin.png
	cmp -s whole.png same.png || fail "materials of a PLY file have no textures"
	expect 0 "$WHITTLE" render -q ball.obj -o given.png --size 60x40 --texture=skin.png --threads 1
	cmp -s named.png given.png || fail "the same texture gives another picture"
	expect 0 "$WHITTLE" render -q doubled.ply -o doubled.png --size 60x40 --texture=skin.png
	cmp -s named.png doubled.png || fail "texture coordinates of vertices give another picture"
	expect 3 "$WHITTLE" render -q ball.ply -o never.png --texture
	expect 3 "$WHITTLE" render -q ball.ply -o never.png --texture=ball.obj
	base64 -d >skin.jpg <<-'END' # the same picture
		/9j/4AAQSkZJRgABAQAAAQABAAD/2wBDAAMCAgICAgMCAgIDAwMDBAYEBAQEBAgGBgUGCQgKCgkICQkKDA8MCgsOCwkJDRENDg8Q
		EBEQCgwSExIQEw8QEBD/2wBDAQMDAwQDBAgEBAgQCwkLEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQ
		EBAQEBAQEBD/wAARCAAQABADAREAAhEBAxEB/8QAFQABAQAAAAAAAAAAAAAAAAAACAn/xAAUEAEAAAAAAAAAAAAAAAAAAAAA/8QA
		FwEAAwEAAAAAAAAAAAAAAAAABgcJCv/EABQRAQAAAAAAAAAAAAAAAAAAAAD/2gAMAwEAAhEDEQA/AKIJvi0ND1StD07mnANDySsf
		/9k=
	END
	if "$WHITTLE" render -q ball.obj -o jpeg.png --size 60x40 --texture=skin.jpg 2>err; then
		cmp -s plain.png jpeg.png && fail "a JPEG texture is not seen"
		head -c 200 skin.jpg >short.jpg
		expect 3 "$WHITTLE" render -q ball.ply -o never.png --texture=short.jpg
	else
		grep -q libjpeg err || fail "no JPEG: $(cat err)"
	fi
	head -c 60 skin.png >short.png
	expect 3 "$WHITTLE" render -q ball.ply -o never.png --texture=short.png
else
	grep -q libpng err || fail "no picture: $(cat err)"
fi

[ "$failures" -eq 0 ] || exit 1
echo "texture: ok"
