# SPDX-License-Identifier: MIT
"""stemvo-lab search on a Ray cluster of two local nodes, one of which is lost on the way: the same rows as without Ray."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from click.testing import CliRunner
from stemvo.lab import work
from stemvo.lab.cli import main

cluster_utils = pytest.importorskip("ray.cluster_utils")


def test_a_lost_node_changes_nothing(tmp_path, monkeypatch):
    subprocess.run([os.environ["STEMVO_PROGRAM"], "synth", tmp_path, "--frames", "60", "--width", "310", "--height", "94"], check=True, stdout=subprocess.DEVNULL)
    command = ["search", str(tmp_path / "sequences/00"), "--model", "default", "--filters", "0:16", "--no-baselines", "--exhaustive"]
    assert CliRunner().invoke(main, [*command, "--no-ray", "--out", str(tmp_path / "alone")]).exit_code == 0
    cluster = cluster_utils.Cluster(initialize_head=True, head_node_args={"num_cpus": 1})
    try:
        # Without --address the search keeps to its own processes, whatever cluster runs beside it: in a process of its own, as a user's is.
        beside = [Path(sys.executable).with_name("stemvo-lab"), *command, "--jobs", "2", "--out", tmp_path / "beside"]
        subprocess.run(beside, check=True, stdout=subprocess.DEVNULL)
        lost = cluster.add_node(num_cpus=1)
        cluster.wait_for_nodes()
        submit, submitted = work.Actors.submit, []

        def submit_and_lose(self, *task):
            submitted.append(submit(self, *task))
            if len(submitted) == len(self.workers):
                threading.Timer(0.2, cluster.remove_node, (lost, False)).start()
            return submitted[-1]

        monkeypatch.setattr(work.Actors, "submit", submit_and_lose)
        done = CliRunner().invoke(main, [*command, "--address", cluster.address, "--out", str(tmp_path / "cluster")])
        assert done.exit_code == 0, done.output + repr(done.exception)
        assert len(cluster.list_all_nodes()) == 1
    finally:
        cluster.shutdown()
    names = ("filters.csv", "rows.csv")
    folders = ("alone", "beside", "cluster")
    one, beside, other = ([sorted((tmp_path / folder / name).read_text().splitlines()) for name in names] for folder in folders)
    assert one == beside == other and len(one[1]) == 17
