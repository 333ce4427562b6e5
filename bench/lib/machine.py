"""What the figures were measured on and with."""
import datetime
import os
import platform
import re
import subprocess


def first_line(*command):
    try:
        text = subprocess.run(command, capture_output=True, text=True, check=False).stdout
    except OSError:
        return "unknown"
    return text.splitlines()[0].strip() if text.strip() else "unknown"


def field(path, name):
    with open(path, encoding="ascii", errors="replace") as f:
        for line in f:
            key, _, value = line.partition(":")
            if key.strip() == name:
                return value.strip()
    return ""


def simd():
    """The widest instructions that valgrind and this processor both have."""
    return "avx2" if "avx2" in field("/proc/cpuinfo", "flags").split() else "none"


def compiler_of(program):
    """As the compiler signs its objects; clang's programs hold start-up code of gcc too."""
    with open(program, "rb") as f:
        found = re.findall(rb"(?:Debian |Ubuntu )?clang version [\w.~+-]+|GCC: \([^)]*\) [\w.]+", f.read())
    names = sorted(x.decode() for x in set(found))
    clang = [n for n in names if "clang" in n]
    return (clang or names or ["unknown"])[0]


def commit(root):
    return first_line("git", "-C", str(root), "describe", "--always", "--dirty", "--abbrev=12",
                      "--exclude=*")


def describe(whittle, root):
    memory = int(field("/proc/meminfo", "MemTotal").split()[0]) / 2**20
    return {
        "date": datetime.date.today().isoformat(),
        "processor": field("/proc/cpuinfo", "model name"),
        "cores": len(os.sched_getaffinity(0)),
        "memory_gib": round(memory, 1),
        "kernel": platform.release(),
        "compiler": compiler_of(whittle),
        "cxx_compiler": first_line("c++", "--version"),
        "whittle_commit": commit(root),
    }
