"""Plots of a folder's results.json: plots.py FOLDER."""
import json
import pathlib
import sys

STYLES = {  # colour and marker, by the beginning of a program's name
    "whittle --fast": ("#ff7f0e", "D"),
    "whittle": ("#d62728", "o"),
    "meshoptimizer, slabs": ("#17becf", "s"),
    "meshoptimizer": ("#1f77b4", "s"),
    "OpenMesh": ("#9467bd", "^"),
    "VTK": ("#2ca02c", "v"),
    "MeshLab": ("#bcbd22", "P"),
    "CGAL, L": ("#000000", "<"),
    "CGAL, G": ("#7f7f7f", ">"),
    "GTS": ("#8c564b", "X"),
}


def style(name):
    color, marker = next(v for k, v in STYLES.items() if name.startswith(k))
    several = "threads" in name
    return {"color": color, "marker": marker, "markersize": 5,
            "linestyle": "-" if not several else "--", "label": name}


def distinct(cases, key):
    return list(dict.fromkeys(c[key] for c in cases))


def series(cases, x, y):
    """Per program its points, where it ran."""
    lines = {}
    for c in cases:
        for name, entry in c["programs"].items():
            if "median" in entry:
                lines.setdefault(name, []).append((x(c, entry), y(c, entry)))
    return {name: sorted(points) for name, points in lines.items()}


def figure(plt, cases, columns, x, y, labels, path):
    """A panel for each shape and each value of the case's key `columns`."""
    shapes, values = distinct(cases, "shape"), distinct(cases, columns)
    fig, axes = plt.subplots(len(shapes), len(values), squeeze=False,
                             figsize=(4.5 * len(values) + 2.5, 3.8 * len(shapes)))
    lines = {}
    for i, shape in enumerate(shapes):
        for j, value in enumerate(values):
            ax = axes[i][j]
            here = [c for c in cases if c["shape"] == shape and c[columns] == value]
            for name, points in series(here, x, y).items():
                lines[name], = ax.plot(*zip(*points), **style(name))
            ax.set(xscale="log", yscale="log", xlabel=labels[0], ylabel=labels[1],
                   title=f"{shape}, {'to ' if columns == 'ratio' else ''}{value}")
            ax.grid(True, which="both", alpha=0.2)
    fig.legend(lines.values(), lines.keys(), loc="center right", fontsize="small")
    fig.tight_layout(rect=(0, 0, 1 - 2.2 / fig.get_figwidth(), 1))
    for suffix in (".png", ".svg"):
        fig.savefig(path.with_suffix(suffix))
    plt.close(fig)


def main(folder):
    try:
        import matplotlib
    except ImportError:
        print("no plots: python3-matplotlib is missing (tools/packages.sh bench)")
        return
    matplotlib.use("Agg")
    from matplotlib import pyplot
    cases = json.loads((folder / "results.json").read_text())["cases"]
    faces = lambda c, e: c["faces"]
    figure(pyplot, cases, "ratio", faces, lambda c, e: c["faces"] / e["median"]["wall"] / 1e6,
           ("faces of the input", "M faces a second"), folder / "throughput")
    figure(pyplot, cases, "ratio", faces, lambda c, e: e["median"]["peak_rss_kib"] / 1024,
           ("faces of the input", "peak memory, MiB"), folder / "memory")
    figure(pyplot, cases, "size", lambda c, e: e["median"]["faces_out"],
           lambda c, e: e["rms_millionths"],
           ("faces left", "RMS, millionths of the diagonal"), folder / "error")


main(pathlib.Path(sys.argv[1]))
