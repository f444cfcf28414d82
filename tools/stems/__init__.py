# SPDX-License-Identifier: MIT
"""Shared by the Python tools: stems as arrays and as ONNX files that say what they hold."""
