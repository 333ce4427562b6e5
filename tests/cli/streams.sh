# Input through pipes: the same bytes come out as from the file, and nothing stays in the temp folder.
. "$(dirname "$0")/lib.sh"
use_temp
shopt -s lastpipe # failures behind a pipe count

# feed FILE PIPE: writes to a named pipe, once somebody reads it
feed() { timeout 60 dd status=none if="$1" of="$2" & }

"$WHITTLE" generate -q -o in.ply --faces 20K --colours || fail "generate"
expect 0 "$WHITTLE" reduce -q in.ply -o small.ply --faces 3000
for format in obj off stl; do
	expect 0 "$WHITTLE" reduce -q in.ply -o in.$format --faces 8000
	expect 0 "$WHITTLE" reduce -q in.$format -o small-$format.ply --faces 1000
done

# any format, from standard input and from a pipe with a name
mkfifo pipe
for file in in.ply in.obj in.off in.stl; do
	format=${file#in.} want=small-${file#in.}.ply faces=1000
	[ $format = ply ] && want=small.ply faces=3000
	cat $file | expect 0 "$WHITTLE" reduce -q - -o out.ply -f --faces $faces --report report
	cmp -s out.ply $want || fail "$file through a pipe is another mesh"
	grep -q "\"bytes\": $(stat -c %s $file)," report || fail "$file: its bytes are not in the report"
	cat $file | expect 0 "$WHITTLE" reduce -q - -o out.ply -f --from $format --faces $faces
	cmp -s out.ply $want || fail "$file through a pipe is another mesh when its format is told"
	feed $file pipe
	expect 0 "$WHITTLE" reduce -q pipe -o out.ply -f --faces $faces
	cmp -s out.ply $want || fail "$file through a named pipe is another mesh"
	expect 0 "$WHITTLE" reduce -q - -o out.ply -f --faces $faces <$file
	cmp -s out.ply $want || fail "$file by redirection is another mesh"
done
{ head -c 100 >/dev/null && expect 3 "$WHITTLE" check --no-progress - && grep -q "no PLY" err; } <in.ply ||
	fail "the file was read from its beginning, which somebody else had read: $(cat err)"

# slowly, in pieces smaller than a word; the temporary disk is as foretold
tell_disk() { grep -o '"temp_bytes_peak": [0-9]*' "$1" | grep -o '[0-9]*'; }
{ head -c 3 in.obj; sleep 0.3; tail -c +4 in.obj; } |
	expect 0 "$WHITTLE" reduce -q - -o out.ply -f --faces 1000 --report report
cmp -s out.ply small-obj.ply || fail "a slow pipe is another mesh"
cat in.ply | expect 0 "$WHITTLE" plan --json - --faces 3000 && planned=$(tell_disk out)
cat in.ply | expect 0 "$WHITTLE" reduce -q - -o out.ply -f --faces 3000 --report report
used=$(tell_disk report)
[ "$used" -ge "$(stat -c %s in.ply)" ] && [ $((planned * 10)) -ge $((used * 9)) ] ||
	fail "temporary disk: $planned bytes foretold, $used used"

# faces that are no triangles, behind thousands that are: found out when all was read
if command -v python3 >/dev/null; then
	python3 - <<'END' || fail "no mesh of many triangles and a square"
import struct
n = 100
head = ("ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty float x\nproperty float y\n"
        "property float z\nelement face %d\nproperty list uchar int vertex_indices\nend_header\n")
v = [struct.pack("<3f", i % n, i // n, (i * 7919 % 13) / 100) for i in range(n * n)]
f, at = [], lambda x, y: y * n + x
for y in range(n - 1):
    for x in range(n - 1):
        a, b, c, d = at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)
        f += [struct.pack("<B3i", 3, a, b, c), struct.pack("<B3i", 3, a, c, d)]
f[-2:] = [struct.pack("<B4i", 4, a, b, c, d)]
open("squares.ply", "wb").write((head % (len(v), len(f))).encode() + b"".join(v + f))
END
	expect 0 "$WHITTLE" reduce -q squares.ply -o small-squares.ply --faces 500
	cat squares.ply | expect 0 "$WHITTLE" reduce -q - -o out.ply -f --faces 500
	cmp -s out.ply small-squares.ply || fail "squares through a pipe are another mesh"
	expect 0 "$WHITTLE" check --no-progress squares.ply && mv out table
	cat squares.ply | expect 0 "$WHITTLE" check --no-progress -
	cmp -s out table || fail "check of squares through a pipe"
	cat squares.ply | expect 0 "$WHITTLE" compare --no-progress --samples 1000 - squares.ply
	grep -q '^.*max' out || fail "no distance of squares through a pipe"
	if "$WHITTLE" render -q squares.ply -o file.png --size 90x60; then
		cat squares.ply | expect 0 "$WHITTLE" render -q - -o pipe.png --size 90x60
		cmp -s file.png pipe.png || fail "another picture of squares through a pipe"
		expect 0 "$WHITTLE" render -q in.ply -o file.png -f --distance-to squares.ply --size 90x60
		mkdir pipes && mkfifo pipes/squares.ply # the legend has the name
		feed squares.ply pipes/squares.ply
		expect 0 "$WHITTLE" render -q in.ply -o pipe.png -f --distance-to pipes/squares.ply --size 90x60
		cmp -s file.png pipe.png || fail "another picture of the distance to a pipe"
	fi
else
	echo "no python3: squares are left out"
fi

# packed
for p in gzip zstd; do
	command -v $p >/dev/null && $p -c in.obj >in.obj.$p &&
		"$WHITTLE" check --no-progress in.obj.$p >/dev/null 2>&1 || continue
	$p -c in.ply | expect 0 "$WHITTLE" reduce -q - -o out.ply -f --faces 3000 --report report
	cmp -s out.ply small.ply || fail "a PLY packed by $p, through a pipe, is another mesh"
	grep -q "\"bytes\": $($p -c in.ply | wc -c)," report || fail "$p: its bytes are not in the report"
	cat in.obj.$p | expect 0 "$WHITTLE" reduce -q - -o out.ply -f --from obj --faces 1000
	cmp -s out.ply small-obj.ply || fail "an OBJ packed by $p, through a pipe, is another mesh"
	$p -c in.ply | expect 0 "$WHITTLE" plan --json - --faces 3000
	grep -q '"input_faces": 19844' out || fail "$p: plan through a pipe: $(cat out)"
	$p -c in.ply | expect 0 "$WHITTLE" info - && grep -q 'standard input' out || fail "$p: info"
	head -c 3000 in.obj.$p | expect 3 "$WHITTLE" check --no-progress -
	grep -q "standard input.*cut short" err || fail "$p: not cut short: $(cat err)"
done

# info
for f in in.obj in.ply; do
	expect 0 "$WHITTLE" info --bounds $f && grep '^[xyzd]' out >bounds
	cat $f | expect 0 "$WHITTLE" info --bounds - && grep '^[xyzd]' out | cmp -s - bounds ||
		fail "info of $f through a pipe"
done
expect 0 "$WHITTLE" reduce -q in.ply -o text.ply --ascii --faces 2000
expect 0 "$WHITTLE" info --bounds text.ply && grep '^[xyzd]' out >bounds
cat text.ply | expect 0 "$WHITTLE" info --bounds - && grep '^[xyzd]' out | cmp -s - bounds ||
	fail "info of text through a pipe"

# a copy, and through both ends
cat in.ply | expect 0 "$WHITTLE" reduce -q - -o - --faces 100%
cmp -s out in.ply || fail "a copy from pipe to pipe is another file"
cat in.ply | expect 0 "$WHITTLE" reduce -q - -o - --faces 3000
cmp -s out small.ply || fail "a reduction from pipe to pipe is another file"

# what cannot be: words, and status
expect 3 "$WHITTLE" reduce -q - -o out.ply -f --faces 10 </dev/null
grep -q 'standard input.*device' err || fail "a device: $(cat err)"
: | expect 3 "$WHITTLE" reduce -q - -o out.ply -f --faces 10
grep -q 'standard input.*empty' err || fail "nothing in the pipe: $(cat err)"
head -c 200000 in.ply | expect 3 "$WHITTLE" reduce -q - -o out.ply -f --faces 10
grep -q 'standard input.*cut short' err || fail "half of it in the pipe: $(cat err)"
cat in.ply | expect 2 "$WHITTLE" reduce -q - -o out.ply -f --faces 10 --run-dir run
cat in.ply | expect 2 "$WHITTLE" reduce -q - -o out.ply -f --faces 10 --measure
cat in.ply | expect 2 "$WHITTLE" report -q - small.ply -o page.html
cat in.ply | expect 2 "$WHITTLE" compare - -
[ ! -e run ] && [ ! -e page.html ] || fail "wrong usage left something"

# asked to stop while it waits for a pipe
for input in - pipe; do
	"$WHITTLE" reduce -q $input -o out.ply -f --faces 10 < <(sleep 5) 2>err &
	sleep 0.5
	kill -TERM $!
	wait $!
	[ $? -eq 143 ] || fail "waiting for $input did not stop: $(cat err)"
done
[ -z "$(ls -A temp)" ] || fail "left in the temporary folder: $(ls -A temp)"

[ "$failures" -eq 0 ] || exit 1
echo "streams: ok"
