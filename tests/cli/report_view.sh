# The pages of whittle report and replay in a browser: their views are alive, they load nothing, the
# console is empty.
browser_py=$(realpath "$(dirname "$0")/../browser.py")
. "$(dirname "$0")/lib.sh"

if [ -n "${WHITTLE_SANITIZE:-}" ]; then
	echo "skipped: the page is the release build's"
	exit 77
fi
"$WHITTLE" generate -q -o a.ply --faces 10K || fail "generate"
"$WHITTLE" reduce a.ply -o b.ply --faces 10% -q || fail "reduce"
"$WHITTLE" reduce a.ply -o c.ply --faces 200 -q || fail "reduce"
"$WHITTLE" report a.ply b.ply c.ply -o p.html -q --samples 5K --size 200x150 || fail "report"
if grep -q 'built without three.js' p.html; then
	python3 "$browser_py" p.html 0
else
	python3 "$browser_py" p.html 2
fi
status=$?
[ "$status" -eq 77 ] && [ "$failures" -eq 0 ] && exit 77
[ "$status" -eq 0 ] || fail "in the browser"

expect 0 "$WHITTLE" progressive a.ply -o a.pmesh -q
if "$WHITTLE" replay a.pmesh --page play.html -q 2>err; then
	python3 "$browser_py" play.html --play || fail "the player in the browser"
	expect 0 "$WHITTLE" generate -q -o colours.ply --faces 10K --colours
	expect 0 "$WHITTLE" progressive colours.ply -o colours.pmesh -q
	expect 0 "$WHITTLE" replay colours.pmesh --page colours.html -q
	grep -q 'id="other-colour"' colours.html || fail "the page has no colours"
	python3 "$browser_py" colours.html --play || fail "the coloured player in the browser"
else
	grep -q 'built without three.js' err || fail "replay --page"
fi
[ "$failures" -eq 0 ] || exit 1
echo "report_view: ok"
