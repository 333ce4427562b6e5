# whittle render: sizes, views, determinism, contact sheets, distances, refusals.
. "$(dirname "$0")/lib.sh"

# number FILE OFFSET BYTES: a big-endian number of a file
number() {
	od -An -tu1 -j "$2" -N "$3" "$1" | tr -s ' ' '\n' | awk 'NF { n = n * 256 + $1 } END { print n }'
}

# picture FILE W H KIND: is a PNG of this size, RGB (2) or with alpha (6)
picture() {
	[ "$(head -c 8 "$1" | od -An -tx1 | tr -d ' \n')" = 89504e470d0a1a0a ] || fail "$1 is no PNG"
	[ "$(number "$1" 16 4) $(number "$1" 20 4) $(number "$1" 25 1)" = "$2 $3 $4" ] ||
		fail "$1: $(number "$1" 16 4) x $(number "$1" 20 4), kind $(number "$1" 25 1)"
}

"$WHITTLE" generate -q -o a.ply --faces 40K --colors --order shuffled || fail "generate"
"$WHITTLE" generate -q -o b.ply --faces 10K --seed 5 || fail "generate"
"$WHITTLE" generate -q -o t.ply --faces 20K --shape terrain --ascii || fail "generate"

render() {
	"$WHITTLE" render -q -f --size 200x150 "$@"
}

render a.ply -o a.png 2>err
status=$?
if [ $status -eq 2 ] && grep -q 'without libpng' err; then
	[ ! -e a.png ] || fail "a picture without libpng"
	echo "skipped: built without libpng"
	[ "$failures" -eq 0 ] || exit 1
	exit 77
fi
[ $status -eq 0 ] || fail "render: $(cat err)"
picture a.png 200 150 2

# the same bytes for any number of threads and any ceiling; nothing temporary is left
mkdir temp
for options in "" "--flat --wireframe" "--perspective --colours --view iso"; do
	# shellcheck disable=SC2086
	expect 0 "$WHITTLE" render -q -f a.ply -o one.png --size 500x400 $options --threads 1
	# shellcheck disable=SC2086
	expect 0 "$WHITTLE" render -q -f a.ply -o two.png --size 500x400 $options --threads 2 \
		--memory 23M --temp-dir temp
	cmp -s one.png two.png || fail "threads or the ceiling changed the picture ($options)"
	rmdir temp && mkdir temp || fail "left behind: $(ls temp)"
	[ ! -s out ] || fail "-q printed something"
done
expect 5 "$WHITTLE" render a.ply -o no.png --memory 14M
grep -q 'use --memory' err || fail "no size that would do is named"

# another view, another picture
for options in "--view top" "--view left" "--up x" "--zoom 2" "--azimuth 10" "--elevation 40" \
	"--perspective" "--flat" "--samples 2" "--background black" "--colors"; do
	# shellcheck disable=SC2086
	expect 0 render a.ply -o two.png $options
	cmp -s a.png two.png && fail "$options changed nothing"
done
expect 0 "$WHITTLE" render -q t.ply -o t.png --background transparent --size 90
picture t.png 90 90 6

# side by side
expect 0 "$WHITTLE" render a.ply b.ply --contact-sheet --samples 1 -o sheet.png
[ "$(number sheet.png 16 4)" -eq 1280 ] && [ "$(number sheet.png 20 4)" -gt 480 ] || fail "sheet"
expect 0 "$WHITTLE" render a.ply --contact-sheet --size 160x120 -o six.png
[ "$(number six.png 16 4)" -eq 480 ] && [ "$(number six.png 20 4)" -gt 240 ] || fail "six views"
expect 0 "$WHITTLE" render a.ply --contact-sheet --view front,top --size 99x77 -o views.png
[ "$(number views.png 16 4)" -eq 198 ] || fail "two views"

# distances
expect 0 "$WHITTLE" render a.ply --size 300x200 --distance-to b.ply -o distance.png
picture distance.png 300 200 2
grep -q '^last colour at a distance of ' out || fail "no range: $(cat out)"
expect 0 "$WHITTLE" render a.ply --size 300 --distance-to b.ply --range 7 -f -o distance.png
grep -q '^last colour at a distance of 7,' out || fail "not the range asked for: $(cat out)"
expect 3 "$WHITTLE" render a.ply --distance-to missing.ply -o no.png
grep -q missing.ply err || fail "a missing file is not named"

# refusals
expect 2 "$WHITTLE" render a.ply -o a.png
picture a.png 200 150 2
expect 2 "$WHITTLE" render
expect 2 "$WHITTLE" render a.ply
expect 2 "$WHITTLE" render -o no.png
expect 2 "$WHITTLE" render a.ply b.ply -o no.png
for bad in "--size 0x5" "--size 5x" "--size 99999" "--size axb" "--view side" "--view front,top" \
	"--view front,nowhere --contact-sheet" "--up w" "--zoom 0" "--zoom -1" "--samples 9" \
	"--background pink" "--background 12345" "--azimuth north" "--range 1" "--memory 0" \
	"--distance-to b.ply --range 0" "--distance-to b.ply --colours" "--threads 9999" "--nonsense"; do
	# shellcheck disable=SC2086
	expect 2 "$WHITTLE" render a.ply -o no.png $bad
	[ -s err ] || fail "no message for $bad"
done
expect 3 "$WHITTLE" render b.ply -o no.png --colours
grep -q red err || fail "what is missing is not named: $(cat err)"
expect 3 "$WHITTLE" render missing.ply -o no.png
head -c 10000 a.ply >cut.ply
expect 3 "$WHITTLE" render cut.ply -o no.png
expect 1 "$WHITTLE" render a.ply -o nowhere/no.png
[ ! -e no.png ] || fail "a picture in spite of a failure"
[ -z "$(find . -name '.*whittle*')" ] || fail "left behind: $(ls -A)"
if [ -e /dev/full ]; then
	expect 1 "$WHITTLE" render a.ply --size 300 -o /dev/full
	grep -q '/dev/full' err || fail "a full disk is not named: $(cat err)"
fi
render a.ply -o - >pipe.png || fail "to standard output"
cmp -s a.png pipe.png || fail "standard output has another picture"
expect 0 "$WHITTLE" render --help
[ "$(wc -l <out)" -lt 40 ] || fail "the help does not fit a screen"

[ "$failures" -eq 0 ] || exit 1
echo "render: ok"
