# SPDX-License-Identifier: MIT
"""Studies over the library: the program stemvo-lab (docs/search.md, robustness.md, benchmark.md)."""
