# SPDX-License-Identifier: MIT
"""Tasks on one process per core, of this machine or of a Ray cluster."""

import concurrent.futures
import contextlib
import importlib.util
import multiprocessing
import os
import threading

from stemvo import _core


class Processes:
    """Each worker is a process that lives as long as this does, so that what a task leaves in memory is there for the next one."""

    def __init__(self, jobs):
        context = multiprocessing.get_context("spawn")
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # numpy's threads in each worker would wait for work in a loop
        self._pools = [concurrent.futures.ProcessPoolExecutor(1, context, _Worker) for _ in range(jobs)]
        self.workers = range(jobs)
        for pool in self._pools:
            pool.submit(int)  # it begins now

    def submit(self, worker, function, task):
        return self._pools[worker].submit(function, task)

    def wait(self, futures):
        return concurrent.futures.wait(futures, return_when=concurrent.futures.FIRST_COMPLETED).done

    def result(self, future):
        return future.result()

    def close(self):
        for pool in self._pools:
            pool.shutdown(wait=False, cancel_futures=True)


class Actors:
    """The same on Ray: an actor whose node is lost begins again on another one."""

    def __init__(self, jobs, address):
        self._ray = ray = importlib.import_module("ray")
        # Without "local" Ray would join any cluster that happens to run on this machine.
        ray.init(address=address or "local", num_cpus=None if address else jobs, include_dashboard=False, logging_level="error", log_to_driver=False)
        actor = ray.remote(max_restarts=-1, max_task_retries=-1, scheduling_strategy="SPREAD")(_Worker)
        count = jobs or int(ray.cluster_resources()["CPU"])
        self._actors = [actor.remote() for _ in range(count)]
        self.workers = range(count)

    def submit(self, worker, function, task):
        return self._actors[worker].call.remote(function, task)

    def wait(self, futures):
        return self._ray.wait(list(futures), num_returns=1)[0]

    def result(self, future):
        return self._ray.get(future)

    def close(self):
        self._ray.shutdown()


class _Worker:
    """An actor of Ray; a process of our own begins by making one."""

    def __init__(self):
        _core.set_num_threads(1)

    def call(self, function, task):
        return function(task)


@contextlib.contextmanager
def workers(jobs=None, address=None, ray=True):
    """Ray where it is installed (`address`: of a cluster; else this machine), else processes. `jobs`: None: one per core."""
    on_ray = ray and importlib.util.find_spec("ray") is not None
    if address and not on_ray:
        raise ValueError("--address: expected Ray to be installed, found none")
    # Of tables and figures: a second, while workers work.
    threading.Thread(target=lambda: [importlib.import_module(name) for name in ("pandas", "stemvo.lab.figures")]).start()
    count = jobs if address else jobs or len(os.sched_getaffinity(0))
    with contextlib.closing(Actors(count, address) if on_ray else Processes(count)) as made:
        yield made


def run(workers, function, tasks, key_of=id, kept=None):
    """Yields (task, function(task)) as tasks end. A task goes to the worker that ended one of the same key (`kept`: key -> worker, from
    run to run) where that one is free first."""
    kept = {} if kept is None else kept
    waiting, idle, at_work = list(tasks), list(workers.workers), {}
    while waiting or at_work:
        while waiting and idle:
            worker = idle.pop()
            task = min(waiting, key=lambda one: kept.get(key_of(one), -1) != worker if key_of(one) in kept else 0.5)
            waiting.remove(task)
            at_work[workers.submit(worker, function, task)] = worker, task
        for future in workers.wait(at_work):
            worker, task = at_work.pop(future)
            idle.append(worker)
            kept[key_of(task)] = worker
            yield task, workers.result(future)
