# House rules that keep the modules apart.
#
# Who may include whom. A folder may include itself and what its line names; geom, io and exec
# are strangers to one another. The public whittle.h may be included by run and tools only (any
# other file of the library that needs it has its dependency upside down), and shows no more
# than base.
#
#   base      -
#   geom      base
#   io        base
#   exec      base
#   mesh      base geom exec           (bvh is built and asked in parallel)
#   algo      base geom io exec mesh   (io: synth streams what it makes)
#   pipeline  base geom io exec mesh algo
#   run       all of these, and whittle.h
#   whittle   all of these             (the files of src/ itself: the public calls)
#   tools     all of these
#
# Within algo, one algorithm does not include another (synth_* is one; simplify's parts are named below).
# OpenMP lives in exec.c, hwloc in topo.c, MPI in exec/ranks.c, libpng in png.c, libjpeg in jpeg.c, rply in rply_read.c.
# The library never prints, never ends the process and
# keeps no mutable globals: asked of its symbols, so macros and compilers cannot hide it.
set -euo pipefail
build=${WHITTLE_BUILD:?the build folder}
sanitize=${WHITTLE_SANITIZE:-}
cd "$(dirname "$0")/../.."
failures=0

fail() {
	echo "FAILED: $*"
	failures=$((failures + 1))
}

# includes FILE...: FILE:LINE of every include of our own, as "file header"
includes() {
	grep -Hn '^# *include "' "$@" | sed -E 's/^([^:]*):[0-9]+:# *include "([^"]*)".*/\1 \2/'
}

# layer FOLDER ALLOWED...: its files include only itself, what is allowed, and their own header
layer() {
	local folder=$1 file header
	shift
	while read -r file header; do
		case " $folder $* " in
		*" ${header%%/*} "*) ;;
		*) fail "$file includes $header, which is not below $folder" ;;
		esac
	done < <(includes "src/$folder"/*.[ch])
}

layer base
layer geom base
layer io base
layer exec base
layer mesh base geom exec
layer algo base geom io exec mesh
layer pipeline base geom io exec mesh algo
layer run base geom io exec mesh algo pipeline whittle.h
while read -r _ header; do
	[[ $header == base/* ]] || fail "whittle.h shows $header to the world"
done < <(includes src/whittle.h)

# family FILE: the algorithm that a file of algo belongs to
family() {
	local name=${1##*/}
	name=${name%%.*}
	case $name in
	queue | star | fan | trial | stretch | surgery | blend* | wedge | policy*) echo simplify ;;
	*) echo "${name%%_*}" ;;
	esac
}

while read -r file header; do
	[[ $header == algo/* ]] || continue
	[ "$(family "$file")" = "$(family "$header")" ] ||
		fail "$file includes $header: algorithms do not know each other"
done < <(includes src/algo/*.[ch])

# only FILE PATTERN: nothing but this file of the library or the tools has such a line
only() {
	local found
	found=$(grep -rlE --include='*.[ch]' "$2" src tools | grep -vx "$1" || true)
	[ -z "$found" ] || fail "only $1 may have \"$2\":" "$found"
}

only src/exec/exec.c '^[[:space:]]*#[[:space:]]*pragma omp'
only src/exec/exec.c '#[[:space:]]*include <omp\.h>'
only src/exec/topo.c '#[[:space:]]*include <hwloc'
only src/exec/ranks.c '#[[:space:]]*include <mpi\.h>'
only src/io/rply_read.c '#[[:space:]]*include <rply\.h>'
only src/io/png.c '#[[:space:]]*include <png\.h>'
only src/io/jpeg.c '#[[:space:]]*include <jpeglib\.h>'

# called SYMBOLS...: the library calls one of these
called() {
	local pattern
	pattern=$(IFS='|' && echo "$*")
	nm -A -u "$build/libwhittle.a" | grep -E " U ($pattern)\$" || true
}

# Variables that can be written to. OpenMP's named lock, which is one, is the compiler's.
variables() {
	objdump -t "$build/libwhittle.a" |
		grep -E '[[:space:]](\.data|\.bss|\.tdata|\.tbss|\*COM\*)' |
		grep -E ' O |\*COM\*' |
		grep -vE '\.data\.rel\.ro|\.gomp_critical_user_' || true
}

if [ -n "$sanitize" ]; then
	echo "symbols are not looked at: the sanitizer added its own"
else
	found=$(called printf vprintf fprintf vfprintf __printf_chk __fprintf_chk __vfprintf_chk \
		puts putchar putc fputs fputc perror stdout stderr \
		exit _exit _Exit quick_exit abort raise)
	[ -z "$found" ] || fail "the library prints or ends the process:" "$found"
	found=$(variables)
	[ -z "$found" ] || fail "the library has mutable globals:" "$found"
fi
[ "$failures" -eq 0 ] && echo "the map holds"
exit $((failures > 0))
