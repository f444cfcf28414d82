# SPDX-License-Identifier: MIT
"""Studies over the library: the program stemvo-lab (docs/studies.md)."""
