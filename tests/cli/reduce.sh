# whittle reduce: exit statuses and messages, outputs of every kind. How it ends when something
# goes wrong on the way is in stop.sh.
. "$(dirname "$0")/lib.sh"
mkdir temp
export TMPDIR=$dir/temp

# refuse STATUS WORDS ARGUMENTS...: reduce fails so, says so, and leaves nothing
refuse() {
	local want=$1 words=$2
	shift 2
	expect "$want" "$WHITTLE" reduce "$@"
	grep -q '^whittle reduce: ' err || fail "form of the message for $*: $(cat err)"
	grep -qi -- "$words" err || fail "no '$words' for $*: $(cat err)"
	[ ! -e never.ply ] || fail "an output appeared for $*"
	[ -z "$(ls -A temp)" ] || fail "temporary files after $*: $(ls -A temp)"
	rm -rf never.ply
}

# count FILE ELEMENT: how many of them the header promises
count() {
	grep -a "^element $2 " "$1" | head -1 | cut -d' ' -f3
}

reduce() {
	expect 0 "$WHITTLE" reduce --no-progress "$@"
	[ -z "$(ls -A temp)" ] || fail "temporary files after $*: $(ls -A temp)"
}

header() {
	printf 'ply\nformat ascii 1.0\nelement vertex %s\n' "$1"
	printf 'property float x\nproperty float y\nproperty float z\n'
	printf 'element face %s\nproperty list uchar int vertex_indices\nend_header\n' "$2"
}

"$WHITTLE" generate -q -o in.ply --faces 20K || exit 1

# ---- it works ----
reduce in.ply -o a.ply --faces 1K
grep -q '1000 faces' out || fail "the summary has no count: $(cat out)"
[ "$(count a.ply face)" -eq 1000 ] || fail "1000 faces"
reduce in.ply -o fast.ply --faces 1K --fast --report fast.json
[ "$(count fast.ply face)" -eq 1000 ] || fail "1000 faces, fast"
grep -q '"fast": true' fast.json || fail "the report does not say fast"
reduce -q in.ply -o b.ply --ratio 0.05 --threads 1
[ ! -s out ] && [ ! -s err ] || fail "-q printed something"
expect 0 "$WHITTLE" check --strict a.ply
cp in.ply 'a name with spaces.ply'
reduce 'a name with spaces.ply' -o 'another one.ply' --faces 1K
cmp -s a.ply 'another one.ply' || fail "a name changed the bytes"
reduce in.ply --output=c.ply --vertices 10%
[ "$(count c.ply vertex)" -eq $((($(count in.ply vertex) + 5) / 10)) ] || fail "10 % of the vertices"
reduce in.ply -f -o c.ply --faces 1001
[ "$(count c.ply face)" -eq 1000 ] || fail "an odd count of a closed surface"
grep -q '1000 faces instead of 1001' out || fail "the missing face is not explained: $(cat out)"
reduce in.ply -f -o c.ply --faces 1G
cmp -s in.ply c.ply || fail "a target above the count did not copy"

# ---- nothing to do, too many threads ----
reduce in.ply -o all.obj --faces 1G
grep -q 'nothing to reduce: the target is 1000000000 faces, the input has 19844' out || fail "not said: $(cat out)"
more=$(($(nproc --all) + 1))
reduce in.ply -f -o c.ply --faces 1K --threads $more
grep -q "warning: $more threads on [0-9]* processor" err || fail "too many threads without a word"
cmp -s a.ply c.ply || fail "their number changed the bytes"
SLURM_CPUS_PER_TASK=3 expect 0 "$WHITTLE" reduce in.ply -f -o c.ply --faces 1K --report c.json --no-progress
grep -q '"threads": 3' c.json && [ ! -s err ] || fail "not the threads of the job: $(grep threads c.json) $(cat err)"

# ---- other methods ----
for cost in memoryless qem qem-normals melax edge-length; do
	reduce -q in.ply -f -o c.ply --faces 1K --cost $cost --weight angle --placement endpoint --report c.json -f
	[ "$(count c.ply face)" -eq 1000 ] || fail "1000 faces with $cost"
	grep -q "\"cost\": \"$cost\"" c.json || fail "the report does not say $cost"
done
refuse 2 'no cost' in.ply -o never.ply --faces 1K --cost cheap
refuse 2 'no placement' in.ply -o never.ply --faces 1K --placement usual

# ---- several levels ----
reduce in.ply -o lod.ply --levels 1K,5K,200 --report lod.json
for n in 5000 1000 200; do
	[ "$(count lod-$n.ply face)" -eq $n ] || fail "a level of $n faces"
