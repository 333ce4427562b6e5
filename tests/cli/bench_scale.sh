# bench/scale, small: tables and figures of two meshes, the same bytes for all threads, parts and processes,
# and a model that foretells no more time for more threads.
scale=$(realpath "$(dirname "$0")/../../bench/scale")
. "$(dirname "$0")/lib.sh"
if ! python3 -c 'import json' 2>/dev/null; then
	echo "skipped: there is no python3"
	exit 77
fi
"$scale" --sizes 60K,120K --keep 1/10 --rounds 1 --threads 2 --nodes 2,3 --whittle "$WHITTLE" --work "$dir/work" \
	--results "$dir/results" >log 2>&1 || fail "status $?: $(cat log)"
python3 - <<'E2' || fail "the figures"
import json, os
results = json.load(open("results/scale.json"))
assert [case["size"] for case in results["cases"]] == ["60K", "120K"]
for case in results["cases"]:
    assert sorted(run["threads"] for run in case["runs"]) == [1, 2]
    assert [run["threads"] for run in case["side_by_side"]] == [1] * min(2, os.cpu_count())
    for run in case["runs"]:
        assert run["faces"] == case["target"] or run["faces"] == case["target"] - 1
        for name, phase in run["phases"].items():
            model = phase["model_seconds"]
            assert model == sorted(model, reverse=True), name
            assert phase["serial_seconds"] <= model[-1] + 1e-9
            assert phase["seconds"] <= 1e-6 or 0 < phase["busy_seconds"] <= 2.05 * phase["seconds"], name
            if run["threads"] == 1:
                assert abs(phase["busy_seconds"] - model[0]) < 1e-6, name
                assert phase["busy_seconds"] <= phase["seconds"] + 1e-6, name
    assert [shared["nodes"] for shared in case["shared"]] == [2, 3]
    for shared in case["shared"]:
        assert len(shared["rounds"]) >= 1
        read, written = shared["ingest"]["bytes"]
        # every part goes twice through its faces, and to the vertices of its stretch
        assert read >= case["faces"] * (26 + 12) and written >= case["faces"] * 19
        for one in [shared["ingest"], *shared["rounds"]]:
            assert 0 < one["longest"] < one["jobs"] and one["serial_seconds"] > 0
E2
grep -q '^| \*\*decimate\*\* ' results/scale.md || fail "no table of phases"
[ -z "$(ls work)" ] || fail "left: $(ls work)"
[ $failures -eq 0 ] || exit 1
echo "bench/scale: ok"
