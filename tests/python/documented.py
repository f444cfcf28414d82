# SPDX-License-Identifier: MIT
"""The fenced blocks of the pages that the site is made of (tools/docs.sh)."""

import dataclasses
import pathlib
import re

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGES = [*(ROOT / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "examples/README.md", "tools/docs/api.md")),
         *sorted((ROOT / "docs").rglob("*.md"))]
FENCED = re.compile(r"^ *```([^\n]*)\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)


@dataclasses.dataclass
class Block:
    place: str  # "README.md:13"
    language: str  # as it is written: none is the shell's
    text: str


def blocks(language=None):
    found = []
    for page in PAGES:
        text = page.read_text()
        for match in FENCED.finditer(text):
            line = text.count("\n", 0, match.start()) + 1
            found.append(Block(f"{page.relative_to(ROOT)}:{line}", match[1].strip(), match[2]))
    return [block for block in found if language is None or block.language == language]
