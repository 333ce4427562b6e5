"""A virtual display for programs that want one, so that none of their time goes into starting it."""
import contextlib
import os
import subprocess


@contextlib.contextmanager
def virtual():
    """DISPLAY is set inside: to a server of our own where there is none."""
    if os.environ.get("DISPLAY"):
        yield
        return
    server = subprocess.Popen(["Xvfb", "-displayfd", "1", "-screen", "0", "640x480x24"],
                              stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        os.environ["DISPLAY"] = ":" + server.stdout.readline().strip()
        yield
    finally:
        del os.environ["DISPLAY"]
        server.terminate()
        server.wait()


def for_programs(programs):
    """The same where MeshLab is among the programs, else nothing."""
    return virtual() if any(p.name == "MeshLab" for p in programs) else contextlib.nullcontext()
