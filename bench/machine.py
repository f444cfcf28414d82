# SPDX-License-Identifier: MIT
"""Describes the machine of the benchmark, and whether other programs ran there too."""

import os
import pathlib
import platform
import subprocess
import time

import places

BUSY_LOAD_PER_CORE = 0.5


def output(command):
    """The text that a command prints; None where it does not run."""
    try:
        return subprocess.run(command, capture_output=True, text=True, check=True, cwd=places.ROOT).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return None


def is_busy(load, cores):
    """Whether wall times under this load average are no quiet machine's."""
    return load > BUSY_LOAD_PER_CORE * len(cores)


def facts(options, rows, sequence, cores, load):
    """`load`: the average of the last minute, taken before the benchmark itself did anything."""
    cpu = [line.partition(":")[2].strip() for line in pathlib.Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
           if line.startswith("model name")]
    found = {
        "date": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "machine": f"{cpu[0] if cpu else platform.machine()}, cores {','.join(map(str, cores))} of {os.cpu_count()}, {platform.platform()}",
        "load_before": load,
        "busy": is_busy(load, cores),
        "commit": output(["git", "describe", "--always", "--dirty"]),
        "stemvo": output([options.program, "--version"]),
        "sequence": f"{sequence}{' ' + options.frames if options.frames else ''}",
        "rounds": options.rounds,
    }
    if any(row.is_peer for row in rows):
        found["opencv_python"] = output([places.PEER_PYTHON, "-c", "import cv2; print(cv2.__version__)"])
    return found
