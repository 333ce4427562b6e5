# The page of whittle report in a browser: its view is alive, it loads nothing, the console is empty.
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
[ "$failures" -eq 0 ] || exit 1
echo "report_view: ok"
