#!/bin/bash
# From a fresh clone to a result: installs what is missing, builds, makes a scan of 4 million
# faces, reduces it to 1 % and says what that took.
#
# usage: tools/demo.sh [FACES]      for example: tools/demo.sh 1M
set -euo pipefail
cd "$(dirname "$0")/.."

if [[ ${1:-} == -* ]]; then
	sed -n '2,/^# usage/s/^# \?//p' tools/demo.sh
	exit 0
fi

faces=${1:-4M}
whittle=build/demo/whittle
scan=build/demo/scan.ply
small=build/demo/small.ply
report=build/demo/report.json

build() {
	echo "== building, optimised (a minute or two)"
	cmake --preset release -B build/demo --log-level=WARNING -DWHITTLE_TESTS=OFF >/dev/null
	cmake --build build/demo -j "$(nproc)" >/dev/null
}

# value SECTION KEY: from the report; SECTION is "" for the outermost
value() {
	awk -v section="$1" -v key="\"$2\":" '
		/": \{/ { at = substr($1, 2, length($1) - 3) }
		/^  }/ { at = "" }
		$1 == key && at == section { sub(/,$/, ""); print $2; exit }' "$report"
}

# row LABEL FORMAT VALUE...
row() {
	local label=$1 format=$2
	shift 2
	# shellcheck disable=SC2059
	printf "%-14s $format\n" "$label" "$@"
}

mib() {
	awk -v bytes="$1" 'BEGIN { printf "%.1f", bytes / 1048576 }'
}

tools/packages.sh build
build
echo "== a scan of $faces faces"
"$whittle" generate -f -o "$scan" --faces "$faces"
echo "== reduced to 1 %"
"$whittle" reduce -q -f "$scan" -o "$small" --faces 1% --report "$report"
echo
row "" '%12s %12s' "before" "after"
row faces '%12d %12d' "$(value input faces)" "$(value output faces)"
row vertices '%12d %12d' "$(value input vertices)" "$(value output vertices)"
row "file, MiB" '%12s %12s' "$(mib "$(value input bytes)")" "$(mib "$(value output bytes)")"
row "time, s" '%25.1f' "$(value seconds total)"
row "memory, MiB" '%25s' "$(mib "$(value "" peak_rss_bytes)")"
row threads '%25d' "$(value "" threads)"
echo
echo "The result is $small; try: $whittle compare $small $scan"
