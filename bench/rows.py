# SPDX-License-Identifier: MIT
"""The rows that are compared, and which of them were asked for."""

import dataclasses
import os
import pathlib

import places
from places import BenchError


@dataclasses.dataclass(frozen=True)
class Row:
    name: str
    settings: tuple = ()  # of --set; {stems} stands for the folder of random stems
    program: pathlib.Path | None = None  # another build
    is_peer: bool = False


ROWS = (
    Row("defaults"),
    Row("full stem", ("stem.model={stems}/full.onnx", "stem.filter=10")),
    Row("folded stem", ("stem.model={stems}/folded.onnx",)),
    Row("gray", ("stem.model=gray",)),
    Row("opencv orb", is_peer=True),
)


def chosen(options):
    """The rows asked for, the defaults first; a row that cannot run here is an error."""
    rows = [*ROWS[:1], *(Row(name, program=pathlib.Path(path)) for name, path in options.add), *ROWS[1:]]
    known = [row.name for row in rows]
    for name in [*options.only, *options.without]:
        if name not in known:
            raise BenchError(f"expected a row of {', '.join(known)}, found {name!r}")
    rows = [row for row in rows if (row.name in options.only or not options.only) and row.name not in options.without]
    if not rows:
        raise BenchError("no row is left")
    for row in rows:
        needed = row.program or (places.PEER_PYTHON if row.is_peer else options.program)
        if not os.access(needed, os.X_OK):
            hint = f"run `tools/setup.sh peers`, or give --without {row.name!r}" if row.is_peer else "run `make build`"
            raise BenchError(f"{needed}: expected a program for the row {row.name!r}, found none ({hint})")
    return rows
