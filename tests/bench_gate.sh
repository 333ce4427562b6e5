# A face takes no more instructions than bench/baseline.json says (bench/run --gate).
set -euo pipefail
build=${WHITTLE_BUILD:?the build folder}
cd "$(dirname "$0")/.."

skip() {
	echo "skipped: $*"
	exit 77
}

[ -z "${WHITTLE_SANITIZE:-}" ] || skip "sanitizers count too"
command -v valgrind >/dev/null || skip "valgrind is not installed"
[ -x /usr/bin/python3 ] || skip "Python 3 is not installed"
exec bench/run --gate --build "$build"
