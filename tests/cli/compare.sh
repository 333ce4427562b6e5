# whittle compare: known distances, the same figures for any number of threads, refusals.
. "$(dirname "$0")/lib.sh"

# square NAME HEIGHT
square() {
	{
		printf 'ply\nformat ascii 1.0\nelement vertex 4\n'
		printf 'property float x\nproperty float y\nproperty float z\n'
		printf 'element face 2\nproperty list uchar int vertex_indices\nend_header\n'
		printf '0 0 %s\n3 0 %s\n3 4 %s\n0 4 %s\n3 0 1 2\n3 0 2 3\n' "$2" "$2" "$2" "$2"
	} >"$1"
}

square low.ply 0
square high.ply 0.5
expect 0 "$WHITTLE" compare low.ply high.ply --samples 10K
grep -q '^  mean  *0.5  *0.5  *0.5$' out || fail "the mean is not 0.5: $(cat out)"
grep -q '^  max  *10.000000  *10.000000  *10.000000$' out || fail "the maximum is not 10 %"
grep -q '^  RMS  *100000.00  *100000.00  *100000.00$' out || fail "the RMS is not 1e5"
grep -A2 '^degrees between normals' out | grep -q '^  RMS  *0.0000  *0.0000  *0.0000$' ||
	fail "parallel planes deviate: $(cat out)"
grep -q '^samples  *10000  *10000  *20000$' out || fail "samples"
grep -q '^diagonal of A  *5$' out || fail "diagonal"
expect 0 "$WHITTLE" compare -q low.ply low.ply --samples 1K
[ -s err ] && fail "not quiet: $(cat err)"
grep -q '^two-sided RMS distance  *0 = 0.00 ' out || fail "a mesh is not at distance 0 from itself"
expect 0 "$WHITTLE" compare low.ply high.ply --json --samples 1000
for want in '"diagonal": 5.0' '"rms": 0.5' '"rms_millionths": 100000.0' '"samples": 2000' '"normal_rms": 0.0'; do
	grep -q "$want" out || fail "no $want in the JSON: $(cat out)"
done

# the schedule leaves no trace, the seed does
"$WHITTLE" generate -q -o a.ply --faces 30K || fail "generate"
"$WHITTLE" generate -q -o b.ply --faces 4K || fail "generate"
for threads in 1 2 3; do
	expect 0 "$WHITTLE" compare a.ply b.ply --json --samples 50K --threads $threads
	mv out out.$threads
done
cmp -s out.1 out.2 && cmp -s out.1 out.3 || fail "threads changed the figures"
expect 0 "$WHITTLE" compare a.ply b.ply --json --samples 50K --seed 1
cmp -s out.1 out && fail "the seed changed nothing"

# neither does the ceiling, far below what the mesh takes, nor the order of the file
mkdir temp
"$WHITTLE" generate -q -o large.ply --faces 400K || fail "generate"
for memory in 24M 1G; do
	expect 0 "$WHITTLE" compare large.ply b.ply --json --samples 20K --memory $memory --temp-dir temp
	mv out out.$memory
	expect 0 "$WHITTLE" compare b.ply large.ply --json --samples 20K --memory $memory --temp-dir temp
	mv out back.$memory
done
cmp -s out.24M out.1G && cmp -s back.24M back.1G || fail "the ceiling changed the figures"
[ -z "$(ls temp)" ] || fail "temporary files are left: $(ls temp)"
expect 5 "$WHITTLE" compare large.ply b.ply --memory 14M
grep -q 'use --memory' err || fail "no size that would do is named"
expect 5 "$WHITTLE" compare b.ply large.ply --memory 14M
expect 1 "$WHITTLE" compare a.ply b.ply --temp-dir nowhere
grep -A1 '"histogram": {' out.1G | grep -q '"end": \[' || fail "no histogram"

