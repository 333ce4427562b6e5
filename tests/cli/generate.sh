# whittle generate and whittle info: counts, determinism, refusals.
. "$(dirname "$0")/lib.sh"

same() {
	cmp -s "$1" "$2" || fail "$1 and $2 differ"
}

# counts are printed, and are those of the file
for shape in sphere torus terrain; do
	expect 0 "$WHITTLE" generate -o $shape.ply --faces 20K --shape $shape
	faces=$(sed -n 's/.* \([0-9]*\) faces.*/\1/p' out)
	vertices=$(sed -n 's/.*: \([0-9]*\) vertices.*/\1/p' out)
	[ "${faces:-0}" -gt 19800 ] && [ "$faces" -lt 20200 ] || fail "$shape: '$faces' faces"
	grep -aqx "element vertex $vertices" $shape.ply || fail "$shape: vertices in the header"
	grep -aqx "element face $faces" $shape.ply || fail "$shape: faces in the header"
	expect 0 "$WHITTLE" info $shape.ply
	grep -qx "element vertex: $vertices of 12 bytes" out || fail "info: vertices of $shape"
	grep -qx "element face: $faces" out || fail "info: faces of $shape"
	grep -q '^diagonal: ' out || fail "info: bounds of $shape"
	header=$(grep -abo '^end_header$' $shape.ply | head -1 | cut -d: -f1)
	[ "$(stat -c %s $shape.ply)" -eq $((header + 11 + 12 * vertices + 13 * faces)) ] ||
		fail "$shape: size of the file"
done

# the same bytes for any number of threads, and for any target
for options in "--shape sphere" "--shape torus --order shuffled --normals" \
	"--shape terrain --order shuffled --colors --offset 4512345.5,-5.4e6,1000" \
	"--shape terrain --holes 3 --ascii --flat 0.3" "--order shuffled --ascii --normals --colors"; do
	# shellcheck disable=SC2086
	for threads in 1 2 5; do
		expect 0 "$WHITTLE" generate -q -f -o t$threads.ply --faces 100K --seed 7 $options \
			--threads $threads
		[ ! -s out ] || fail "-q printed something"
	done
	same t1.ply t2.ply
	same t1.ply t5.ply
	# shellcheck disable=SC2086
	"$WHITTLE" generate -q -o - -n 100K --seed 7 $options >pipe.ply || fail "to standard output"
	same t1.ply pipe.ply
done
expect 0 "$WHITTLE" generate -q -f -o t2.ply --faces 100K --seed 8 --ascii --order shuffled \
	--normals --colors
cmp -s t1.ply t2.ply && fail "two seeds, one surface"

# these bytes are for ever: any compiler and machine has to make them
digest() {
	"$WHITTLE" generate -q -o - --faces 5K --seed 1 "$@" | sha256sum | cut -c1-16
}
[ "$(digest)" = 024f754fa0248410 ] || fail "sphere: $(digest)"
[ "$(digest --shape torus --flat 0.2 --normals)" = a0c3fcb24762cbe2 ] || fail "torus"
[ "$(digest --shape terrain --colors --order shuffled)" = b8dd97557692fe75 ] || fail "terrain"

# text and binary hold the same bounds, to the last bit
expect 0 "$WHITTLE" generate -q -o text.ply --faces 5K --seed 2 --ascii
expect 0 "$WHITTLE" generate -q -o binary.ply --faces 5K --seed 2
"$WHITTLE" info --bounds --json text.ply | sed -n '/"bounds"/,$p' >text.json
"$WHITTLE" info --json binary.ply | sed -n '/"bounds"/,$p' >binary.json
[ -s text.json ] && same text.json binary.json
expect 0 "$WHITTLE" info --json text.ply
grep -q '"bounds": null' out || fail "bounds of a text file without being asked"
expect 0 "$WHITTLE" info --no-bounds binary.ply
grep -q diagonal out && fail "bounds against the user's wish"

# nothing is written over without -f
cp binary.ply before.ply
expect 2 "$WHITTLE" generate -o binary.ply --faces 1K
grep -q '^whittle generate: ' err || fail "form of the message: $(cat err)"
same binary.ply before.ply
expect 0 "$WHITTLE" generate -f -o binary.ply --faces 1K
cmp -s binary.ply before.ply && fail "-f did not write"

# wrong usage
expect 2 "$WHITTLE"
expect 2 "$WHITTLE" nonsense
expect 2 "$WHITTLE" generate
expect 2 "$WHITTLE" generate -o x.ply
expect 2 "$WHITTLE" generate --faces 1K
expect 2 "$WHITTLE" generate -o x.ply --faces
expect 2 "$WHITTLE" generate -o x.ply --faces 1K extra
expect 2 "$WHITTLE" generate -o x.ply --faces 1K --nonsense
for bad in "--faces 0" "--faces 5" "--faces -3" "--faces 1.5" "--faces 1e6" "--faces 100G" \
	"--faces 1K --shape cube" "--faces 1K --order none" "--faces 1K --holes 3" \
	"--faces 1K --shape terrain --holes 1K" "--faces 1K --offset 1,2" \
	"--faces 1K --offset 1,2,3,4" "--faces 1K --offset a,b,c" "--faces 1K --noise 2" \
	"--faces 1K --relief nan" "--faces 1K --flat 0.9" "--faces 1K --seed x" \
	"--faces 1K --threads 99999"; do
	# shellcheck disable=SC2086
	expect 2 "$WHITTLE" generate -o x.ply $bad
	[ -s err ] || fail "no message for $bad"
done
[ ! -e x.ply ] || fail "wrong usage left a file"
expect 2 "$WHITTLE" info
expect 2 "$WHITTLE" info a b
expect 2 "$WHITTLE" info --bounds --no-bounds binary.ply

# bad input, failing output, interruption
expect 3 "$WHITTLE" info missing.ply
head -c 1000 before.ply >short.ply
expect 3 "$WHITTLE" info short.ply
if [ -c /dev/full ]; then
	expect 1 "$WHITTLE" generate -o /dev/full --faces 100K
	"$WHITTLE" --help >/dev/full 2>/dev/null && fail "help to a full device"
fi
mkdir stop
"$WHITTLE" generate -q -o stop/big.ply --faces 400M 2>/dev/null &
sleep 0.5
kill -TERM $!
wait $!
got=$?
[ $got -eq 143 ] || fail "status $got after SIGTERM"
[ -z "$(ls -A stop)" ] || fail "left after SIGTERM: $(ls -A stop)"

# help fits a screen
for words in --help "generate --help" "info --help"; do
	# shellcheck disable=SC2086
	expect 0 "$WHITTLE" $words
	[ "$(wc -l <out)" -le 25 ] && [ "$(wc -L <out)" -le 80 ] || fail "$words is too large"
done
expect 0 "$WHITTLE" --version
grep -q '^whittle [0-9]' out || fail "version"

[ $failures -eq 0 ]
