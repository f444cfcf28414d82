# SPDX-License-Identifier: MIT
"""Stems as arrays and as ONNX files that say what they hold: exported (stemvo-lab export), learned (learn), shown (show)."""
