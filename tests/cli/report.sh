# whittle report: the page is whole whatever it is made of, and the same for any number of threads.
page_py=$(realpath "$(dirname "$0")/../page.py")
. "$(dirname "$0")/lib.sh"

# page FILE LEVELS TITLE: is whole
page() {
	local words
	words=$(python3 "$page_py" "$@") || fail "$1: $words"
}

report() {
	"$WHITTLE" report --samples 5K --size 200x150 "$@"
}

# has TEXT, has_not TEXT: in p.html
has() {
	grep -qF -- "$1" p.html || fail "the page does not tell: $1"
}

has_not() {
	! grep -qF -- "$1" p.html || fail "the page tells: $1"
}

"$WHITTLE" generate -q -o a.ply --faces 10K --colors || fail "generate"
"$WHITTLE" reduce a.ply -o b.ply --faces 10% -q --cluster-faces 2K --report b.json \
	--seams seams.ply || fail "reduce"
"$WHITTLE" reduce a.ply -o c.ply --faces 200 -q --report c.json --memory 64M || fail "reduce"

mkdir temp
expect 0 report a.ply b.ply c.ply -o p.html --json c.json --json b.json \
	--seams seams.ply --threads 1 --temp-dir temp
page p.html 2 a.ply
grep -q '^p.html: 2 levels' out || fail "words: $(cat out)"
for text in 'id="distances"' 'id="seams"' 'id="runs"' '<h3>b.ply</h3>' '<td>200</td>' \
	'Colours, RMS' 'Holes closed'; do
	has "$text"
done
[ "$(grep -c '<dd class="sub name">b.ply' p.html)" -eq 2 ] || fail "figures at the head of two levels"
if grep -q 'without libpng' out; then
	has 'No pictures'
else
	[ "$(grep -o '<img' p.html | wc -l)" -eq 5 ] || fail "not 3 pictures and 2 maps"
fi
expect 0 report a.ply b.ply c.ply -o two.html --json c.json --json b.json \
	--seams seams.ply --threads 2 --temp-dir temp -q
cmp -s p.html two.html || fail "threads change the page"
[ ! -s out ] || fail "-q printed something"
rmdir temp || fail "left behind: $(ls temp)"

# a level that is too large is reduced for the page; a title and names that are no HTML
odd='<b>"&'\''{{css}}.ply'
cp b.ply "$odd"
cp a.ply $'not \xff UTF-8.ply'
sed 's|"path": "b.ply"|"path": "x</script><script>alert(1)"|; s|"version": "|&<!--|' b.json >odd.json
expect 0 report $'not \xff UTF-8.ply' "$odd" -o p.html -f --shown 500 --json odd.json \
	--title '<i>&amp;</script>'
page p.html 1 '<i>&amp;</script>'
has '"shown_faces":500,'
has '\u003c/script>'
has_not '<script>alert'
has_not '<i>'

# nothing but the input and the result
expect 0 report a.ply c.ply -o - >/dev/null
page out 1 a.ply
cp out p.html
has_not 'id="runs"'
has_not 'id="seams"'

# distances that a run has measured are not measured again, unless with other samples
"$WHITTLE" reduce a.ply -o d.ply --levels 2K,500 -q --cluster-faces 2K --measure --seams cuts.ply \
	--report d.json || fail "reduce"
python3 - <<'END'
import json
run = json.load(open("d.json"))
run["measured"]["rms"] = 8765
run["levels"][0]["measured"]["both"]["max"] = 9876
json.dump(run, open("told.json", "w"))
del run["levels"][0]["measured"]["both"]["histogram"]["end"][0]
json.dump(run, open("damaged.json", "w"))
END
expect 0 "$WHITTLE" report a.ply d-2000.ply d-500.ply -o p.html -f --json told.json -q --size 200x150
page p.html 2 a.ply
for text in "<td>8765</td>" "<td>9876</td>" 'id="seams"'; do
	has "$text"
done
expect 0 "$WHITTLE" report a.ply d-2000.ply d-500.ply -o p.html -f --json damaged.json -q --size 200x150
has "<td>8765</td>"
has_not "<td>9876</td>"
expect 0 report a.ply d-2000.ply d-500.ply -o p.html -f --json told.json -q
has_not "<td>8765</td>"

# reports of other programs and other times: what is there is shown, what is not is left out
echo '{"output": {}, "phases": {"ingest": {"seconds": "fast"}, "x<y": {"seconds": 1}, "z": 7},
	"seconds": [], "threads": -3, "parameters": {"faces": null, "topology": {}, "x": 1e400}}' >e.json
sed -i 's/1e400/1e300/' e.json
expect 0 report a.ply c.ply -o p.html -f --json e.json -q
page p.html 1 a.ply
has 'x&lt;y'

# refusals
cp p.html before.html
expect 2 report a.ply b.ply -o p.html
cmp -s p.html before.html || fail "a page is gone"
expect 2 "$WHITTLE" report
expect 2 report a.ply -o no.html
expect 2 report a.ply b.ply
for bad in "--shown 0" "--shown 9G" "--up w" "--azimuth east" "--size 0" "--memory 0" "--threads x" "--nonsense"; do
	# shellcheck disable=SC2086
	expect 2 report a.ply b.ply -o no.html $bad
	[ -s err ] || fail "no message for $bad"
done
expect 3 report a.ply b.ply -o no.html --json a.ply
grep -q 'a.ply' err || fail "not named: $(cat err)"
echo '[1]' >array.json
expect 3 report a.ply b.ply -o no.html --json array.json
expect 3 report missing.ply b.ply -o no.html
expect 3 report a.ply missing.ply -o no.html
expect 1 report a.ply b.ply -o no.html --json missing.json
head -c 10000 b.ply >cut.ply
expect 3 report a.ply cut.ply -o no.html
expect 5 report a.ply b.ply -o no.html --memory 13M
expect 1 report a.ply b.ply -o nowhere/no.html
[ ! -e no.html ] || fail "a page in spite of a failure"
[ -z "$(find . -name '.*whittle*')" ] || fail "left behind: $(ls -A)"
[ ! -e /dev/full ] || expect 1 report a.ply c.ply -o /dev/full -q
expect 0 report --help
[ "$(wc -l <out)" -lt 40 ] || fail "the help does not fit a screen"

[ "$failures" -eq 0 ] || exit 1
echo "report: ok"
