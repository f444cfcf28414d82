#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""`stemvo search --exhaustive` on a Ray cluster: cut into tasks, run on all nodes, merged.

The table is that of one machine, byte for byte, also where workers are lost: their tasks are run again.
Without --address this machine alone is the cluster; `--address auto` is the cluster that this machine joined with
`ray start`. Each node needs Ray and the program (the same build), and the sequences at the same path; the models are
sent along, the parts come back over Ray. docs/search.md tells more.
"""

import argparse
import hashlib
import os
import pathlib
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
_RAY_PYTHON = ROOT / "build" / "venv-ray" / "bin" / "python"


def _enter_ray():
    """Any Python that has Ray will do (a cluster's own); else the one that `make cluster` made."""
    try:
        import ray  # noqa: F401
    except ImportError:
        if pathlib.Path(sys.prefix).resolve() == _RAY_PYTHON.parent.parent.resolve() or not os.access(_RAY_PYTHON, os.X_OK):
            sys.exit("error: expected the Python package ray, found none: run `make cluster`, or pip install ray")
        os.execv(_RAY_PYTHON, [str(_RAY_PYTHON), *sys.orig_argv[1:]])


os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # Ray would report its use over the network
_enter_ray()

from cluster import driver, plan  # noqa: E402
from cluster.parts import Parts  # noqa: E402
from cluster.plan import ClusterError  # noqa: E402


def parse_range(text):
    match = re.fullmatch(r"(\d{1,6}):(\d{1,6})", text)
    if not match or int(match[1]) >= int(match[2]):
        raise argparse.ArgumentTypeError(f"expected A:B with A < B, found {text!r}")
    return int(match[1]), int(match[2])


def positive(text):
    if not re.fullmatch(r"[1-9]\d{0,5}", text):
        raise argparse.ArgumentTypeError(f"expected a whole number >= 1, found {text!r}")
    return int(text)


def parse_arguments(arguments):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sequences", metavar="SEQUENCE_DIR", nargs="+", type=pathlib.Path)
    parser.add_argument("--out", metavar="DIR", type=pathlib.Path, required=True)
    parser.add_argument("--model", action="append", dest="models", help="name or path of an .onnx; may be repeated (default: default)")
    parser.add_argument("--filters", type=parse_range, metavar="A:B", help="of each model (default: all)")
    parser.add_argument("--frames", type=parse_range, metavar="A:B", help="of each sequence")
    parser.add_argument("--held-out", type=pathlib.Path, metavar="DIR", help="a sequence that is reported, not ranked by")
    parser.add_argument("--held-out-frames", type=parse_range, metavar="A:B")
    parser.add_argument("--no-baselines", action="store_true", help="as of stemvo search: only the models' filters")
    parser.add_argument("--config", metavar="FILE", help="as of stemvo search: a file, at the same path on each node, or the name of one that "
                        "comes with stemvo, such as default")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="as of stemvo search")
    parser.add_argument("--address", help="of a Ray cluster, or auto (default: this machine alone)")
    parser.add_argument("--filters-per-task", type=positive, default=32, metavar="N", help="what a lost worker may lose (default: %(default)s)")
    parser.add_argument("--threads", type=positive, default=1, metavar="N", help="processors of a task (default: %(default)s)")
    parser.add_argument("--retries", type=int, default=3, metavar="N", help="of a task whose worker is lost (default: %(default)s)")
    parser.add_argument("--patience", type=float, default=120.0, metavar="S", help="seconds without any node before giving up (default: %(default)s)")
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "build/release/stemvo", help="on each node (default: %(default)s)")
    parser.add_argument("--resume", action="store_true", help="go on with the search in --out")
    parser.add_argument("--quiet", action="store_true", help="no progress")
    return parser.parse_args(arguments)


