# SPDX-License-Identifier: MIT
"""The program as it is built: position independent, read-only after relocation, stack and buffers guarded."""

import os
import subprocess
import unittest

PROGRAM = os.environ["STEMVO_PROGRAM"]


def readelf(option):
    return subprocess.run(["readelf", option, "--wide", PROGRAM], check=True, capture_output=True, text=True).stdout


class Program(unittest.TestCase):
    def test_is_position_independent(self):
        self.assertIn("DYN (Position-Independent Executable file)", readelf("--file-header"))

    def test_is_read_only_once_it_is_relocated(self):
        self.assertIn("GNU_RELRO", readelf("--program-headers"))
        self.assertRegex(readelf("--dynamic"), r"FLAGS\)\s+BIND_NOW")

    def test_no_stack_is_executable(self):
        stack = next(line for line in readelf("--program-headers").splitlines() if "GNU_STACK" in line)
        self.assertNotIn("E", stack.split("GNU_STACK")[1])

    def test_stack_and_buffers_are_guarded(self):
        symbols = readelf("--dyn-syms")
        self.assertIn("__stack_chk_fail", symbols)
        self.assertRegex(symbols, r"__\w+_chk@")


if __name__ == "__main__":
    unittest.main()
