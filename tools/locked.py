#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""locked.py GROUP: the part of tools/requirements.lock that a dependency group of pyproject.toml needs, as any pip reads it.

Older pips know no dependency groups, and no pip installs a part of a file with hashes. The lock's comments say what needs a package:
the group itself, or another package.
"""

import pathlib
import re
import sys

LOCK = pathlib.Path(__file__).resolve().parent / "requirements.lock"


def part_of(text, group):
    entries = {entry[1]: entry[0] for entry in re.finditer(r"^([\w.-]+)==.*\n(?: .*\n)*", text, re.MULTILINE)}
    needed_by = {name: set(re.findall(r"^ +# (?:via|  ) ?(\S.*)$", entry, re.MULTILINE)) for name, entry in entries.items()}
    found, new = set(), {f"stemvo (pyproject.toml:{group})"}
    while new:
        found |= new
        new = {name for name, others in needed_by.items() if others & found} - found
    return "".join(entry for name, entry in entries.items() if name in found)


if __name__ == "__main__":
    sys.stdout.write(part_of(LOCK.read_text(encoding="utf-8"), sys.argv[1]))
