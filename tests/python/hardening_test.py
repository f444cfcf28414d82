# SPDX-License-Identifier: MIT
"""The program and its module as they are built: position independent, read-only after relocation, stack and buffers guarded."""

import json
import os
import pathlib
import re
import subprocess

PROGRAM = pathlib.Path(os.environ["STEMVO_PROGRAM"])
MODULE = PROGRAM.parent / "libstemvo_video.so"
MARKERS = PROGRAM.parent / "libstemvo_markers.so"
COMMANDS = PROGRAM.parent / "compile_commands.json"


def readelf(option, binary=PROGRAM):
    return subprocess.run(["readelf", option, "--wide", binary], check=True, capture_output=True, text=True).stdout


class TestProgram:
    def test_is_position_independent(self):
        assert "DYN (Position-Independent Executable file)" in readelf("--file-header")

    def test_is_read_only_once_it_is_relocated(self):
        for binary in (PROGRAM, MODULE, MARKERS):
            assert "GNU_RELRO" in readelf("--program-headers", binary) and re.search(r"FLAGS\)\s+BIND_NOW", readelf("--dynamic", binary))

    def test_no_stack_is_executable(self):
        for binary in (PROGRAM, MODULE, MARKERS):
            stack = next(line for line in readelf("--program-headers", binary).splitlines() if "GNU_STACK" in line)
            assert "E" not in stack.split("GNU_STACK")[1]

    def test_starts_without_what_only_videos_need(self):
        assert "videoio" not in readelf("--dynamic") and "videoio" in readelf("--dynamic", MODULE)

    def test_what_only_markers_need_is_no_dependency(self):
        for binary in (PROGRAM, MARKERS):
            assert not re.search("aruco|objdetect", readelf("--dynamic", binary))

    def test_stack_and_buffers_are_guarded(self):
        symbols = readelf("--dyn-syms")
        assert "__stack_chk_fail" in symbols and re.search(r"__\w+_chk@", symbols)

    def test_every_source_is_compiled_with_the_third_level_of_fortify(self):
        """The program itself looks the same with the first."""
        for source in json.loads(COMMANDS.read_text()):
            flags = [word for word in source["command"].split() if "_FORTIFY_SOURCE" in word]
            assert flags[-1:] == ["-D_FORTIFY_SOURCE=3"], source["file"]
