# Formats and compressed files, from the command: what goes in as one comes out as another.
. "$(dirname "$0")/lib.sh"

# counts FILE VERTICES FACES: check finds so many
counts() {
	expect 0 "$WHITTLE" check --no-progress "$1"
	if ! grep -q "^vertices  *$2\$" out || ! grep -q "^faces  *$3\$" out; then
		fail "$1 has not $2 vertices and $3 faces: $(head -5 out)"
	fi
}

# has PROGRAM: is it there, and was whittle built to need it
packs=()
for p in gzip zstd; do
	command -v $p >/dev/null || continue
	printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n' | $p -c >probe
	"$WHITTLE" check --no-progress probe >/dev/null 2>&1 && packs+=($p)
done
ending() { [ "$1" = gzip ] && echo gz || echo zst; }

"$WHITTLE" generate -q -o in.ply --faces 20K || fail "generate"

# out in every format, from the last pass and from clusters, and back: the same mesh
expect 0 "$WHITTLE" reduce -q in.ply -o small.ply --faces 4000
expect 0 "$WHITTLE" check --no-progress small.ply
vertices=$(awk '$1 == "vertices" { print $2 }' out)
streamed=(--cluster-faces 2000 --final-faces 3000)
expect 0 "$WHITTLE" reduce -q in.ply -o large.ply --faces 4000 "${streamed[@]}"
expect 0 "$WHITTLE" check --no-progress large.ply
streamed_vertices=$(awk '$1 == "vertices" { print $2 }' out)
for format in obj off stl; do
	expect 0 "$WHITTLE" reduce -q in.ply -o small.$format --faces 4000
	counts small.$format "$vertices" 4000
	expect 0 "$WHITTLE" reduce -q small.$format -o back.ply -f --faces 4000
	expect 0 "$WHITTLE" compare --json --samples 2000 small.ply back.ply
	grep -q '"rms_millionths": [0-9.]*e-\|"rms_millionths": 0\.0' out ||
		fail "$format is another mesh: $(grep rms_mill out)"
	expect 0 "$WHITTLE" reduce -q in.ply -o large.$format --faces 4000 "${streamed[@]}" --threads 1
	counts large.$format "$streamed_vertices" 4000
	expect 0 "$WHITTLE" reduce -q in.ply -o again --to $format --faces 4000 "${streamed[@]}" -f --threads 3
	cmp -s large.$format again || fail "threads changed the bytes of $format"
	expect 0 "$WHITTLE" info --bounds --json small.$format
	grep -q "\"format\": \"$format" out || fail "info does not know $format"
	grep -q '"diagonal"' out || fail "no bounds of $format"
	expect 0 "$WHITTLE" plan --json small.$format --faces 10%
	grep -q '"input_faces": 4000' out || fail "plan counts another number of faces in $format"
done
expect 0 "$WHITTLE" reduce -q in.ply -o text.stl --ascii --faces 4000
counts text.stl "$vertices" 4000
expect 0 "$WHITTLE" reduce -q in.ply -o - --to obj --faces 4000
cmp -s out small.obj || fail "standard output is another OBJ"

# GLB: lengths, counts and bounds are those of what is in it
command -v python3 >/dev/null || echo "no python3: what GLB holds is not looked at"
for f in small.glb large.glb; do
	[ $f = small.glb ] && more=() || more=("${streamed[@]}")
	expect 0 "$WHITTLE" reduce -q in.ply -o $f --faces 4000 "${more[@]}"
	command -v python3 >/dev/null || continue
	expect 0 python3 - $f <<'END'
import json, struct, sys
b = open(sys.argv[1], "rb").read()
magic, version, length, n, kind = struct.unpack("<4sIII4s", b[:20])
assert (magic, version, length, kind) == (b"glTF", 2, len(b), b"JSON") and n % 4 == 0
j = json.loads(b[20:20 + n])
size, kind = struct.unpack("<I4s", b[20 + n:28 + n])
body = b[28 + n:]
assert kind == b"BIN\0" and size == len(body) == j["buffers"][0]["byteLength"]
pos, idx = j["accessors"]
p = struct.unpack("<%df" % (3 * pos["count"]), body[:12 * pos["count"]])
i = struct.unpack("<%dI" % idx["count"], body[12 * pos["count"]:])
assert len(i) == 3 * 4000 and sorted(set(i)) == list(range(pos["count"]))
def as_float(v): return [struct.unpack("f", struct.pack("f", x))[0] for x in v]
assert [min(p[k::3]) for k in range(3)] == as_float(pos["min"])
assert [max(p[k::3]) for k in range(3)] == as_float(pos["max"])
END
done

