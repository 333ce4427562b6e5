"""A virtual display for programs that want one, so that none of their time goes into starting it."""
import contextlib
import os
import subprocess


@contextlib.contextmanager
def for_programs(programs):
    """DISPLAY is set inside, when MeshLab is among the programs and there is none."""
    if os.environ.get("DISPLAY") or not any(p.name == "MeshLab" for p in programs):
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