# a stray vertex: it is found, and all else is measured as before, at once
{
	printf 'ply\nformat ascii 1.0\nelement vertex 5\n'
	printf 'property float x\nproperty float y\nproperty float z\n'
	printf 'element face 3\nproperty list uchar int vertex_indices\nend_header\n'
	printf '0 0 0\n3 0 0\n3 4 0\n0 4 0\n1e30 1e30 0\n3 0 1 2\n3 0 2 3\n3 1 2 4\n'
} >stray.ply
expect 0 "$WHITTLE" compare high.ply stray.ply --samples 10K
grep -q '^  max  *0.5  *1.41421e+30 ' out && grep -q '^  mean  *0.5 ' out ||
	fail "a stray vertex spoils the rest: $(cat out)"

# the band along the cuts; beside a result that was never cut there is little to see
"$WHITTLE" reduce -q a.ply -o cut.ply --faces 10% --cluster-faces 2K --seams seams.ply || fail "reduce"
"$WHITTLE" reduce -q a.ply -o whole.ply --faces 10% --cluster-faces 0 --micro-faces 0 --seams none.ply ||
	fail "reduce"
expect 0 "$WHITTLE" compare a.ply cut.ply --samples 50K --seams seams.ply --reference whole.ply
[ "$(grep -c '^  ratio of RMS  *[01]\.[0-9]*$' out)" -eq 3 ] || fail "ratios of RMS: $(cat out)"
[ "$(grep -c '^  ratio of faces / area  *[01]\.[0-9]*$' out)" -eq 3 ] || fail "ratios of density"
grep -A5 '^B over' out | grep -q '^  ratio of RMS  *\(0\.9\|1\.0\)' || fail "the cuts show: $(cat out)"
expect 0 "$WHITTLE" compare a.ply cut.ply --samples 50K --seams none.ply
grep -q '^  ratio of RMS  *undefined$' out || fail "a ratio without a cut"
for threads in 1 3; do
	expect 0 "$WHITTLE" compare a.ply cut.ply --samples 50K --seams seams.ply --reference whole.ply \
		--json --threads $threads
	mv out out.$threads
done
cmp -s out.1 out.3 || fail "threads changed the band"
for want in band interior rms_ratio density_ratio reference rms_ratio_over_reference; do
	grep -q "\"$want\": " out.1 || fail "no $want in the JSON"
done
expect 0 "$WHITTLE" compare a.ply cut.ply --samples 1K --seams none.ply --json
grep -q '"rms_ratio": null' out || fail "no null for a ratio that is undefined"

# reduce measures its result by itself, with the same figures
expect 0 "$WHITTLE" reduce b.ply -o few.ply --faces 30% --measure --samples 5K --report few.json
grep -q '"samples": 10000' few.json || fail "not measured with so many samples"
expect 0 "$WHITTLE" reduce b.ply -o measured.ply --faces 30% --measure --seams points.ply --report report.json
grep -q '^measured: RMS ' out && grep -q '^along the seams: RMS ' out || fail "not measured: $(cat out)"
rms=$(sed -n 's/^measured: RMS [^(]*(\([0-9.]*\) mill.*/\1/p' out)
grep -q '"regions": ' report.json || fail "no regions in the report"
expect 0 "$WHITTLE" compare b.ply measured.ply
grep -q "^two-sided RMS distance .* = $rms millionths" out || fail "compare says otherwise than $rms"
expect 2 "$WHITTLE" reduce b.ply -o - --faces 30% --measure
expect 2 "$WHITTLE" reduce b.ply -o b.ply -f --faces 30% --measure
expect 2 "$WHITTLE" reduce b.ply -o b.glb --faces 30% --measure

