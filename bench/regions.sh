#!/bin/bash
# Is a streamed result as good as one made in memory? Looks at some regions of a generated sphere.
#
# usage: bench/regions.sh BUILD ORIGINAL.ply RESULT.ply
#
# BUILD holds whittle and crop (cmake --build BUILD --target crop). For each region, a box on the
# sphere, the original's part of it and a margin is reduced in one piece in memory so that as many
# faces lie in the box as the result has there. Then both are measured against the original, both
# ways, within the box. Prints the RMS of each and their ratio, and the largest ratio.
set -euo pipefail
build=$1 original=$2 result=$3
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
margin=300 shrink=60

whittle() { "$build/whittle" "$@"; }
crop() { "$build/crop" "$@"; }

# box X Y Z BY: the box grown by BY, as six numbers
box() {
	awk -v x="$1" -v y="$2" -v z="$3" -v s="$((1500 + $4))" \
		'BEGIN { print x - s, y - s, z - s, x + s, y + s, z + s }'
}

# rms A B: from A to B, one way
rms() {
	whittle compare "$1" "$2" --json >"$dir/c.json"
	awk '/"a_to_b"/ { on = 1 } on && /"rms"/ { gsub(/[^0-9.e+-]/, "", $2); print $2; exit }' "$dir/c.json"
}

# error MESH: RMS both ways against the original, within the box
error() {
	awk -v a="$(rms "$1" "$dir/big.ply")" -v b="$(rms "$dir/core.ply" "$1")" \
		'BEGIN { print sqrt((a * a + b * b) / 2) }'
}

worst=0
for at in "10000 0 0" "0 10000 0" "0 0 -10000" "5774 5774 5774" "-7071 0 7071" "-5774 5774 -5774"; do
	# shellcheck disable=SC2086
	{
		set -- $at
		crop "$original" "$dir/big.ply" $(box $1 $2 $3 $margin) >"$dir/n.big"
		crop "$original" "$dir/core.ply" $(box $1 $2 $3 -$shrink) >/dev/null
		crop "$original" "$dir/all.ply" $(box $1 $2 $3 0) >"$dir/n.all"
		crop "$result" "$dir/streamed.ply" $(box $1 $2 $3 0) >"$dir/n.streamed"
	}
	wanted=$(cat "$dir/n.streamed")
	target=$(awk -v b="$(cat "$dir/n.big")" -v a="$(cat "$dir/n.all")" -v w="$wanted" 'BEGIN { printf "%d", b * w / a }')
	for _ in 1 2 3; do
		whittle reduce -q -f "$dir/big.ply" -o "$dir/whole.ply" --faces "$target" \
			--cluster-faces 0 --micro-faces 0
		# shellcheck disable=SC2086
		got=$(crop "$dir/whole.ply" "$dir/memory.ply" $(box $1 $2 $3 0))
		target=$(awk -v t="$target" -v w="$wanted" -v g="$got" 'BEGIN { printf "%d", t * w / g }')
	done
	a=$(error "$dir/streamed.ply") b=$(error "$dir/memory.ply")
	ratio=$(awk -v a="$a" -v b="$b" 'BEGIN { printf "%.4f", a / b }')
	echo "region $at: $wanted faces streamed, $got in memory, RMS $a and $b, ratio $ratio"
	worst=$(awk -v w="$worst" -v r="$ratio" 'BEGIN { print (r > w ? r : w) }')
done
echo "largest ratio $worst"
