# SPDX-License-Identifier: MIT
"""stemvo-lab: each command is there, and what is named is imported alone."""

import subprocess
import sys

from click.testing import CliRunner
from stemvo.lab.cli import COMMANDS, main


def test_each_command_has_help():
    listed = CliRunner().invoke(main, ["--help"])
    assert listed.exit_code == 0
    for name in COMMANDS:
        assert f"\n  {name} " in listed.output
        help_text = CliRunner().invoke(main, [name, "--help"])
        assert help_text.exit_code == 0 and len(help_text.output) > 200, name


def test_an_unknown_command_is_an_error():
    answer = CliRunner().invoke(main, ["serch"])
    assert answer.exit_code == 2 and "serch" in answer.output


def test_help_imports_no_command():
    script = "import sys, stemvo.lab.cli as cli; cli.main(['--help'], standalone_mode=False); print([m for m in sys.modules if m in ('ray', 'pandas', 'matplotlib', 'cv2')])"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
