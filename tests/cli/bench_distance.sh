# bench/distance, small, with stand-ins for MeshLab and CGAL that are whittle itself with other samples:
# they agree; and one that is off by a tenth is found out.
bench=$(realpath "$(dirname "$0")/../../bench/distance")
. "$(dirname "$0")/lib.sh"
if ! command -v python3 >/dev/null; then
	echo "skipped: no python3"
	exit 77
fi

mkdir peers
cat >peers/cgal_distance <<'END'
#!/usr/bin/python3
"""A B SAMPLES: figures of whittle at other samples, times $FACTOR; errors by those of random samples."""
import json, math, os, subprocess, sys
words = [os.environ["WHITTLE"], "compare", *sys.argv[1:3], "--json", "--no-progress", "--seed", "7",
         "--samples", sys.argv[3]]
got = json.loads(subprocess.run(words, capture_output=True, check=True).stdout)
made = {"library": "other", "version": "1"}
for side in ("a_to_b", "b_to_a"):
    d, factor = got[side], float(os.environ["FACTOR"])
    error = math.sqrt((d["rms"] ** 2 - d["mean"] ** 2) / d["samples"])
    made[side] = {k: d[k] * factor for k in ("mean", "rms", "max")}
    made[side].update(mean_error=error, rms_error=error)
print(json.dumps(made))
END
cat >peers/measured <<'END'
#!/bin/bash
echo '{"wall": 2, "user": 1, "system": 1, "peak_rss_kib": 2048}' >"$1"
shift
"$@"
END
chmod +x peers/*
cp peers/cgal_distance peers/meshlab_distance

"$WHITTLE" generate -q -o scan.ply --faces 20K || fail "generate"
distance() {
	python3 "$bench" --whittle "$WHITTLE" --peers peers --work work --samples 20000 --only "$PWD/scan.ply" \
		--results results "$@"
}
export FACTOR=1
expect 0 distance --rounds 1 --size 20K
grep -q '^| scan | [0-9]* to [0-9]* | scan to result |' results/results.md || fail "no row: $(cat results/results.md)"
grep -q '^| MeshLab | 2 | 2 | 2 | 1.00 ' results/results.md || fail "no speed: $(cat results/results.md)"

# what was measured stays, what is measured anew is replaced
FACTOR=1.1
expect 1 distance --rounds 0
grep -q '^| MeshLab | 2 ' results/results.md || fail "the speed is gone"
[ "$(grep -c '^| scan |' results/results.md)" -eq 2 ] || fail "not one row and its head: $(cat results/results.md)"

[ "$failures" -eq 0 ] || exit 1
echo "bench/distance: ok"