def find_config(given):
    """The file, and the word for the program, which finds what comes with it by itself; as apps/options.cpp does."""
    if given is None:
        return None, None
    file = pathlib.Path(given)
    if file.exists() or len(file.parts) > 1:
        if not file.is_file():
            raise ClusterError(f"--config: expected a file, found {'a folder' if file.is_dir() else 'nothing'} at {given}")
        return file, str(file.resolve())
    folder = ROOT / "config"
    shipped = next((folder / name for name in (given, given + ".yaml") if (folder / name).is_file()), None)
    if shipped is None:
        raise ClusterError(f"--config: expected a file or one of {', '.join(sorted(path.stem for path in folder.glob('*.yaml')))}, found '{given}'")
    return shipped, given


def common_arguments(options):
    """Of every task. Paths are absolute: a task runs in another folder, maybe on another machine."""
    words = [str(path.resolve()) for path in options.sequences]
    for name, value in (("--frames", options.frames), ("--held-out", options.held_out), ("--held-out-frames", options.held_out_frames),
                        ("--config", find_config(options.config)[1])):
        if value is not None:
            words += [name, f"{value[0]}:{value[1]}" if isinstance(value, tuple) else value if isinstance(value, str) else str(value.resolve())]
    for value in options.set:
        words += ["--set", value]
    return words


def model_files(models):
    """The .onnx of models given by path."""
    found = {}
    for model in models:
        if model.endswith(".onnx"):
            file = pathlib.Path(model)
            found[model] = {file.name: file.read_bytes()}
    return found


def inputs_of(options):
    """Hashes of the program and the configuration, and what tells whether a sequence has changed."""
    config, _ = find_config(options.config)
    files = [options.program] + ([config] if config else [])
    sequences = options.sequences + ([options.held_out] if options.held_out else [])
    return [[hash_of(file.read_bytes()) for file in files], [plan.sequence_contents(sequence) for sequence in sequences]]


def merge(options, parts, tasks, warned):
    """OUT/result, made anew: it holds nothing that the parts do not. warned: lines that were said already."""
    partial, result = options.out / ".result.partial", options.out / "result"
    shutil.rmtree(partial, ignore_errors=True)
    command = [options.program, "search", "--merge", *(parts.path(task) for task in tasks), "--out", partial]
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise ClusterError(" ".join(done.stderr.removeprefix("error: ").split()) or f"{options.program} search --merge failed")
    for line in done.stderr.splitlines():
        if line.strip() and line not in warned:
            print(line, file=sys.stderr)
    if not options.quiet:
        print(done.stdout.rpartition("table: ")[0], end="")
    shutil.rmtree(result, ignore_errors=True)
    partial.rename(result)


def search(options):
    models = options.models or ["default"]
    if not os.access(options.program, os.X_OK):
        raise ClusterError(f"--program: expected the program stemvo (make build), found none at {options.program}")
    models_dir = ROOT / "models"
    num_sequences = len(options.sequences) + (1 if options.held_out else 0)
    tasks = plan.tasks_of(models, models_dir, options.filters, options.filters_per_task, num_sequences, not options.no_baselines)
    common = common_arguments(options)
    files = model_files(models)
    contents = [[name, len(content), hash_of(content)] for model in sorted(files) for name, content in sorted(files[model].items())]
    parts = Parts(options.out, tasks, plan.fingerprint(tasks, [common, contents, inputs_of(options)]), options.resume)
    waiting = [task for task in tasks if not parts.is_done(task)]
    outcome = driver.Outcome()
    if waiting:
        driver.connect(options.address)
        parts.begin()
        outcome = driver.run(waiting, driver.Options(str(options.program.resolve()), common, files, options.threads, options.retries,
                                                     options.patience, options.quiet), parts.keep)
    merge(options, parts, tasks, outcome.warnings)
    print(f"tasks: {outcome.tasks} run on {len(outcome.nodes)} nodes in {outcome.seconds:.1f} s, {outcome.repeated} repeated, "
          f"{len(tasks) - len(waiting)} from before\ntable: {options.out / 'result' / 'filters.csv'}")


def hash_of(content):
    return hashlib.sha256(content).hexdigest()


def main(arguments=None):
    options = parse_arguments(arguments)
    try:
        search(options)
    except ClusterError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except OSError as error:
        print(f"error: {error.filename}: {error.strerror}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("interrupted; what is done is kept, --resume goes on from there", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
