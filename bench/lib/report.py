"""Tables of results.json as Markdown, and plots by a program of their own."""
import json
import pathlib
import subprocess
import sys

HEAD = ["program", "wall s", "/ meshopt", "processor s", "load", "simplify", "save",
        "M faces/s", "peak MiB", "faces", "RMS", "max"]


def save(results, folder):
    part = folder / "results.json.tmp"
    part.write_text(json.dumps(results, indent=1) + "\n")
    part.rename(folder / "results.json")


def number(x, digits=3):
    """So many figures, never an exponent."""
    if x is None:
        return "-"
    text = f"{x:.{digits}g}"
    return text if "e" not in text else f"{x:.0f}"


def row(name, entry, case):
    m = entry.get("median")
    if m is None:
        return [name, entry.get("skipped", "-")] + [""] * (len(HEAD) - 2)
    return [name, number(m["wall"]), number(entry.get("to_reference")),
            number(m["user"] + m["system"]), number(m.get("load")), number(m.get("simplify")),
            number(m.get("save")), number(case["faces"] / m["wall"] / 1e6),
            number(m["peak_rss_kib"] / 1024), str(round(m["faces_out"])),
            number(entry["rms_millionths"], 4), number(entry["max_millionths"], 4)]


def table(head, rows):
    return "\n".join("| " + " | ".join(cells) + " |" for cells in [head, ["---"] * len(head), *rows])


def case_table(case, programs):
    rows = [row(n, e, case) for n, e in case["programs"].items()]
    rows += [row(n, {"skipped": f"missing: {p['package']}"}, case)
             for n, p in programs.items() if p["missing"]]
    title = f"## {case['shape']}, {case['faces']} faces to {case['ratio']}"
    return f"{title}\n\n{table(HEAD, rows)}\n"


def machine_table(results):
    rows = [[k.replace("_", " "), str(v)] for k, v in results["machine"].items()]
    return table(["machine", ""], rows) + "\n"


def program_table(programs):
    rows = [[n, "missing" if p["missing"] else f"{p['library']} {p['version']}", str(p["threads"])]
            for n, p in programs.items()]
    return table(["program", "version", "threads"], rows) + "\n"


LEGEND = """\
Medians of up to {rounds} rounds, every program once a round; files in the page cache. Wall and
processor seconds and the peak of resident memory are of the whole process; "/ meshopt" is the
median of each round's ratio to meshoptimizer's wall time. Load lasts until the program's own mesh
stands; what MeshLab simplifies in holds saving. M faces/s are of the input. RMS (the larger side)
and max are distances both ways in millionths of the bounding box's diagonal.
"""


def markdown(results):
    parts = ["# Comparison\n", machine_table(results), program_table(results["programs"]),
             LEGEND.format(**results["options"])]
    parts += [case_table(c, results["programs"]) for c in results["cases"]]
    return "\n".join(parts)


def render(folder):
    """Plots are made by another process: their library would be large in this one."""
    results = json.loads((folder / "results.json").read_text())
    (folder / "results.md").write_text(markdown(results))
    plots = pathlib.Path(__file__).with_name("plots.py")
    subprocess.run([sys.executable, str(plots), str(folder)], check=False)
