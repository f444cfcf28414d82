# SPDX-License-Identifier: MIT
"""Shared by the Python tools: stems as arrays, as ONNX files, and in a manifest."""
