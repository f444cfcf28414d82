# SPDX-License-Identifier: MIT
"""Importing this module first puts a tool into the Python environment build/venv.

Under any other Python it starts the same command again in there, so `python3 tools/x.py` works with
whatever python3 there is. Must therefore run on old interpreters and import nothing but the standard
library.
"""

import os
import sys

_VENV = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "build", "venv")
_TRIED = "STEMVO_ENVIRONMENT_ENTERED"


def _enter():
    already_tried = os.environ.pop(_TRIED, None) is not None
    if os.path.realpath(sys.prefix) == os.path.realpath(_VENV):
        return
    python = os.path.join(_VENV, "bin", "python")
    # The stamp is written last: without it the environment is missing or half made.
    if already_tried or not os.path.isfile(os.path.join(_VENV, "stamp")) or not os.access(python, os.X_OK):
        sys.exit("run `tools/setup.sh tools` first: it makes the Python environment build/venv")
    os.environ[_TRIED] = "1"
    sys.stdout.flush()
    # orig_argv keeps the interpreter's own arguments, -m among them.
    arguments = getattr(sys, "orig_argv", [sys.executable] + sys.argv)[1:]
    os.execv(python, [python] + arguments)


_enter()
