# SPDX-License-Identifier: MIT
"""tools/cluster: how a search is cut into tasks, and what becomes of results when tasks fail. Ray is a stand-in here."""

import contextlib
import io
import os
import pathlib
import sys
import tempfile
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
        self.warnings = []  # of every task
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
        return "node", ({"records.jsonl": b"{}"}, self.warnings)


RAY = FakeRay()
sys.modules["ray"] = RAY
import search_cluster  # noqa: E402
from cluster import driver, plan, worker  # noqa: E402


def tasks(count, **more):
    return [plan.Task(f"part{i}", "default", "stem", i, i + 1, False, **more) for i in range(count)]


class Driver(unittest.TestCase):
    def setUp(self):
        self.kept = []
        self.options = driver.Options("stemvo", ["SEQUENCE"], {}, retries=2, quiet=True)
        RAY.warnings = []

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


    def test_warnings_of_tasks_are_said_once_each_also_when_quiet(self):
        RAY.warnings = ["warning: 000007.png: cut off", "warning: {folder}/m.onnx: odd"]
        with contextlib.redirect_stderr(io.StringIO()) as said:
            outcome = self.queue({}).run()
        self.assertEqual(said.getvalue(), f"warning: 000007.png: cut off (part0)\nwarning: {os.getcwd()}/m.onnx: odd (part0)\n")
        self.assertEqual(len(outcome.warnings), 2)


PROGRAM = """#!/bin/sh
echo "warning: 000007.png: expected a complete PNG image" >&2
echo "warning: $(dirname "$0")/x" >&2
for word; do case "$last" in --out) mkdir "$word"; echo '{}' > "$word/records.jsonl";; esac; last=$word; done
exit ${CODE:-0}
"""


class Worker(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.program = pathlib.Path(folder.name) / "stemvo"
        self.program.write_text(PROGRAM, encoding="utf-8")
        self.program.chmod(0o755)

    def test_what_a_task_warns_of_comes_back_beside_its_files(self):
        files, warnings = worker.run_task(str(self.program), ["SEQUENCE"], {}, 1)
        self.assertEqual(files, {"records.jsonl": b"{}\n"})
        self.assertEqual(warnings, ["warning: 000007.png: expected a complete PNG image", f"warning: {self.program.parent}/x"])

    def test_an_error_is_the_failure(self):
        self.program.write_text(PROGRAM.replace("${CODE:-0}", "1"), encoding="utf-8")
        with self.assertRaisesRegex(worker.TaskFailed, "expected a complete PNG"):
            worker.run_task(str(self.program), [], {}, 1)


class Plan(unittest.TestCase):
    models_dir = ROOT / "models"

    def models(self):
        """Two models by path: a has layers one and two, b two and three."""
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        rows = [("a", "one", 4), ("a", "two", 6), ("b", "two", 3), ("b", "three", 5)]
        keys = "network: n\n    licence: MIT\n    kernel: [1, 1]\n    stride: 1\n    padding: [0, 0, 0, 0]\n    default_filter: 0\n    sha256: x\n    command: c"
        text = "".join(f"  - name: {name}\n    file: {name}.onnx\n    layer: {layer}\n    filters: {filters}\n    {keys}\n" for name, layer, filters in rows)
        (pathlib.Path(folder.name) / "manifest.yaml").write_text("models:\n" + text, encoding="utf-8")
        paths = [str(pathlib.Path(folder.name) / f"{name}.onnx") for name in "ab"]
        for path in paths:
            pathlib.Path(path).write_bytes(b"")
        return paths

    def test_layers_are_those_that_each_model_has(self):
        a, b = models = self.models()
        found = plan.tasks_of(models, self.models_dir, layers=["one", "two"], per_task=100)
        self.assertEqual([(task.model, task.layer, task.last) for task in found], [(a, "one", 4), (a, "two", 6), (b, "two", 3)])
        self.assertEqual(plan.lacking(models, self.models_dir, ["one", "two"]), [f"--layers: {b} has two, three, not one"])
        self.assertEqual(plan.lacking(models, self.models_dir, ["three"]), [f"--layers: {a} has one, two, not three; nothing of it is searched"])
        self.assertEqual((plan.lacking(models, self.models_dir, ["two"]), plan.lacking(models, self.models_dir, None)), ([], []))

    def test_a_layer_of_no_model_is_refused(self):
        a, b = models = self.models()
        with self.assertRaises(plan.ClusterError) as caught:
            plan.tasks_of(models, self.models_dir, layers=["one", "four"])
        self.assertEqual(str(caught.exception), f"--layers: expected one, two of {a}; two, three of {b}; found 'four'")

    def test_without_baselines_no_task_has_them(self):
        found = plan.tasks_of(["default"], self.models_dir, per_task=100, num_sequences=2, baselines=False)
        self.assertEqual([task.baselines for task in found], [False, False])
        self.assertTrue(all("--no-baselines" in task.arguments() for task in found))

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


class Command(unittest.TestCase):
    """What the driver takes, and what it hands to the program."""

    def options(self, *words):
        return search_cluster.parse_arguments(["drives/00", "--out", "result", *words])

    def test_a_configuration_that_comes_with_the_program_goes_by_its_name(self):
        for name in ("default", "paper.yaml"):
            options = self.options("--config", name)
            self.assertEqual(search_cluster.common_arguments(options)[1:], ["--config", name])
            self.assertEqual(search_cluster.find_config(name)[0].parent, ROOT / "config")
        with self.assertRaisesRegex(plan.ClusterError, "--config: expected a file or one of default, fast, paper, found 'nope'"):
            search_cluster.common_arguments(self.options("--config", "nope"))

    def test_a_file_goes_by_its_whole_path(self):
        with tempfile.NamedTemporaryFile(suffix=".yaml") as file:
            self.assertEqual(search_cluster.common_arguments(self.options("--config", file.name))[1:], ["--config", str(pathlib.Path(file.name).resolve())])
        with self.assertRaisesRegex(plan.ClusterError, "--config: expected a file, found nothing at"):
            search_cluster.common_arguments(self.options("--config", file.name))
        with self.assertRaisesRegex(plan.ClusterError, "found a folder"):
            search_cluster.common_arguments(self.options("--config", str(ROOT / "config")))

    def test_no_baselines(self):
        self.assertEqual([self.options(*words).no_baselines for words in ((), ("--no-baselines",))], [False, True])


if __name__ == "__main__":
    unittest.main()
