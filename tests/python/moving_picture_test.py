# SPDX-License-Identifier: MIT
"""tools/moving_picture.py: an image per picture of the run, the path longer in each."""

import os
import pathlib
import subprocess
import tempfile
import unittest

import numpy as np
import PIL.Image

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = os.environ["STEMVO_PROGRAM"]


def path_pixels(image):
    """Counts the path so far, which is blue, right of the frame."""
    red, green, blue = np.asarray(image.convert("RGB"))[:, -180:].astype(int).transpose(2, 0, 1)
    return int(((blue > red + 40) & (blue > green + 20)).sum())


class MovingPicture(unittest.TestCase):
    def test_the_path_grows(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            for command in (["synth", "drive", "--frames", "20", "--width", "310", "--height", "94"],
                            ["run", "drive/sequences/00", "--out", "result", "--pictures", "5", "--quiet"]):
                subprocess.run([PROGRAM, *command], cwd=folder, check=True, capture_output=True)
            subprocess.run([ROOT / "tools/moving_picture.py", "result", "drive/poses/00.txt", "out.gif"], cwd=folder, check=True, capture_output=True)
            with PIL.Image.open(folder / "out.gif") as gif:
                self.assertEqual(gif.n_frames, len(list((folder / "result/pictures").glob("*.png"))))
                first = path_pixels(gif)
                gif.seek(gif.n_frames - 1)
                self.assertGreater(path_pixels(gif), first + 20)


if __name__ == "__main__":
    unittest.main()
