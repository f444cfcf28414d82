# SPDX-License-Identifier: MIT
"""stemvo-lab: each command is there, and what is named is imported alone."""

import subprocess
import sys

import pytest
from click.testing import CliRunner
from stemvo.lab import runs
from stemvo.lab.cli import COMMANDS, main


def test_each_command_has_help():
    listed = CliRunner().invoke(main, ["--help"])
    assert listed.exit_code == 0
    for name in COMMANDS:
        assert f"\n  {name} " in listed.output
        help_text = CliRunner().invoke(main, [name, "--help"])
        assert help_text.exit_code == 0 and len(help_text.output) > 200, name


def test_help_imports_no_command():
    script = "import sys, stemvo.lab.cli as cli; cli.main(['--help'], standalone_mode=False); print([m for m in sys.modules if m in ('ray', 'pandas', 'matplotlib', 'cv2')])"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_only_results_of_the_same_command_are_replaced(tmp_path):
    out, given = tmp_path / "out", tmp_path / "truth.txt"
    given.write_text("1 0 0 0 0 1 0 0 0 0 1 0\n")
    for _ in range(2):
        runs.open_folder(out, "compare")
    with pytest.raises(ValueError, match="results of 'stemvo-lab search', found other files"):
        runs.open_folder(out, "search")
    with pytest.raises(ValueError, match="found other files"):
        runs.open_folder(tmp_path, "compare")
    with pytest.raises(ValueError, match="can be written"):
        runs.open_folder(given / "out", "compare")
    message = CliRunner().invoke(main, ["compare", str(given), "--gt", str(given), "--out", str(tmp_path)]).output
    assert message.startswith("Error: ") and len(message.splitlines()) == 1, message
