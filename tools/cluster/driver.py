# SPDX-License-Identifier: MIT
"""Gives the tasks to Ray, repeats those of lost workers, and writes the parts that come back."""

import collections
import dataclasses
import hashlib
import json
import os
import socket
import sys
import time

import ray

from cluster import worker
from cluster.plan import ClusterError


@dataclasses.dataclass
class Options:
    program: str
    common: list  # arguments of every task
    model_files: dict  # model -> files to send along (name -> bytes); none for a model of the program's own
    threads: int = 1
    retries: int = 3
    patience_s: float = 120.0
    quiet: bool = False


def with_folder(records, here):
    """The records of a part with this machine's folder in them: each line holds a hash of what is in it and in the first
    (sealed() in src/search/records.cpp)."""
    first, lines = b"", []
    for line in records.replace(b"{folder}", here).splitlines(keepends=True):
        _, found, text = line.rstrip(b"\n").partition(b'"of":')
        if found:
            text = text[:-1]
            line = b'{"sha256":"%s","of":%s}\n' % (hashlib.sha256(first + text).hexdigest().encode(), text)
            first = first or text
        lines.append(line)
    return b"".join(lines)


@dataclasses.dataclass
class Outcome:
    tasks: int = 0
    repeated: int = 0
    drives: int = 0  # filters times sequences
    nodes: set = dataclasses.field(default_factory=set)
    warnings: list = dataclasses.field(default_factory=list)  # of the program, each line once
    seconds: float = 0.0


def _arguments(task, options):
    words = task.arguments()
    for onnx in options.model_files.get(task.model, {}):
        words[1] = "{folder}/" + onnx
    return [*options.common, *words]


class _Queue:
    """Tasks waiting, running and done. No more are with Ray than its processors can take, so that little is asked
    for again when a worker is lost."""

    def __init__(self, tasks, options, keep):
        self._waiting = collections.deque(tasks)
        self._running = {}  # Ray's reference -> task
        self._tries = collections.Counter()
        self._options, self._keep = options, keep
        self._sent = {model: ray.put(files) for model, files in options.model_files.items()}
        self._remote = ray.remote(num_cpus=options.threads, max_retries=0)(_run_here)
        self._total = len(tasks)
        self._last_room = time.monotonic()
        self.outcome = Outcome()

    def run(self):
        start = time.monotonic()
        while self._waiting or self._running:
            self._submit()
            ready, _ = ray.wait(list(self._running), timeout=1.0) if self._running else (time.sleep(0.5) or [], [])
            self._collect_all(ready)
            self.outcome.seconds = time.monotonic() - start
        return self.outcome

    def _slots(self):
        return int(sum(node["Resources"].get("CPU", 0) // self._options.threads for node in ray.nodes() if node["Alive"]))

    def _submit(self):
        slots = self._slots()
        now = time.monotonic()
        if slots > 0:
            self._last_room = now
        elif now - self._last_room > self._options.patience_s:
            raise ClusterError(f"expected a node with {self._options.threads} free processors, found none for "
                               f"{self._options.patience_s:.0f} s; what is done is kept, --resume goes on")
        while self._waiting and len(self._running) < slots:
            task = self._waiting.popleft()
            arguments = _arguments(task, self._options)
            files = self._sent.get(task.model, {})
            reference = self._remote.remote(self._options.program, arguments, files, self._options.threads)
            self._running[reference] = task

    def _collect_all(self, ready):
        """Keeps every result that is there, also those beside one that ends the search."""
        errors = []
        done, _ = ray.wait(list(self._running), num_returns=len(self._running), timeout=0) if ready else ([], [])
        for reference in done:
            try:
                self._collect(reference, self._running.pop(reference))
            except ClusterError as error:
                errors.append(error)
        if errors:
            raise errors[0]

    def _collect(self, reference, task):
        try:
            node, (files, warnings) = ray.get(reference)
        except ray.exceptions.RayTaskError as error:
            if isinstance(error.cause, worker.TaskFailed) or "TaskFailed" in type(error.cause).__name__:
                raise ClusterError(str(error.cause)) from error
            return self._again(task, error.cause)
        except ray.exceptions.RayError as error:
            return self._again(task, error)
        # The model that was sent along is the one here: what the merge writes must name it.
        folder = os.path.abspath(os.path.dirname(task.model))
        here = json.dumps(folder, ensure_ascii=False)[1:-1].encode()
        self._keep(task, {name: with_folder(content, here) for name, content in files.items()})
        self._warn(task, [line.replace("{folder}", folder) for line in warnings])
        self.outcome.tasks += 1
        self.outcome.drives += task.filters
        self.outcome.nodes.add(node)
        return self._say(f"{task.name}: {task} done on {node}")

    def _again(self, task, why):
        self._tries[task.name] += 1
        self.outcome.repeated += 1
        reason = (" ".join(str(why).split()) or type(why).__name__)[:120]
        if self._tries[task.name] > self._options.retries:
            raise ClusterError(f"{task.name} ({task}): lost {self._tries[task.name]} times, at last: "
                               f"{reason}; what is done is kept, --resume goes on")
        self._waiting.appendleft(task)
        return self._say(f"{task.name}: lost ({reason}), again")

    def _warn(self, task, lines):
        """Once each: all tasks of a sequence say the same of a frame of it."""
        for line in lines:
            if line not in self.outcome.warnings:
                self.outcome.warnings.append(line)
                print(f"{line} ({task.name})", file=sys.stderr, flush=True)

    def _say(self, text):
        if not self._options.quiet:
            done = self.outcome
            rate = done.drives / done.seconds if done.seconds > 0 else 0.0
            print(f"[{done.tasks}/{self._total}] {text}; {rate:.2f} drives/s", file=sys.stderr, flush=True)


def _run_here(program, arguments, files, threads):
    return ray.get_runtime_context().get_node_id()[:8], worker.run_task(program, arguments, files, threads)


def run(tasks, options, keep):
    """keep(task, files) is called for each part as it comes. Errors: the program refused a task, or a task was lost too
    often, or no node is left."""
    ray.cloudpickle.register_pickle_by_value(worker)
    ray.cloudpickle.register_pickle_by_value(sys.modules[__name__])
    return _Queue(tasks, options, keep).run()


def _check_listening(address):
    """Ray itself waits for minutes for a cluster that is not there."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=10).close()
    except (OSError, ValueError) as error:
        raise ClusterError(f"--address: expected a Ray cluster at HOST:PORT, found none at {address}: {error}") from error


def connect(address):
    """address: of a cluster, `auto` for the one this machine belongs to, or None: this machine alone."""
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    if address not in (None, "auto"):
        _check_listening(address)
    try:
        ray.init(address=address or "local", log_to_driver=False, logging_level="ERROR", include_dashboard=None if address else False)
    except (ConnectionError, RuntimeError, ValueError, TimeoutError) as error:
        raise ClusterError(f"--address {address}: expected a Ray cluster, found: {' '.join(str(error).split())[:200]}") from error
