# Vertex properties at the command: what is carried, what is said of it, weights, and colours in
# whittle compare.
. "$(dirname "$0")/lib.sh"
mkdir temp
export TMPDIR=$dir/temp

header() {
	head -c 2000 "$1" | sed '/^end_header/q' | grep -a '^property [^l]' | tr '\n' ';'
}

# number FILE KEY: the first such member of a JSON file
number() {
	sed -n "s/^ *\"$2\": *\([0-9.e-]*\),*$/\1/p" "$1" | head -1
}

"$WHITTLE" generate -q -o in.ply --faces 100K --colors --normals || exit 1

# ---- what is carried ----
expect 0 "$WHITTLE" reduce --no-progress in.ply -o a.ply --faces 5K --report a.json
[ "$(header a.ply)" = "$(header in.ply)" ] || fail "other properties: $(header a.ply)"
grep -q '^carried over: red, green, blue (colour), nx, ny, nz (normal)$' out ||
	fail "the summary: $(cat out)"
grep -q '"carried_over": "red, green, blue (colour)' a.json || fail "the report"
expect 0 "$WHITTLE" reduce --no-progress in.ply -o none.ply --faces 5K --attributes none
[ "$(header none.ply)" = "property float x;property float y;property float z;" ] || fail "none"
grep -q '^not carried over: .*red' out || fail "what was left out: $(cat out)"
expect 0 "$WHITTLE" reduce -q in.ply -o colour.ply --faces 5K --attributes colour
case $(header colour.ply) in
*n[xyz]*) fail "colours alone: $(header colour.ply)" ;;
*"uchar red;property uchar green;property uchar blue"*) ;;
*) fail "colours alone: $(header colour.ply)" ;;
esac
expect 2 "$WHITTLE" reduce -q in.ply -o never.ply --faces 5K --attributes red,purple
grep -q "in.ply.*'purple'" err || fail "an unknown name: $(cat err)"
[ ! -e never.ply ] || fail "an output all the same"

# the target is no smaller than the input, but text was asked for: values as they were
expect 0 "$WHITTLE" reduce -q in.ply -o text.ply --faces 1G --ascii
expect 0 "$WHITTLE" compare --samples 10K --json in.ply text.ply
cp out text.json
awk -v rms="$(number text.json colour_rms)" 'BEGIN { exit !(rms != "" && rms < 1e-6) }' ||
	fail "text changed colours: $(number text.json colour_rms)"

# ---- weights ----
expect 0 "$WHITTLE" reduce -q in.ply -o w.ply --faces 5K --weight-of colour=1 --weight-of nx=0.1 \
	--report w.json
grep -q '"weights": "colour=1,nx=0.1"' w.json || fail "weights in the report"
cmp -s a.ply w.ply && fail "weights changed nothing"
for bad in colour colour= =1 colour=-1 colour=x quality=1; do
	expect 2 "$WHITTLE" reduce -q in.ply -o never.ply --faces 5K --weight-of $bad
	expect 2 "$WHITTLE" plan in.ply --faces 5K --weight-of $bad
done

# ---- ceilings count what is carried ----
expect 0 "$WHITTLE" plan --json in.ply --faces 60% --cluster-faces 20k --attributes none
bare=$(number out memory_least) disk=$(number out temp_bytes_peak)
expect 0 "$WHITTLE" plan --json in.ply --faces 60% --cluster-faces 20k
[ "$(number out memory_least)" -ge "$bare" ] || fail "properties need no memory"
[ "$(number out temp_bytes_peak)" -gt "$disk" ] || fail "properties need no disk"
least=$(number out memory_least)
expect 0 "$WHITTLE" reduce -q in.ply -o least.ply --faces 60% --cluster-faces 20k \
	--memory "$least" --threads 1
expect 0 "$WHITTLE" reduce -q in.ply -o most.ply --faces 60% --cluster-faces 20k --memory 1G
cmp -s least.ply most.ply || fail "memory or threads changed the bytes"
[ -z "$(ls -A temp)" ] || fail "temporary files: $(ls -A temp)"

# ---- compare ----
expect 0 "$WHITTLE" compare --samples 50K in.ply a.ply
grep -q '^difference of colours' out || fail "no colours in the table"
expect 0 "$WHITTLE" compare --samples 50K --json in.ply a.ply
cp out with.json
expect 0 "$WHITTLE" compare --samples 50K --json in.ply none.ply
grep -q colour out && fail "colours of a mesh without any"
expect 0 "$WHITTLE" compare --samples 50K --json a.ply in.ply --threads 1
cp out back.json
if python3 -c 'import json' 2>/dev/null; then
	python3 - <<-'EOP' || fail "the figures"
		import json
		a, b = json.load(open("with.json")), json.load(open("back.json"))
		assert 0 < a["both"]["colour"]["mean"] < a["colour_rms"] < 30, a["colour_rms"]
		assert a["a_to_b"]["colour"]["samples"] == 50000
		assert abs(a["colour_rms"] - b["colour_rms"]) < 0.1 * a["colour_rms"]
		assert a["colour_rms"] == max(a["a_to_b"]["colour"]["rms"], a["b_to_a"]["colour"]["rms"])
	EOP
fi

[ $failures -eq 0 ] || exit 1
echo "attributes: ok"