# what GLB has no room for is refused before it is made: a file that is all hole
printf 'ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty float x\nproperty float y
property float z\nelement face %d\nproperty list uchar int vertex_indices\nend_header\n' \
	200000000 400000000 >huge.ply
truncate -s 3G huge.ply
expect 2 "$WHITTLE" plan huge.ply --to glb --faces 300M
grep -q '300000000 faces do not fit a GLB' err || fail "a GLB too large: $(cat err)"
expect 0 "$WHITTLE" plan huge.ply --to glb --faces 100M
expect 0 "$WHITTLE" plan huge.ply --to ply --faces 300M
rm huge.ply

# colours and normals in GLB: proportional to light, and unit vectors; quantized, half as large
expect 0 "$WHITTLE" generate -q -o coloured.ply --faces 4000 --colours --normals
expect 0 "$WHITTLE" reduce -q coloured.ply -o text.ply --ascii --faces 1G
expect 2 "$WHITTLE" reduce -q coloured.ply -o quantized.obj --faces 1000 --quantize
for how in plain quantized; do
	[ $how = plain ] && more=() || more=(--quantize)
	expect 0 "$WHITTLE" reduce -q coloured.ply -o $how.glb --faces 1G "${more[@]}"
	command -v python3 >/dev/null || continue
	expect 0 python3 - $how.glb text.ply <<'END'
import glb, struct, sys
j, at, ids = glb.load(sys.argv[1])
small = "extensionsRequired" in j
def as_float(v): return [struct.unpack("f", struct.pack("f", x))[0] for x in v]
def light(c): return c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4
pos = at["POSITION"]
lines = open(sys.argv[2]).read().split("end_header\n")[1].split("\n")
node = j["nodes"][0]
s, t = node.get("scale", [1, 1, 1]), node.get("translation", [0, 0, 0])
for i, p in enumerate(pos):
    w = as_float([float(x) for x in lines[i].split()])
    n, c = at["NORMAL"][i], at["COLOR_0"][i]
    most = 255 if small else 65535
    assert all(abs(p[k] * s[k] + t[k] - w[k]) <= small * s[0] / 2 + 1e-9 for k in range(3))
    assert all(abs(n[k] / (127 if small else 1) - w[3 + k]) < (0.005 if small else 1e-6) for k in range(3))
    assert all(abs(c[k] - most * light(w[6 + k] / 255)) <= 0.51 for k in range(3)) and c[3] == most
a = j["accessors"][0]
assert [min(p[k] for p in pos) for k in range(3)] == as_float(a["min"])
assert [max(p[k] for p in pos) for k in range(3)] == as_float(a["max"])
assert ids == [int(x) for l in lines[len(pos):] if l for x in l.split()[1:]]
END
done
[ $((7 * $(stat -c %s quantized.glb) / 4)) -lt "$(stat -c %s plain.glb)" ] || fail "quantized is not small"

# a target no smaller than the input copies it, but only into its own format
expect 0 "$WHITTLE" reduce -q small.obj -o same.obj --faces 100%
cmp -s small.obj same.obj || fail "an OBJ was not copied"
expect 0 "$WHITTLE" reduce -q small.obj -o same.off --faces 100%
counts same.off "$vertices" 4000

# what is not carried over is named
printf 'mtllib a\nv 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvn 0 0 1\nf 1//1 2//1 4//1 3//1\n' >named.obj
expect 0 "$WHITTLE" reduce named.obj -o named.ply --faces 1
grep -q 'not carried over: normals of flat faces, material libraries' out || fail "not named: $(cat out)"
grep -q '^carried over: red, green, blue' out || fail "colours of OBJ: $(cat out)"

# --from and --to over names and contents
cp small.off strange.obj
counts strange.obj "$vertices" 4000
tail -n +2 small.off >headless
expect 3 "$WHITTLE" check --no-progress headless
grep -q -e --from err || fail "--from is not recommended: $(cat err)"
expect 0 "$WHITTLE" check --no-progress --from off headless
expect 3 "$WHITTLE" check --no-progress --from stl small.obj
expect 2 "$WHITTLE" check --from glb small.glb
expect 2 "$WHITTLE" reduce in.ply -o x --to step --faces 10
expect 2 "$WHITTLE" reduce in.ply -o x --to obj.zip --faces 10
[ ! -e x ] || fail "wrong usage left an output"

