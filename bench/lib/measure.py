"""Runs the programs in turn on one mesh after the other and measures time, memory and error."""
import hashlib
import json
import os
import pathlib
import signal
import statistics
import subprocess
import tempfile

import display
from programs import REFERENCE

SLOW = 60  # seconds from which a program runs fewer rounds
SLOW_ROUNDS = 2
SUFFIXES = {"k": 10**3, "K": 10**3, "M": 10**6, "G": 10**9}
# Phases of whittle's report that are what a peer calls loading, simplifying and saving.
PHASES = {
    "load": ("open", "ingest"),
    "simplify": ("survey", "decimate", "recut", "settle", "stitch", "final"),
    "save": ("check", "write"),
}


def count(text):
    return int(float(text[:-1]) * SUFFIXES[text[-1]]) if text[-1] in SUFFIXES else int(text)


def cases(options):
    """By size first: what a size takes tells what the next would."""
    return [{"shape": shape, "size": size, "ratio": ratio, "programs": {}}
            for shape in options.shapes.split(",")
            for size in sorted(options.sizes.split(","), key=count)
            for ratio in options.ratios.split(",")]


def generate(case, whittle, options):
    """The mesh of a case, made once and kept; its number of faces."""
    folder = options.work / "meshes"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{case['shape']}-{case['size']}.ply"
    if not path.exists():
        part = path.with_suffix(".tmp")
        subprocess.run([whittle, "generate", "-q", "-f", "-o", part, "--shape", case["shape"],
                        "--faces", case["size"]], check=True)
        part.rename(path)
    info = subprocess.run([whittle, "info", "--json", path], capture_output=True, text=True,
                          check=True)
    return path, json.loads(info.stdout)["faces"]


def read_into_cache(path):
    with open(path, "rb") as f:
        while f.read(1 << 24):
            pass


class Failure(Exception):
    pass


def run_limited(argv, seconds):
    """Standard output; stops the whole group of processes when it takes too long."""
    p = subprocess.Popen(argv, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                         start_new_session=True)
    try:
        out, err = p.communicate(timeout=seconds)
    except subprocess.TimeoutExpired as e:
        os.killpg(p.pid, signal.SIGKILL)
        p.wait()
        raise Failure(f"stopped after {seconds:.0f} s") from e
    # 4: whittle could not reach the target and wrote its best.
    if p.returncode not in (0, 4):
        raise Failure(f"failed: {(err.strip() or out.strip() or str(p.returncode)).splitlines()[-1]}")
    return out


def phases_of(whittle_report):
    seconds = whittle_report["seconds"]
    return {name: sum(seconds[k] for k in keys) for name, keys in PHASES.items()}


def run_once(program, case, folder, options):
    """One run: its seconds, memory, phases and faces left."""
    used, phases, out = folder / "used.json", folder / "phases.json", folder / "out.ply"
    argv = program.argv(str(case["path"]), str(out), case["target"], str(phases))
    said = run_limited([str(options.work / "peers/measured"), str(used)] + argv, 3 * options.cap)
    run = json.loads(used.read_text())
    if program.is_whittle:
        made = json.loads(phases.read_text())
        run.update(phases_of(made), faces_out=made["output"]["faces"])
    else:
        made = json.loads(said.strip().splitlines()[-1])
        program.library, program.version = made["library"], made["version"]
        run.update({k: made[k] for k in (*PHASES, "faces_out")})
    return run


def digest(path):
    with open(path, "rb") as f:
        return hashlib.file_digest(f, "sha256").hexdigest()


def error_of(out, case, whittle, known):
    """Both ways, in millionths of the diagonal. Equal files have equal errors: `known`."""
    key = digest(out)
    if key not in known:
        done = subprocess.run([whittle, "compare", out, case["path"], "--json", "--samples", "1M"],
                              capture_output=True, text=True, check=True)
        made = json.loads(done.stdout)
        known[key] = {"rms_millionths": made["rms_millionths"],
                      "max_millionths": made["both"]["millionths"]["max"]}
    return known[key]


def predicted(program, case, earlier):
    """Seconds by the last size of the same shape and ratio, or why there are none."""
    last = None
    for c in earlier:
        if c is not case and (c["shape"], c["ratio"]) == (case["shape"], case["ratio"]):
            last = c if c["faces"] <= case["faces"] else last
    if last is None or program.name not in last["programs"]:
        return 0
    got = last["programs"][program.name]
    if "median" not in got:
        return float("inf")
    return got["median"]["wall"] * case["faces"] / last["faces"]


def reason_to_skip(program, case, earlier, cap):
    if case["faces"] > program.limit:
        return f"larger than {program.limit / 1e6:g} M faces"
    seconds = predicted(program, case, earlier)
    if seconds == float("inf"):
        return "the size before did not run"
    return f"would take {seconds:.0f} s" if seconds > cap else None


def rounds_of(entry, rounds):
    slow = entry["runs"] and entry["runs"][-1]["wall"] > SLOW
    return min(rounds, SLOW_ROUNDS) if slow else rounds


def one_round(case, programs, whittle, folder, known, options):
    for p in programs:
        entry = case["programs"][p.name]
        if "skipped" in entry or len(entry["runs"]) >= rounds_of(entry, options.rounds):
            continue
        try:
            entry["runs"].append(run_once(p, case, folder, options))
        except Failure as e:
            entry["skipped"] = str(e)
            continue
        if "rms_millionths" not in entry:
            entry.update(error_of(folder / "out.ply", case, whittle, known))
        print(f"   {p.name}: {entry['runs'][-1]['wall']:.2f} s", flush=True)


def median_run(runs):
    keys = [k for k in runs[0] if all(r[k] is not None for r in runs)]
    return {k: statistics.median(r[k] for r in runs) for k in keys}


def summarise(case):
    """Medians, and the median of each round's ratio to the reference."""
    reference = case["programs"].get(REFERENCE, {}).get("runs", [])
    for entry in case["programs"].values():
        if not entry["runs"] or "skipped" in entry:
            continue
        entry["median"] = median_run(entry["runs"])
        ratios = [a["wall"] / b["wall"] for a, b in zip(entry["runs"], reference)]
        if ratios:
            entry["to_reference"] = statistics.median(ratios)


def run(case, programs, whittle, results, options):
    """All programs on one mesh: A B C, A B C, ..."""
    case["path"], case["faces"] = generate(case, whittle, options)
    case["target"] = round(case["faces"] * float(case["ratio"].rstrip("%")) / 100)
    print(f"== {case['shape']}, {case['faces']} faces to {case['ratio']}", flush=True)
    for p in programs:
        entry = case["programs"][p.name] = {"runs": []}
        reason = reason_to_skip(p, case, results["cases"], options.cap)
        if reason:
            entry["skipped"] = reason
    read_into_cache(case["path"])
    with tempfile.TemporaryDirectory(dir=options.work) as folder, display.for_programs(programs):
        known = {}
        for _ in range(options.rounds):
            one_round(case, programs, whittle, pathlib.Path(folder), known, options)
    summarise(case)
    del case["path"]
    results["programs"].update({p.name: p.described() for p in programs})
