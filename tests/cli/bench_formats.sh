# bench/formats, small: every format is read to the same counts, by threads and by rply, and has its row.
run=$(realpath "$(dirname "$0")/../../bench/formats/run")
. "$(dirname "$0")/lib.sh"
if ! command -v python3 >/dev/null; then
	echo "skipped: no python3"
	exit 77
fi
"$run" --faces 20K --rounds 1 --threads 2 --build "$WHITTLE_BUILD" --work work --results results >log 2>&1 ||
	fail "status $?: $(cat log)"
python3 - <<'END' || fail "the figures: $(cat log)"
import json
cases = json.load(open("results/formats.json"))["cases"]
assert {"PLY, little-endian", "PLY, big-endian", "PLY, ascii", "OBJ", "OFF", "STL, binary",
        "STL, ascii"} <= set(cases)
assert len({(c["vertices"], c["faces"]) for c in cases.values()}) == 1
for name, c in cases.items():
    assert {"1 thread", "2 threads"} <= set(c["seconds"]), name
    assert all(s > 0 for t in c["seconds"].values() for s in t), name
END
grep -q '^| PLY, big-endian | ' results/formats.md || fail "no table"
grep -q 'rply' results/formats.md || fail "not a word of rply"
[ -z "$(find work -name 'whittle-*')" ] || fail "temporary files are left"
[ "$failures" -eq 0 ] || exit 1
echo "bench/formats: ok"