done
grep -q 'lod-5000.ply: 5000 faces' out || fail "the summary does not name the levels: $(cat out)"
grep -q '"path": "lod-1000.ply"' lod.json || fail "the report does not name the levels"
reduce in.ply -o 'l%f.obj.gz' --to obj --levels 10%,2.5%
[ -s l10pct.obj.gz ] && [ -s l2.5pct.obj.gz ] || fail "names with a pattern: $(ls)"
reduce in.ply -o e.ply --levels-error 0.1%,2%
[ "$(count e-0.1pct.ply face)" -gt "$(count e-2pct.ply face)" ] || fail "levels by errors"
refuse 2 'not a list' in.ply -o never.ply --levels 1K,,2K
refuse 2 'not a list' in.ply -o never.ply --levels 1K,10%
refuse 2 'not a list' in.ply -o never.ply --levels 1K,1000
refuse 2 'not a list' in.ply -o never.ply --levels ''
refuse 2 'instead of' in.ply -o never.ply --levels 1K,2K --faces 10
refuse 2 'standard output' in.ply -o - --levels 1K,2K
expect 2 "$WHITTLE" reduce in.ply -o lod.ply --levels 7K,1K
[ ! -e lod-7000.ply ] || fail "a level was written before another one was refused"

# ---- wrong usage: 2 ----
refuse 2 'option' in.ply -o never.ply --faces 1K --nonsense
refuse 2 'target' in.ply -o never.ply
refuse 2 'output' in.ply --faces 1K
refuse 2 'input' -o never.ply --faces 1K
refuse 2 'input' in.ply a.ply -o never.ply --faces 1K
refuse 2 'value' in.ply -o never.ply --faces
for bad in "--faces 0" "--faces -5" "--faces 1.5" "--faces ten" "--faces 101%" "--ratio 0" \
	"--ratio 1.5" "--ratio x" "--vertices 0%" "--error 0" "--error -1" "--error nan" \
	"--faces 1K --memory much" "--faces 1K --memory 0" "--faces 1K --threads -1" \
	"--faces 1K --threads 99999" "--faces 1K --cluster-faces 10" "--faces 99999999999999999999"; do
	# shellcheck disable=SC2086
	refuse 2 "--" in.ply -o never.ply $bad
done
cp a.ply before.ply
expect 2 "$WHITTLE" reduce in.ply -o a.ply --faces 500
grep -q -- '-f' err || fail "no word about -f"
cmp -s a.ply before.ply || fail "written over without -f"
expect 2 "$WHITTLE" reduce in.ply -o temp --faces 500
expect 2 "$WHITTLE" reduce in.ply -o a.ply --faces 500 --run-dir run --resume
grep -q "run has ended, and 'a.ply' is its output" err || fail "an end that is no news: $(cat err)"

# ---- bad input: 3 ----
refuse 3 'missing.ply' missing.ply -o never.ply --faces 10
refuse 3 'temp' temp -o never.ply --faces 10
head -c 100000 in.ply >cut.ply
refuse 3 'cut.ply' cut.ply -o never.ply --faces 10
{
	header 4000000000 3
	printf '0 0 0\n'
} >huge.ply
refuse 3 'huge.ply' huge.ply -o never.ply --faces 10
sed 's/ascii/binary_little_endian/' huge.ply >huge2.ply
refuse 3 'huge2.ply' huge2.ply -o never.ply --faces 10
# defect NAME WORDS VERTEX FACE: a square with one vertex and one face replaced
defect() {
	{
		header 4 2
		printf '0 0 0\n%s\n1 1 0\n0 1 0\n3 0 1 2\n%s\n' "$3" "$4"
	} >"$1.ply"
	refuse 3 "$2" "$1.ply" -o never.ply --faces 1
	grep -q "$1.ply" err || fail "$1.ply is not named: $(cat err)"
}
defect range 'range\|4' '1 0 0' '3 0 2 4'
defect negative 'range\|-1' '1 0 0' '3 0 2 -1'
defect nan 'finite' 'nan 0 0' '3 0 2 3'
defect inf 'finite' '1 inf 0' '3 0 2 3'
defect word '.' '1 zero 0' '3 0 2 3'
{
	header 3 0
	printf '0 0 0\n1 0 0\n0 1 0\n'
} >none.ply
refuse 3 'nothing\|no faces' none.ply -o never.ply --faces 1
printf 'solid nothing\n' >other.ply
refuse 3 'other.ply' other.ply -o never.ply --faces 1
: >empty.ply
refuse 3 'empty.ply' empty.ply -o never.ply --faces 1
if [ "$(id -u)" -ne 0 ]; then
	cp in.ply secret.ply
	chmod 0 secret.ply
	refuse 3 'secret.ply' secret.ply -o never.ply --faces 10
else
	echo "skipped as root: an unreadable file, an unwritable folder"
fi

# ---- targets out of reach: 4, and the best mesh all the same ----
expect 4 "$WHITTLE" reduce -q in.ply -o best.ply --faces 1
[ -s best.ply ] || fail "no best mesh"
grep -q 'best.ply' err || fail "no word about the best mesh: $(cat err)"
expect 0 "$WHITTLE" check --strict best.ply

