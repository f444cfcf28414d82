# SPDX-License-Identifier: MIT
"""tools/cluster: how a search is cut into tasks, and what becomes of results when tasks fail. Ray is a stand-in here."""

import pathlib
import sys
import types
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))
import _environment  # noqa: E402,F401


class RayError(Exception):
    pass


class RayTaskError(RayError):
    def __init__(self, cause):
        super().__init__(str(cause))
        self.cause = cause


class FakeRay(types.ModuleType):
    """Tasks are functions that are called when their result is fetched; all of them are always done."""

    def __init__(self):
        super().__init__("ray")
        self.exceptions = types.SimpleNamespace(RayError=RayError, RayTaskError=RayTaskError)
        self.outcome_of = {}  # task's first filter -> list of exceptions, then results

    def put(self, value):
        return value

    def remote(self, **_options):
        return lambda _function: types.SimpleNamespace(remote=lambda _program, arguments, _files, _threads: tuple(arguments))

    def nodes(self):
        return [{"Alive": True, "Resources": {"CPU": 3}}]

    def wait(self, references, num_returns=1, timeout=None):
        return references[:num_returns], references[num_returns:]

    def get(self, reference):
        outcomes = self.outcome_of.get(reference[reference.index("--filters") + 1], [])
        if outcomes:
            raise outcomes.pop(0)
        return "node", {"records.jsonl": b"{}"}


RAY = FakeRay()
sys.modules["ray"] = RAY
from cluster import driver, plan, worker  # noqa: E402


def tasks(count, **more):
    return [plan.Task(f"part{i}", "default", "stem", i, i + 1, False, **more) for i in range(count)]


class Driver(unittest.TestCase):
    def setUp(self):
        self.kept = []
        self.options = driver.Options("stemvo", ["SEQUENCE"], {}, retries=2, quiet=True)

    def queue(self, outcome_of):
        RAY.outcome_of = outcome_of
        return driver._Queue(tasks(3), self.options, lambda task, _files: self.kept.append(task.name))

    def test_results_beside_an_error_are_kept(self):
        """Three tasks are in flight; what the first one says ends the search, the others are done."""
        queue = self.queue({"0:1": [RayTaskError(worker.TaskFailed("expected a key"))]})
        with self.assertRaisesRegex(plan.ClusterError, "expected a key"):
            queue.run()
        self.assertEqual(self.kept, ["part1", "part2"])

    def test_the_first_error_is_the_one_that_is_told(self):
        queue = self.queue({"0:1": [RayTaskError(worker.TaskFailed("first"))], "2:3": [RayTaskError(worker.TaskFailed("second"))]})
        with self.assertRaisesRegex(plan.ClusterError, "first"):
            queue.run()
        self.assertEqual(self.kept, ["part1"])

    def test_a_lost_worker_is_repeated(self):
        outcome = self.queue({"1:2": [RayError("node died"), RayTaskError(RuntimeError("killed by signal 9"))]}).run()
        self.assertEqual((outcome.tasks, outcome.repeated, sorted(self.kept)), (3, 2, ["part0", "part1", "part2"]))

    def test_one_lost_too_often_ends_the_search_and_the_others_are_kept(self):
        queue = self.queue({"1:2": [RayError("node died") for _ in range(3)]})
        with self.assertRaisesRegex(plan.ClusterError, r"part1 \(stem 1:2\): lost 3 times, at last: node died"):
            queue.run()
        self.assertEqual(sorted(self.kept), ["part0", "part2"])


class Plan(unittest.TestCase):
    models_dir = ROOT / "models"

    def test_tasks_are_cut_by_filters_and_sequence(self):
        found = plan.tasks_of(["default"], self.models_dir, filters=(0, 5), per_task=3, num_sequences=2)
        self.assertEqual([(task.name, task.first, task.last, task.sequence, task.baselines) for task in found],
                         [("part00000", 0, 3, 0, True), ("part00001", 0, 3, 1, True),
                          ("part00002", 3, 5, 0, False), ("part00003", 3, 5, 1, False)])
        self.assertEqual(found[3].arguments()[-3:], ["--only-sequence", "1", "--no-baselines"])
        self.assertEqual(str(found[1]), "stem 0:3 on sequence 1")

    def test_one_sequence_is_no_part_of_several(self):
        found = plan.tasks_of(["default"], self.models_dir, per_task=100)
        self.assertEqual(len(found), 1)
        self.assertNotIn("--only-sequence", found[0].arguments())


if __name__ == "__main__":
    unittest.main()
