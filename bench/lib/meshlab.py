"""MeshLab through meshlabserver, which wants a display with OpenGL."""
import os
import re
import subprocess


def version():
    got = subprocess.run(["dpkg-query", "-W", "-f", "${Version}", "meshlab"],
                         capture_output=True, text=True, check=False)
    return re.split(r"[+-]", got.stdout)[0] or "unknown"


def start(arguments):
    """The server at work. Its words come line by line, so that a clock can tell when they were said. Without
    a display in DISPLAY xvfb-run starts a virtual one."""
    words = ["stdbuf", "-oL", "meshlabserver", *arguments]
    return subprocess.Popen(words if os.environ.get("DISPLAY") else ["xvfb-run", "-a"] + words,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                            errors="replace")