# ---- ceilings: 5, with one that works ----
"$WHITTLE" generate -q -o more.ply --faces 300K
refuse 5 'memory' more.ply -o never.ply --faces 1K --memory 14M
named=$(sed -n 's/.*--memory \([0-9]*[KMG]\).*/\1/p' err)
reduce more.ply -o more1.ply --faces 1K --memory "${named:-1M}"
reduce more.ply -o more2.ply --faces 1K --memory 1G --threads 1
cmp -s more1.ply more2.ply || fail "memory or threads changed the bytes"

# ---- outputs that are no plain files ----
if [ -c /dev/full ]; then
	expect 1 "$WHITTLE" reduce in.ply -o /dev/full --faces 1K --temp-dir temp
	grep -q '/dev/full' err || fail "/dev/full is not named: $(cat err)"
	[ -c /dev/full ] || fail "/dev/full is gone"
fi
reduce in.ply -o /dev/null --faces 1K
[ -c /dev/null ] || fail "/dev/null is gone"
"$WHITTLE" reduce in.ply -o - --faces 1K >pipe.ply 2>err || fail "to standard output: $(cat err)"
cmp -s a.ply pipe.ply || fail "standard output holds other bytes"
mkdir links
ln -s ../target.ply links/link.ply
reduce in.ply -o links/link.ply --faces 1K
[ -L links/link.ply ] && cmp -s a.ply target.ply || fail "a link to nothing"
reduce in.ply -f -o links/link.ply --faces 500
[ -L links/link.ply ] || fail "the link is gone"
[ "$(count target.ply face)" -eq 500 ] || fail "the link's target was not replaced"
cp in.ply same.ply
expect 2 "$WHITTLE" reduce same.ply -o same.ply --faces 1K
cmp -s in.ply same.ply || fail "the input changed"
reduce same.ply -f -o same.ply --faces 1K
cmp -s a.ply same.ply || fail "IN as OUT"
refuse 1 'missing' in.ply -o missing/out.ply --faces 1K --temp-dir temp
refuse 1 'missing' in.ply -o never.ply --faces 1K --temp-dir missing
if [ "$(id -u)" -ne 0 ]; then
	mkdir -m 500 closed
	refuse 1 'closed' in.ply -o closed/out.ply --faces 1K
	refuse 1 'closed' in.ply -o never.ply --faces 1K --temp-dir closed
fi

# ---- the report ----
reduce in.ply -f -o c.ply --faces 1K --report report.json
for key in version parameters input output target error clusters rounds threads ranks \
	peak_rss_bytes temp_bytes_peak bytes_read bytes_written seconds faces_per_second path bytes \
	vertices faces boundary_edges nonmanifold_edges components checksum_xxh3_128; do
	grep -q "\"$key\":" report.json || fail "no $key in the report"
done
if python3 -c 'import json' 2>/dev/null; then
	python3 - <<-'EOF' || fail "the report's figures"
		import json
		r = json.load(open("report.json"))
		assert r["output"]["faces"] == 1000 and r["output"]["components"] == 1
		assert r["output"]["boundary_edges"] == 0 and r["output"]["nonmanifold_edges"] == 0
		assert r["output"]["bytes"] == len(open("c.ply", "rb").read())
		assert r["input"]["bytes"] == len(open("in.ply", "rb").read())
		assert r["target"]["faces"] == 1000 and r["ranks"] == 1
		assert len(r["output"]["checksum_xxh3_128"]) == 32
		assert 0 < r["seconds"]["total"] < 60 and r["peak_rss_bytes"] > 1 << 20
	EOF
fi
if command -v xxh128sum >/dev/null; then
	sum=$(xxh128sum c.ply | cut -d' ' -f1)
	grep -q "$sum" report.json || fail "the checksum is not that of the bytes"
fi
# one file, however it is spelled: nothing is begun
mkdir -p other && ln -sf ../never.ply other/link.ply
for same in ./never.ply "$PWD/never.ply" other/../never.ply other/link.ply; do
	expect 2 "$WHITTLE" reduce in.ply -f -o never.ply --faces 1K --report "$same"
	expect 2 "$WHITTLE" reduce in.ply -f -o never.ply --faces 1K --seams "$same"
	[ ! -e never.ply ] || fail "a file that is two outputs was written: $same"
done
expect 2 "$WHITTLE" reduce in.ply -f -o never.ply --faces 1K --report r.json --seams ./r.json
expect 2 "$WHITTLE" reduce in.ply -f -o never.ply --levels 900,500 --report ./never-500.ply
rm -r other
# what comes through a pipe is no report, and is not waited for
mkfifo pipe
expect 3 timeout 20 "$WHITTLE" report in.ply in.ply --json pipe -o never.html -q
rm pipe
expect 1 "$WHITTLE" reduce in.ply -o never.ply --faces 1K --report missing/report.json
grep -q 'missing' err || fail "the report's folder is not named: $(cat err)"
[ ! -e never.ply ] || fail "all the work for a report that cannot be written"

[ $failures -eq 0 ] || exit 1
echo "reduce: ok"
