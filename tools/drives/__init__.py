# SPDX-License-Identifier: MIT
"""Rendered drives kept in a folder, and runs of the program that are watched."""