# names whose ending is no format are refused, of pictures and records, too; without one it is PLY
for name in x.fbx x.ply.zip x.gif.gz 'x%f.mp4' /tmp/tmp.qXyZ; do
	expect 2 "$WHITTLE" reduce in.ply -o "$name" --faces 10
	grep -q "'$name'.*\.ply, \.obj.*--to FORMAT" err || fail "$name: $(cat err)"
done
expect 2 "$WHITTLE" render in.ply -o x.jpg
grep -q "'x.jpg': only .png" err || fail "a picture of another kind: $(cat err)"
expect 2 "$WHITTLE" generate -o x.obj --faces 100
expect 2 "$WHITTLE" progressive in.ply -o x.ply
expect 2 "$WHITTLE" reduce in.ply -o ok.ply --faces 10 --seams x.csv
expect 0 "$WHITTLE" progressive -q in.ply -o in.pmesh
expect 2 "$WHITTLE" replay in.pmesh -o x.step --faces 1000
ls x* ok.ply 2>/dev/null && fail "an output of no known kind"
for name in bare lod-0.5 .hidden dir.d/bare bare.gz; do
	mkdir -p dir.d
	expect 0 "$WHITTLE" reduce -q in.ply -o $name --faces 4000
done
cmp -s bare small.ply && cmp -s lod-0.5 bare && cmp -s .hidden bare && cmp -s dir.d/bare bare ||
	fail "a name without an ending is not PLY"
expect 0 "$WHITTLE" reduce -q in.ply -o odd.fbx --to ply --faces 4000
cmp -s odd.fbx small.ply || fail "--to does not rule the name"

for p in "${packs[@]}"; do
	end=$(ending "$p")
	for f in in.ply small.obj small.off small.stl text.stl; do
		$p -c $f >packed.$end
		expect 0 "$WHITTLE" reduce -q -f packed.$end -o a.ply --faces 3000
		expect 0 "$WHITTLE" reduce -q -f $f -o b.ply --faces 3000
		cmp -s a.ply b.ply || fail "$f is another mesh when packed by $p"
		expect 0 "$WHITTLE" info packed.$end
		expect 0 "$WHITTLE" plan packed.$end --faces 10%
	done
	expect 0 "$WHITTLE" reduce -q in.ply -o small.ply.$end --faces 4000 --report report.$end
	$p -dc small.ply.$end | cmp -s - small.ply || fail "$p: another mesh comes out"
	grep -q "\"bytes\": $(stat -c %s small.ply.$end)," report.$end || fail "$p: wrong size reported"
	expect 0 "$WHITTLE" reduce -q in.ply -o copy.$end --faces 100%
	$p -dc copy.$end | cmp -s - in.ply || fail "$p: a copy is another file"

	# cut anywhere, damaged, or larger than the disk: words and nothing left
	size=$(stat -c %s packed.$end)
	for n in 5 20 1000 $((size - 1)); do
		head -c "$n" packed.$end >cut.$end
		expect 3 "$WHITTLE" check --no-progress cut.$end
	done
	grep -q 'cut short' err || fail "$p: not cut short: $(cat err)"
	{ head -c 2000 packed.$end && printf 'damage' && tail -c +2007 packed.$end; } >bad.$end
	expect 3 "$WHITTLE" check --no-progress bad.$end
	mkdir tmp
	head -c 20000000 /dev/zero | $p -c >bomb.$end
	(ulimit -f 4000 && "$WHITTLE" check --no-progress --temp-dir tmp bomb.$end) >out 2>err
	[ $? -eq 1 ] && grep -q 'no space left' err || fail "$p: a bomb: $(cat err)"
	[ -z "$(ls -A tmp)" ] || fail "$p: a bomb left something"
	rmdir tmp
done
[ ${#packs[@]} -gt 0 ] || echo "no packed files: whittle is built without them, or no gzip and zstd"
: >empty
cat /dev/null | gzip -c >empty.gz
expect 3 "$WHITTLE" check --no-progress empty
expect 3 "$WHITTLE" check --no-progress empty.gz

[ "$failures" -eq 0 ] || exit 1
echo "formats: ok"
