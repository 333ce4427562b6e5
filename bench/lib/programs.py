"""The programs that are compared: one line in PEERS for each, and whittle in its variants."""
import dataclasses
import pathlib
import shutil
import subprocess

PEERS_SOURCE = pathlib.Path(__file__).resolve().parent.parent / "peers"

# The program that the others' times are divided by.
REFERENCE = "meshoptimizer"


@dataclasses.dataclass
class Program:
    name: str
    command: list  # in front of IN and OUT
    options: list  # after the number of faces
    package: str = ""  # of Debian, that it needs
    cheap: bool = True  # runs with --quick
    limit: float = float("inf")  # faces of the largest mesh that it is given
    threads: int = 1
    missing: bool = False
    is_whittle: bool = False
    library: str = ""  # these two it says of itself
    version: str = ""

    def argv(self, source, target, faces, phases):
        if not self.is_whittle:
            return self.command + [source, target, str(faces)] + self.options
        return self.command + ["reduce", "-q", "-f", source, "-o", target, "--faces", str(faces),
                               "--report", phases] + self.options

    def described(self):
        keys = ("library", "version", "package", "threads", "missing")
        return {k: getattr(self, k) for k in keys}


def peers(threads):
    """Limits are of memory and patience: GTS has a kilobyte of objects for a face."""
    many = str(max(threads))
    return [
        Program(REFERENCE, ["meshopt_simplify"], [], "libmeshoptimizer-dev"),
        Program("meshoptimizer, slabs", ["meshopt_slabs"], [many], "libmeshoptimizer-dev",
                threads=max(threads)),
        Program("OpenMesh", ["openmesh_simplify"], [], "libopenmesh-dev"),
        Program("VTK", ["vtk_simplify"], [], "libvtk9-dev"),
        Program("MeshLab", ["meshlab_simplify"], [], "meshlab"),
        Program("CGAL, Lindstrom-Turk", ["cgal_simplify"], ["lt"], "libcgal-dev", cheap=False),
        Program("CGAL, Garland-Heckbert", ["cgal_simplify"], ["gh"], "libcgal-dev", cheap=False),
        Program("GTS", ["gts_simplify"], [], "libgts-dev", cheap=False, limit=4.5e6),
    ]


def has_fast(whittle):
    text = subprocess.run([whittle, "reduce", "--help"], capture_output=True, text=True, check=False)
    return "--fast" in text.stdout + text.stderr


def whittles(whittle, threads):
    made = []
    for label, options in [("whittle", [])] + [("whittle --fast", ["--fast"])] * has_fast(whittle):
        for n in threads:
            made.append(Program(f"{label}, {n} thread{'s' * (n > 1)}", [str(whittle)],
                                ["--threads", str(n)] + options, threads=n, is_whittle=True,
                                library="whittle", version=version_of(whittle)))
    return made


def version_of(whittle):
    text = subprocess.run([whittle, "--version"], capture_output=True, text=True, check=True).stdout
    return text.split()[-1]


def locate(program, folder):
    """Fills in where a peer's program is, or that it is missing."""
    name = program.command[0]
    if name == "meshlab_simplify":
        program.command = [str(PEERS_SOURCE / name)]
        program.missing = not shutil.which("meshlabserver") or not shutil.which("Xvfb")
    else:
        program.command = [str(folder / name)]
        program.missing = not (folder / name).exists()
    if program.missing:
        print(f"{program.name} is missing: install {program.package} (tools/packages.sh bench)")


def find(whittle, options):
    """Those asked for; peers that are missing say so."""
    threads = [int(n) for n in options.threads.split(",")]
    chosen = whittles(whittle, threads) + peers(threads)
    if options.quick:
        chosen = [p for p in chosen if p.cheap]
    if options.only:
        texts = options.only.split(",")
        chosen = [p for p in chosen if any(t in p.name for t in texts)]
    for p in chosen:
        if not p.is_whittle:
            locate(p, options.work / "peers")
    return chosen
