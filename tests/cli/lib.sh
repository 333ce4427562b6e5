# What the command-line tests share: a scratch folder to work in, and checks that count failures.
# Source it first; end with the failures.
set -u
PYTHONPATH=$(realpath "$(dirname "$0")/..") # glb.py
export PYTHONPATH PYTHONDONTWRITEBYTECODE=1
dir=$(mktemp -d) || exit 1
trap 'rm -rf "$dir"' EXIT
cd "$dir" || exit 1
failures=0

fail() {
	echo "FAILED: $*"
	failures=$((failures + 1))
}

# Temporary files of the commands go to temp; what is mounted there ($mounted) goes in the end.
use_temp() {
	mounted=
	trap '[ -z "$mounted" ] || umount "$mounted"; rm -rf "$dir"' EXIT
	mkdir temp
	export TMPDIR=$dir/temp
}

# expect STATUS COMMAND...: runs it, keeps its words in out and err
expect() {
	local want=$1 got
	shift
	"$@" >out 2>err
	got=$?
	[ "$got" -eq "$want" ] || fail "status $got instead of $want: $* ($(cat err))"
}
