#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Runs the whole program and what it is compared with, in turn (A B C, B C A, ..), and prints medians and ratios.

    bench/run.py [SEQUENCE] [--frames A:B] [--rounds N] [--json FILE] [--add NAME=PROGRAM] [--only NAME,..] [--without NAME,..]

SEQUENCE is a KITTI folder; without one a drive is rendered. Every row is a whole process, from its start to its end, on the
same cores (--cores, 2). A ratio is taken within a round, where the machine was the same for both. The rows (rows.py):

    defaults      stemvo run
    full stem     the same with all 256 filters of a ConvNeXt-XLarge-shaped stem (random weights) for filter 10
    folded stem   the same filter folded into a network of its own
    gray          gray image instead of a stem
    opencv orb    bench/peers/orb_brute_force.py: ORB, brute force, essential matrix in Python (`tools/setup.sh peers`)

--add runs another build of the program with the defaults, e.g. one from before a change. Standard library only.
"""

import argparse
import json
import os
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile

import machine
import places
import results
import rows
import sequence
import table
from places import BenchError
from rounds import Contest


def addition(text):
    name, equals, path = text.partition("=")
    if not (name and equals and path):
        raise argparse.ArgumentTypeError(f"expected NAME=PROGRAM, found {text!r}")
    return name, path


def names(text):
    return [name for name in text.split(",") if name]


def positive(text):
    if int(text) < 1:
        raise argparse.ArgumentTypeError(f"expected 1 or more, found {text}")
    return int(text)


def frames(text):
    if not re.fullmatch(r"[0-9]+:[0-9]*|:[0-9]+", text):
        raise argparse.ArgumentTypeError(f"expected A:B, A: or :B with whole numbers, found {text!r}")
    return text


def parse_arguments(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequence", nargs="?", type=pathlib.Path, help="KITTI folder; default: a rendered drive")
    parser.add_argument("--frames", metavar="A:B", type=frames, help="frames A to B-1 only")
    parser.add_argument("--rounds", type=positive, default=5)
    parser.add_argument("--cores", type=positive, default=2, help="default: 2")
    parser.add_argument("--program", type=pathlib.Path, default=places.PROGRAM)
    parser.add_argument("--add", metavar="NAME=PROGRAM", type=addition, action="append", default=[])
    parser.add_argument("--only", metavar="NAME,..", type=names, default=[])
    parser.add_argument("--without", metavar="NAME,..", type=names, default=[])
    parser.add_argument("--json", metavar="FILE", type=pathlib.Path)
    return parser.parse_args(arguments)


def check_writable(file):
    """Raises BenchError where the file could not be written; leaves what is there as it is."""
    existed = file.exists()
    try:
        with open(file, "ab"):
            pass
        if not existed:
            file.unlink()
    except OSError as error:
        raise BenchError(f"{file}: expected a file that can be written, found: {error.strerror}") from error


def bench(options):
    load = os.getloadavg()[0]
    chosen = rows.chosen(options)
    if options.json:
        check_writable(options.json)
    if options.sequence:
        sequence.check_folder(options.sequence)
    places.WORK.mkdir(parents=True, exist_ok=True)
    if any("{stems}" in setting for row in chosen for setting in row.settings):
        subprocess.run([places.LAB_PYTHON, places.ROOT / "bench/random_stems.py", places.WORK / "stems"], check=True)
    folder = options.sequence or sequence.rendered_drive(options.program)
    with tempfile.TemporaryDirectory(dir=places.WORK) as scratch:
        contest = Contest(options, chosen, folder, pathlib.Path(scratch))
        facts = machine.facts(options, chosen, folder, contest.cores, load)
        contest.run()
        found = results.of_rows(contest)
    print(table.page(facts, found))
    if options.json:
        options.json.write_text(json.dumps(facts | {"rows": found}, indent=2) + "\n", encoding="utf-8")


def main(arguments=None):
    try:
        bench(parse_arguments(arguments))
    except (BenchError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except subprocess.CalledProcessError as error:
        print(f"error: {shlex.join(map(str, error.cmd))}: exit code {error.returncode}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
