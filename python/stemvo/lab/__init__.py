# SPDX-License-Identifier: MIT
"""Studies over the library: the program stemvo-lab (docs/search.md, robustness.md, benchmark.md)."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # a process per core: numpy's threads would wait for each other