# each level, but those left out, as compare says
expect 0 "$WHITTLE" reduce b.ply -o lod.ply --levels 90%,40%,20% --measure --report lod.json
[ "$(grep -c '^lod-.* measured: RMS ' out)" -eq 3 ] || fail "not three levels: $(cat out)"
expect 0 "$WHITTLE" reduce b.ply -f -o lod.ply --levels 1M,2K,1K --measure --report lod.json
[ "$(grep -c '^lod-.* measured: RMS ' out)" -eq 2 ] || fail "not two levels: $(cat out)"
for n in 2000 1000; do
	rms=$(sed -n "s/^lod-$n.ply measured: RMS [^(]*(\([0-9.]*\) mill.*/\1/p" out)
	"$WHITTLE" compare b.ply "lod-$n.ply" >compared
	grep -q "^two-sided RMS distance .* = $rms millionths" compared || fail "lod-$n: compare says otherwise than $rms"
done
[ "$(grep -c '"regions": ' lod.json)" -eq 2 ] || fail "not two figures in the report"

# an input that is what --from says, not what it looks like
"$WHITTLE" reduce b.ply -q -o b.obj --faces 50%
(echo ply && cat b.obj) >odd
expect 0 "$WHITTLE" reduce odd --from obj -o from.ply --faces 1K --measure
grep -q '^measured: RMS ' out || fail "not measured: $(cat out)"

# with a run directory, and of a run that was begun elsewhere
expect 0 "$WHITTLE" reduce b.ply -o plain.ply --faces 1K --cluster-faces 2K --run-dir run --measure
figures=$(grep '^measured: ' out)
[ ! -e run ] || fail "the run directory is left"
"$WHITTLE" plan b.ply -o again.ply --faces 1K --cluster-faces 2K --run-dir run --parts 2 >/dev/null
expect 0 "$WHITTLE" stage ingest --run-dir run --part 1/2
expect 0 "$WHITTLE" reduce b.ply -o again.ply --faces 1K --cluster-faces 2K --run-dir run --resume --measure
[ -n "$figures" ] && grep -qF "$figures" out || fail "other figures: $(cat out)"

# refusals
expect 2 "$WHITTLE" compare a.ply b.ply --reference b.ply
expect 3 "$WHITTLE" compare a.ply b.ply --seams low.ply
grep -q 'low.ply.*no binary PLY' err || fail "text is not refused as seams: $(cat err)"
expect 3 "$WHITTLE" compare a.ply b.ply --seams missing.ply
expect 3 "$WHITTLE" compare a.ply b.ply --seams seams.ply --reference missing.ply
expect 2 "$WHITTLE" compare
expect 2 "$WHITTLE" compare a.ply
expect 2 "$WHITTLE" compare a.ply b.ply low.ply
expect 2 "$WHITTLE" compare a.ply b.ply --samples 0
expect 2 "$WHITTLE" compare a.ply b.ply --samples many
expect 2 "$WHITTLE" compare a.ply b.ply --samples 99999999999999999999
grep -q 'no count from 1 to 1000G' err || fail "too many samples: $(cat err)"
expect 2 "$WHITTLE" reduce a.ply -o small.ply --faces 1K --samples 10K
expect 0 "$WHITTLE" help compare
grep -q '^usage: whittle compare A B' out || fail "no help: $(cat out)"
expect 2 "$WHITTLE" help nonsense
sed 's/^element face .*/element face 0/; /^3 [012] [12] [23]$/d' low.ply >points.ply
expect 3 "$WHITTLE" compare a.ply points.ply
grep -q "'points.ply' is no mesh: it has no faces" err || fail "an empty mesh: $(cat err)"
expect 2 "$WHITTLE" compare a.ply b.ply --seed
expect 2 "$WHITTLE" compare a.ply b.ply --nonsense
expect 2 "$WHITTLE" compare a.ply b.ply --memory 0
expect 2 "$WHITTLE" compare a.ply b.ply --memory lots
expect 0 "$WHITTLE" compare --help
expect 3 "$WHITTLE" compare a.ply missing.ply
grep -q 'missing.ply' err || fail "a missing file is not named"
expect 3 "$WHITTLE" compare a.ply .

[ "$failures" -eq 0 ] || exit 1
echo "compare: ok"
