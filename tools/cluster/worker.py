# SPDX-License-Identifier: MIT
"""Runs one task where Ray puts it. Nothing but the standard library: this is sent to the nodes by value."""

import ctypes
import pathlib
import signal
import subprocess
import tempfile

# Files of a part; the rest of a search's folder is made again by the merge.
PART_FILES = ("records.jsonl",)


class TaskFailed(Exception):
    """The program said no: it would say it again."""


def _die_with_parent():
    ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG: a killed worker leaves no search behind


def run_task(program, arguments, model_files, threads):
    """`stemvo search ARGUMENTS` -> the files of its folder: name -> bytes, and the lines of its warnings. model_files: name -> bytes of an .onnx,
    written to a folder of this node, which {folder} stands for in arguments and in what comes back."""
    with tempfile.TemporaryDirectory(prefix="stemvo_search_") as text:
        folder = pathlib.Path(text)
        for name, content in model_files.items():
            (folder / name).write_bytes(content)
        words = [word.replace("{folder}", text) for word in arguments]
        command = [program, "search", *words, "--threads", str(threads), "--out", text + "/part", "--quiet"]
        try:
            done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False, preexec_fn=_die_with_parent)
        except OSError as error:
            raise TaskFailed(f"{program}: expected the program here too, found: {error.strerror}") from error
        if done.returncode < 0:
            raise RuntimeError(f"{program} was killed by signal {-done.returncode}")
        if done.returncode != 0:
            raise TaskFailed(" ".join(done.stderr.split()) or f"{program} ended with exit code {done.returncode}")
        said = [line.replace(text, "{folder}") for line in done.stderr.splitlines() if line.strip()]
        return {name: (folder / "part" / name).read_bytes().replace(text.encode(), b"{folder}") for name in PART_FILES}, said
