# SPDX-License-Identifier: MIT
"""4,000 small frames (links to a few, there and back again): open files and time per frame do not grow, memory by what
is kept of a frame: pose, row and landmarks. Without loops: what remembers a place that is seen again and again grows by 25 kB a
keyframe still, and so does its graph."""

import os
import subprocess

from drives import watched_run

PROGRAM = os.environ["STEMVO_PROGRAM"]
RENDERED = 100
FRAMES = 4000
MAX_KB_PER_FRAME = 8.0
MAX_FILES_FOR_A_MOMENT = 3


def frame(i):
    """0, 1, .. 98, 99, 98, .. 1, 0, 1, .."""
    return RENDERED - 1 - abs(i % (2 * RENDERED - 2) - (RENDERED - 1))


def test_nothing_grows(tmp_path):
    subprocess.run([PROGRAM, "synth", tmp_path / "drive", "--frames", str(RENDERED), "--width", "310", "--height", "94"], check=True, capture_output=True)
    rendered, sequence = tmp_path / "drive/sequences/00", tmp_path / "long/sequences/00"
    (sequence / "image_2").mkdir(parents=True)
    os.link(rendered / "calib.txt", sequence / "calib.txt")
    (sequence / "times.txt").write_text("".join(f"{0.1 * i:.1f}\n" for i in range(FRAMES)))
    for i in range(FRAMES):
        os.symlink(rendered / f"image_2/{frame(i):06d}.png", sequence / f"image_2/{i:06d}.png")
    result = watched_run.run(PROGRAM, sequence, tmp_path / "out", FRAMES, ["--set", "odometry.loops=off"])
    # Samples of the second quarter and of the second half are 3/8 of the frames apart.
    grown_kb = 1024 * (result.median_mb[1] - result.median_mb[0]) / (0.375 * FRAMES)
    print(f"memory {result.memory_mb} MB, {grown_kb:.1f} kB a frame, open files {result.handles}, "
          f"processor ms per frame {result.quarters_cpu_ms}")
    assert (tmp_path / "out/trajectory_kitti.txt").read_text().count("\n") == result.metrics["frames"] == FRAMES
    assert grown_kb < MAX_KB_PER_FRAME
    # A leak of one a frame would be thousands; a file that is open for a moment is seen by one sample and missed
    # by the next.
    assert 3 < result.handles[0] and result.handles[1] <= result.handles[0] + MAX_FILES_FOR_A_MOMENT
    assert result.quarters_cpu_ms[3] < 1.3 * min(result.quarters_cpu_ms[:3])
