# Every C file looks as clang-format 14 would write it (.clang-format).
set -euo pipefail
cd "$(dirname "$0")/../.."

if ! clang-format --version 2>/dev/null | grep -q 'version 14\.'; then
	echo "skipped: no clang-format 14 (other versions write other spaces)"
	exit 77
fi
if find src tools tests bench -name '*.[ch]' -print0 |
	xargs -0 clang-format --dry-run -Werror; then
	echo "all files are in shape"
else
	echo "FAILED: run clang-format -i on the files above"
	exit 1
fi
