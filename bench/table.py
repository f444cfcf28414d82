# SPDX-License-Identifier: MIT
"""Prints what was measured."""

from machine import BUSY_LOAD_PER_CORE


def table(results):
    first = results[0]["name"]
    lines = [["", "frames/s", "range", f"time, {first} = 1", "range", "CPU ms/frame", "peak MiB", "t_rel %"]]
    for result in results:
        fps, ratio, error = result["fps"], result["time_over_first"], result["t_rel_percent"]
        lines.append([result["name"], f"{fps['median']:.1f}", f"{fps['low']:.1f}-{fps['high']:.1f}", f"{ratio['median']:.2f}",
                      f"{ratio['low']:.2f}-{ratio['high']:.2f}", f"{result['cpu_ms_per_frame']['median']:.1f}", f"{result['peak_mib']:.0f}",
                      "-" if error is None else f"{error:.2f}"])
    widths = [max(len(line[column]) for line in lines) for column in range(len(lines[0]))]
    return "\n".join("  ".join([line[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(line[1:], widths[1:]))])
                     for line in lines)


def page(facts, results):
    """Everything that is printed: the machine, the table, how to read it."""
    lines = [f"{key}: {value}" for key, value in facts.items()]
    lines += ["", table(results), "", "median and range of the rounds; whole processes; t_rel: stemvo with metres from the road, opencv orb with per-step ground-truth scale"]
    if facts["busy"]:
        lines.append(f"BUSY MACHINE: load average {facts['load_before']:.2f} before the start, more than {BUSY_LOAD_PER_CORE} per core used: "
                     "frames/s and times are of a busy machine; compare CPU ms/frame")
    return "\n".join(lines)
