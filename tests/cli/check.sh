# whittle check: counts of small meshes, JSON, --strict, refusals.
. "$(dirname "$0")/lib.sh"

# row TEXT VALUE: the table has this line
row() {
	grep -q "^ *$1  *$2\$" out || fail "no \"$1 $2\" in: $(cat out)"
}

header() {
	printf 'ply\nformat ascii 1.0\nelement vertex %s\n' "$1"
	printf 'property float x\nproperty float y\nproperty float z\n'
	printf 'element face %s\nproperty list uchar int vertex_indices\nend_header\n' "$2"
}

{
	header 4 4
	printf '0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n'
} >tetrahedron.ply
{
	header 6 4
	printf '0 0 0\n1 0 0\n1 1 0\n-1 0 0\n-1 -1 0\n1 1 0\n'
	printf '3 0 1 2\n3 0 3 4\n3 0 3 3\n3 3 4 0\n'
} >broken.ply

expect 0 "$WHITTLE" check tetrahedron.ply --strict
row vertices 4
row edges 6
row boundary 0
row genus 0
row clean yes
row 'radius ratio, mean' 0.8713 # three of 2 sqrt(2) - 2 and one of 1
row '5 % of the faces below' 0.828

expect 0 "$WHITTLE" check broken.ply
row clean no
row degenerate 1
row duplicates 1
row unreferenced 1
row 'at the position of another' 1
row 'badly oriented' 3
row genus undefined
expect 3 "$WHITTLE" check --strict broken.ply

expect 0 "$WHITTLE" check --json broken.ply
for want in '"clean": false' '"genus": null' '"degenerate_faces": 1' '"components": 1' \
	'"edge_components": 2' '"nonmanifold_vertices": 1' '"file": "broken.ply"' '"radius_ratio_mean": 0.' '"radius_ratio_p5": 0'; do
	grep -q "$want" out || fail "no $want in the JSON"
done

# vertices that are not finite are counted, and left out with their faces; others can be welded
{
	header 7 5
	printf '0 0 0\n1 0 0\n0 1 0\n0 0 1\n0 0 1.001\nnan 0 1\n1 -inf 0\n'
	printf '3 0 2 1\n3 0 1 3\n3 0 4 2\n3 1 2 3\n3 1 2 5\n'
} >invalid.ply
for memory in 1G 33M; do
	expect 3 "$WHITTLE" check invalid.ply --strict --memory $memory
	row vertices 7
	row 'not finite' 2
	row faces 5
	row 'with a vertex not finite' 1
	row boundary 4
	row clean no
	expect 0 "$WHITTLE" check invalid.ply --json --weld 0.01 --memory $memory
	for want in '"welded_vertices": 1' '"boundary_edges": 0' '"largest_component": 4' '"vertices": 7'; do
		grep -q "$want" out || fail "no $want in the JSON: $(cat out)"
	done
	[ "$(tr -d ' \n' <out | grep -o '"broken":.*')" = '"broken":["nonfinite_vertices"]}' ] ||
		fail "what is broken: $(cat out)"
done
expect 2 "$WHITTLE" check invalid.ply --weld few

# the same words for any number of threads
"$WHITTLE" generate -q -o sphere.ply --faces 30K || fail "generate"
expect 0 "$WHITTLE" check --json --threads 1 sphere.ply
mv out one
expect 0 "$WHITTLE" check --json --threads 3 sphere.ply
cmp -s one out || fail "threads changed the figures"
expect 0 "$WHITTLE" check --strict sphere.ply
row 'Euler characteristic' 2

# the same words when it is cut into clusters; nothing temporary is left
"$WHITTLE" generate -q -o large.ply --faces 1M || fail "generate"
mkdir temp
expect 0 "$WHITTLE" check --json large.ply
mv out one
expect 0 "$WHITTLE" check --json --memory 36M --temp-dir temp large.ply
cmp -s one out || fail "the ceiling changed the figures"
rmdir temp || fail "left behind: $(ls temp)"
expect 5 "$WHITTLE" check --memory 14M large.ply
grep -q 'use --memory' err || fail "no size that would do is named"
expect 1 "$WHITTLE" check --memory 36M --temp-dir nowhere large.ply

# refusals
expect 2 "$WHITTLE" check
expect 2 "$WHITTLE" check a.ply b.ply
expect 2 "$WHITTLE" check --threads few tetrahedron.ply
expect 2 "$WHITTLE" check --nonsense tetrahedron.ply
expect 2 "$WHITTLE" check --memory 0 tetrahedron.ply
expect 2 "$WHITTLE" check --memory lots tetrahedron.ply
expect 0 "$WHITTLE" check --help
expect 3 "$WHITTLE" check missing.ply
grep -q 'missing.ply' err || fail "a missing file is not named"
expect 3 "$WHITTLE" check .
head -c 200 sphere.ply >cut.ply
expect 3 "$WHITTLE" check cut.ply

[ "$failures" -eq 0 ] || exit 1
echo "check: ok"
