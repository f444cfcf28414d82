# SPDX-License-Identifier: MIT
"""The program and its module as they are built: position independent, read-only after relocation, stack and buffers guarded."""

import json
import os
import pathlib
import re
import subprocess

import pytest

PROGRAM = pathlib.Path(os.environ["STEMVO_PROGRAM"])
MODULE = PROGRAM.parent / "libstemvo_video.so"
MARKERS = PROGRAM.parent / "libstemvo_markers.so"
COMMANDS = PROGRAM.parent / "compile_commands.json"


def readelf(option, binary=PROGRAM):
    return subprocess.run(["readelf", option, "--wide", binary], check=True, capture_output=True, text=True).stdout


def test_the_program_is_position_independent():
    assert "DYN (Position-Independent Executable file)" in readelf("--file-header")


@pytest.mark.parametrize("binary", [PROGRAM, MODULE, MARKERS])
def test_what_is_relocated_is_read_only_and_no_stack_executable(binary):
    headers = readelf("--program-headers", binary)
    assert "GNU_RELRO" in headers and re.search(r"FLAGS\)\s+BIND_NOW", readelf("--dynamic", binary))
    assert "E" not in next(line for line in headers.splitlines() if "GNU_STACK" in line).split("GNU_STACK")[1]


def test_what_only_videos_and_markers_need_is_no_dependency():
    assert "videoio" not in readelf("--dynamic") and "videoio" in readelf("--dynamic", MODULE)
    assert not any(re.search("aruco|objdetect", readelf("--dynamic", binary)) for binary in (PROGRAM, MARKERS))


def test_stack_and_buffers_are_guarded():
    """The program itself looks the same with the first level of fortify: every source is compiled with the third."""
    symbols = readelf("--dyn-syms")
    assert "__stack_chk_fail" in symbols and re.search(r"__\w+_chk@", symbols)
    for source in json.loads(COMMANDS.read_text()):
        flags = [word for word in source["command"].split() if "_FORTIFY_SOURCE" in word]
        assert flags[-1:] == ["-D_FORTIFY_SOURCE=3"], source["file"]
