"""The gate: instructions of `whittle reduce` for each face removed, against a recorded baseline.

Counted by callgrind, so that a busy machine changes nothing. Counts do depend on the compiler, its
flags, the instruction sets and valgrind; where one of these is not the baseline's, what would be
a failure is a warning.
"""
import json
import os
import pathlib
import re
import shutil
import subprocess
import tempfile

import machine
import programs

BASELINE = pathlib.Path(__file__).resolve().parent.parent / "baseline.json"
FACES = "200K"
TOLERANCE = 0.05
SKIPPED = 77  # as ctest wants it


def flags_of(build):
    """The compiler's, but for debug information, from the build folder's cache."""
    try:
        cache = dict(re.findall(r"^(\w+):\w+=(.*)$", (build / "CMakeCache.txt").read_text(), re.M))
    except OSError:
        return "unknown"
    kind = cache.get("CMAKE_BUILD_TYPE", "")
    flags = cache.get("CMAKE_C_FLAGS", "") + " " + cache.get(f"CMAKE_C_FLAGS_{kind.upper()}", "")
    return " ".join(f for f in flags.split() if f != "-g")


def circumstances(whittle):
    """What a count depends on besides the source."""
    return {
        "compiler": machine.compiler_of(whittle),
        "flags": flags_of(whittle.parent),
        "simd": machine.simd(),
        "valgrind": machine.first_line("valgrind", "--version"),
    }


def without_debug_information(whittle, folder):
    """A copy: valgrind reads that first, and gives up on some that clang writes."""
    copy = folder / "whittle"
    subprocess.run(["strip", "-g", "-o", copy, whittle], check=True)
    return copy


def per_face(whittle, mesh, folder, options):
    report = folder / "report.json"
    command = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", str(whittle),
               "reduce", "-q", "-f", str(mesh), "-o", str(folder / "out.ply"), "--faces", "10%",
               "--threads", "1", "--memory", "1G", "--report", str(report)] + options
    environment = dict(os.environ, OMP_NUM_THREADS="1")
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    if done.returncode != 0:
        raise SystemExit(f"gate: {' '.join(command)}\n{done.stderr}")
    instructions = int(re.search(r"Collected : (\d+)", done.stderr).group(1))
    made = json.loads(report.read_text())
    return round(instructions / (made["input"]["faces"] - made["output"]["faces"]), 1)


def count(whittle):
    variants = {"default": []}
    if programs.has_fast(whittle):
        variants["fast"] = ["--fast"]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        mesh = folder / "mesh.ply"
        subprocess.run([whittle, "generate", "-q", "-o", mesh, "--faces", FACES, "--threads", "1"],
                       check=True)
        copy = without_debug_information(whittle, folder)
        return {v: per_face(copy, mesh, folder, options) for v, options in variants.items()}


def record(counts, around):
    BASELINE.write_text(json.dumps({"mesh": f"whittle generate --faces {FACES}, to 10%", **around,
                                    "instructions_per_face": counts}, indent=1) + "\n")
    print(f"gate: recorded in {BASELINE}")


def judge(counts, baseline):
    """How many variants take too many instructions."""
    failures = 0
    for variant, got in counts.items():
        want = baseline["instructions_per_face"].get(variant)
        if want is None:
            print(f"gate: {variant}: {got:.0f} instructions a face; no baseline (--record)")
            continue
        change = got / want - 1
        word = "FAILED" if change > TOLERANCE else "ok"
        if change < -TOLERANCE:
            word = "better: consider --record"
        print(f"gate: {variant}: {got:.0f} instructions a face, baseline {want:.0f}, "
              f"{100 * change:+.1f} %: {word}")
        failures += change > TOLERANCE
    return failures


def check(whittle, options):
    if not shutil.which("valgrind") or not shutil.which("strip"):
        print("skipped: the gate needs valgrind and strip (binutils)")
        return SKIPPED if options.gate else 0
    counts, around = count(whittle), circumstances(whittle)
    if options.record:
        record(counts, around)
        return 0
    baseline = json.loads(BASELINE.read_text())
    failures = judge(counts, baseline)
    others = [k for k, v in around.items() if baseline.get(k) != v]
    if others:
        print("gate: warning: the baseline was made elsewhere, so nothing here is a failure:")
        for k in others:
            print(f"gate:   {k}: {around[k]} here, {baseline.get(k)} there")
        return 0
    return int(failures > 0)
