# clang-tidy finds nothing in src/ and tools/ (.clang-tidy says what it looks for and why not).
#
# usage: tests/tidy.sh BUILD-FOLDER      with a compile_commands.json
set -euo pipefail
build=$(realpath "$1")
cd "$(dirname "$0")/.."

if ! command -v clang-tidy >/dev/null; then
	echo "skipped: clang-tidy is not installed"
	exit 77
fi
if find src tools -name '*.c' -print0 |
	xargs -0 -n 1 -P "$(nproc)" clang-tidy --quiet -p "$build" \
		2> >(grep -v "warnings\? generated" >&2); then
	echo "clang-tidy found nothing"
else
	echo "FAILED: see above; again with: tests/tidy.sh $1"
	exit 1
fi
