# SPDX-License-Identifier: MIT
"""Where the benchmark's programs and files are, and its error."""

import pathlib

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = ROOT / "build/release/stemvo"
PEER = ROOT / "bench/peers/orb_brute_force.py"
LAB_PYTHON = ROOT / "build/lab/bin/python"
PEER_PYTHON = ROOT / "build/venv-peers/bin/python"
WORK = ROOT / "build/bench-run"


class BenchError(Exception):
    """Ends the benchmark with its message."""
