# whittle plan: what it predicts is what reduce then takes; a ceiling too small is refused with one
# that does.
. "$(dirname "$0")/lib.sh"

# number FILE KEY: of a JSON file with a member to a line
number() {
	sed -n "s/^ *\"$2\": *\([0-9]*\),*$/\1/p" "$1" | head -1
}

# near WHAT PREDICTED REAL PERCENT
near() {
	local off=$((($2 - $3) * 1000 / $3))
	echo "$1: predicted $2, was $3 ($((off / 10)).$((${off#-} % 10)) %)"
	[ ${off#-} -le $(($4 * 10)) ] || fail "$1: predicted $2, was $3: off by more than $4 %"
}

# holds NAME OPTION...: reduce takes what plan says, and no more than the ceiling
holds() {
	local name=$1 memory=$2
	shift
	shift
	expect 0 "$WHITTLE" plan --json --memory "$memory" "$@"
	cp out plan.json
	expect 0 "$WHITTLE" reduce -q -f --memory "$memory" "$@" -o o.ply --report report.json
	near "$name, $memory: disk" "$(number plan.json temp_bytes_peak)" \
		"$(number report.json temp_bytes_peak)" 10
	near "$name, $memory: clusters" "$(number plan.json clusters)" \
		"$(number report.json clusters)" 0
	near "$name, $memory: rounds" "$(number plan.json rounds)" "$(number report.json rounds)" 0
	[ -z "${WHITTLE_SANITIZE:-}" ] || return 0 # sanitizers need memory of their own
	# two threads that happen not to be at their most together take less than a run can: the
	# largest of a few runs counts
	local predicted highest=0 runs=0 peak
	predicted=$(number plan.json peak_rss_bytes)
	while [ $runs -lt 4 ] && [ "$predicted" -gt $((highest * 11 / 10)) ]; do
		[ $runs -eq 0 ] || expect 0 "$WHITTLE" reduce -q -f --memory "$memory" "$@" -o o.ply \
			--report report.json
		runs=$((runs + 1))
		peak=$(number report.json peak_rss_bytes)
		[ "$peak" -gt $highest ] && highest=$peak
		[ "$peak" -le $((${memory%M} << 20)) ] || fail "$name: more than $memory: $peak"
	done
	near "$name, $memory: memory" "$predicted" "$highest" 10
}

"$WHITTLE" generate -q -o sphere.ply --faces 2M
"$WHITTLE" generate -q -o shuffled.ply --faces 1M --order shuffled --shape torus
"$WHITTLE" generate -q -o terrain.ply --faces 1M --shape terrain --double
ceilings="96M 160M 512M"
[ -z "${WHITTLE_SANITIZE:-}" ] || ceilings=160M # what a ceiling changes is memory, of which they say nothing
for memory in $ceilings; do
	holds "sphere to 1 %" $memory sphere.ply --faces 1%
	holds "sphere to 50 %" $memory sphere.ply --faces 50% --cluster-faces 100k
	holds "shuffled torus to 5 %" $memory shuffled.ply --faces 5% --cluster-faces 100k
	holds "terrain in doubles to 20 %" $memory terrain.ply --faces 20% --cluster-faces 80k
	scan=$WHITTLE_DATA/scans/dragon_vrip.ply
	if [ -r "$scan" ]; then
		holds "dragon to 10 %" $memory "$scan" --faces 10% --cluster-faces 150k
	else
		echo "skipped: no $scan"
	fi
done

"$WHITTLE" generate -q -o coloured.ply --faces 1M --colors --normals
holds "coloured sphere to 5 %" 96M coloured.ply --faces 5% --cluster-faces 100k
holds "the same to 40 %, colours alone" 160M coloured.ply --faces 40% --attributes colour

[ $failures -eq 0 ] || exit 1
echo "plan: ok"
