# SPDX-License-Identifier: MIT
"""What is done of a search on a cluster, on the disk."""

import dataclasses
import json

from cluster.plan import ClusterError


class Parts:
    """OUT/parts: a folder per task that is done, and plan.json, which says what the tasks are."""

    def __init__(self, out, tasks, fingerprint, resume):
        """Refuses a folder with parts of another search, or of this one without --resume. Writes nothing."""
        self.folder, self._plan_file = out / "parts", out / "plan.json"
        self._content = {"fingerprint": fingerprint, "tasks": [dataclasses.asdict(task) for task in tasks]}
        if self._plan_file.exists() and any(self.folder.glob("part*")):
            if not resume:
                raise ClusterError(f"{out}: expected an empty folder, found a search (--resume goes on with it)")
            if self._fingerprint_before() != fingerprint:
                raise ClusterError(f"{out}: --resume: expected the same program, models, filters, sequences (frames, calibration, poses), "
                                   "configuration and options, found others")

    def _fingerprint_before(self):
        try:
            return json.loads(self._plan_file.read_text(encoding="utf-8"))["fingerprint"]
        except (ValueError, KeyError, TypeError) as error:  # no JSON, no UTF-8, another document
            raise ClusterError(f"{self._plan_file}: expected the plan of a search, found: {' '.join(str(error).split())}") from error

    def begin(self):
        self.folder.mkdir(parents=True, exist_ok=True)
        partial = self._plan_file.with_suffix(".partial")
        partial.write_text(json.dumps(self._content, indent=1) + "\n", encoding="utf-8")
        partial.replace(self._plan_file)

    def path(self, task):
        return self.folder / task.name

    def is_done(self, task):
        return self.path(task).is_dir()

    def keep(self, task, files):
        """Appears whole or not at all."""
        partial = self.folder / f".{task.name}.partial"
        partial.mkdir(exist_ok=True)
        for name, content in files.items():
            (partial / name).write_bytes(content)
        partial.rename(self.path(task))
