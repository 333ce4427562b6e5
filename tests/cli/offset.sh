# Coordinates far from zero: digits and distances as near it.
. "$(dirname "$0")/lib.sh"

# bounds FILE: the box, as JSON has it, one number a line
bounds() {
	"$WHITTLE" info --json "$1" | sed -n 's/^ *\(-\{0,1\}[0-9.e+-]*\),\{0,1\}$/\1/p'
}

surface=(--faces 20K --shape terrain --seed 4)
expect 0 "$WHITTLE" generate -q -o near.ply "${surface[@]}" --double
expect 0 "$WHITTLE" generate -q -o far.ply "${surface[@]}" --offset 500000.125,5200000,300
for place in near far; do
	expect 0 "$WHITTLE" reduce -q $place.ply -o $place-small.ply --faces 10% --cluster-faces 5K
	expect 0 "$WHITTLE" compare $place.ply $place-small.ply --samples 20K
	sed -n 's/^two-sided RMS distance *\([0-9.]*\) .*/\1/p' out >$place.rms
done
[ -s near.rms ] || fail "no distance"
cmp -s near.rms far.rms || fail "another distance far off: $(cat near.rms far.rms)"

# every digit of a coordinate is shown, to people and to programs
[ "$(bounds far.ply | wc -l)" -eq 6 ] || fail "bounds: $(bounds far.ply)"
for number in $(bounds far.ply); do
	for command in info check; do
		expect 0 "$WHITTLE" $command far.ply
		grep -qE "[: ]${number%.0}( |\$)" out || fail "$command does not show $number: $(cat out)"
	done
done

# in text and back
expect 0 "$WHITTLE" reduce -q far.ply -o text.ply --faces 10% --cluster-faces 5K --ascii
expect 0 "$WHITTLE" compare text.ply far-small.ply --samples 20K
grep -q '^two-sided RMS distance .* = 0.00 ' out || fail "text is not the same mesh: $(cat out)"

[ "$failures" -eq 0 ] || exit 1
echo "offset: ok"
