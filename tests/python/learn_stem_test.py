# SPDX-License-Identifier: MIT
"""tools/learn_stem.py on a planted drive: a textured wall that the camera approaches."""

import contextlib
import io
import pathlib
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tools"))
import _environment  # noqa: E402,F401

import matplotlib.image  # noqa: E402
import numpy as np  # noqa: E402
import onnxruntime  # noqa: E402

import learn_stem  # noqa: E402
from stems import discriminant, drive, metadata  # noqa: E402

SIZE = (96, 128)
FOCAL_PX = 100.0
WALL_M = 10.0


def wall_gray(x, y):
    """Texture of the wall at metres x, y: waves of many lengths, weaker when shorter."""
    rng = np.random.default_rng(5)
    gray = np.full(x.shape, 120.0)
    for _ in range(60):
        length = 0.3 * 2.0 ** rng.uniform(0, 4)
        angle, phase = rng.uniform(0, 2 * np.pi, 2)
        gray += 12 * length**0.5 * np.sin(2 * np.pi * (np.cos(angle) * x + np.sin(angle) * y) / length + phase)
    return np.clip(gray, 0, 255)


def write_drive(folder, frames=4, *, step_m=0.4):
    sequence = folder / "sequences" / "00"
    for name in ("image_2", "depth"):
        (sequence / name).mkdir(parents=True)
    (folder / "poses").mkdir()
    centre = (np.array(SIZE[::-1]) - 1) / 2
    (sequence / "calib.txt").write_text(f"P2: {FOCAL_PX} 0 {centre[0]} 0 0 {FOCAL_PX} {centre[1]} 0 0 0 1 0\n")
    poses = []
    y, x = np.mgrid[:SIZE[0], :SIZE[1]].astype(np.float64)
    for index in range(frames):
        position = np.array([0.11, -0.07, 1.0]) * step_m * index
        depth = WALL_M - position[2]
        gray = wall_gray((x - centre[0]) / FOCAL_PX * depth + position[0], (y - centre[1]) / FOCAL_PX * depth + position[1])
        picture = np.repeat(np.rint(gray).astype(np.uint8)[:, :, None], 3, axis=2)
        matplotlib.image.imsave(sequence / "image_2" / f"{index:06d}.png", picture)
        np.save(sequence / "depth" / f"{index:06d}.npy", np.full(SIZE, depth, np.float32))
        poses.append(np.column_stack([np.eye(3), position]).ravel())
    np.savetxt(folder / "poses" / "00.txt", poses)


class PlantedDrive(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        write_drive(self.folder / "drive")

    def learn(self, out, *options):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            code = learn_stem.main([str(self.folder / "drive"), "--out", str(self.folder / out), "--pairs", "3000", *options])
        return code, printed.getvalue()

    def channels(self, out, gray, file="default.onnx"):
        session = onnxruntime.InferenceSession(str(self.folder / out / file))
        return session.run(["channels"], {"image": gray[None, None].astype(np.float32)})[0][0]


class Correspondences(PlantedDrive):
    def test_corners_are_where_the_wall_says(self):
        frames = drive.Drive(self.folder / "drive")
        before, after = drive.corresponding_corners(frames, 0, 2, 4, 1, 3000, np.random.default_rng(0))
        self.assertGreater(len(before), 1000)
        centre = (np.array(SIZE[::-1]) - 1) / 2
        wall = (before + 1.5 - centre) / FOCAL_PX * WALL_M
        expected = (wall - 0.8 * np.array([0.11, -0.07])) / (WALL_M - 0.8) * FOCAL_PX + centre - 1.5
        self.assertTrue(np.abs(after - expected).max() <= 0.5 + 1e-9)
        self.assertGreater(np.abs(after - before).max(), 2)

    def test_hidden_points_are_left_out(self):
        depth = self.folder / "drive" / "sequences" / "00" / "depth" / "000001.npy"
        np.save(depth, np.full(SIZE, 3.0, np.float32))
        frames = drive.Drive(self.folder / "drive")
        before, _ = drive.corresponding_corners(frames, 0, 1, 4, 1, 3000, np.random.default_rng(0))
        self.assertEqual(len(before), 0)


class Learning(PlantedDrive):
    def test_same_drive_same_bytes(self):
        self.assertEqual(self.learn("a")[0], 0)
        self.assertEqual(self.learn("b")[0], 0)
        first, second = ((self.folder / out / "default.onnx").read_bytes() for out in ("a", "b"))
        self.assertEqual(first, second)
        said = metadata.read(self.folder / "a" / "default.onnx")
        self.assertEqual((said["filters"], said["kernel"], said["stride"]), ("16", "8 8", "2"))

    def test_the_layer_norm_is_the_one_of_the_page(self):
        """channel k = z_k / sqrt(mean z^2 + floor^2): z_k unspoiled by the mean over channels."""
        shape = ("--kernel", "4", "--stride", "4", "--floor", "3")
        self.learn("out", *shape)
        frames = drive.Drive(self.folder / "drive")
        options = learn_stem.parse_arguments([str(self.folder / "drive"), "--out", "x", "--pairs", "3000", *shape])
        stem, ratios = learn_stem.learn(learn_stem.collect([frames], options), discriminant.Nuisance(), options)
        self.assertTrue(np.all(np.diff(ratios) < 0))
        gray = frames.gray(1)
        windows = np.lib.stride_tricks.sliding_window_view(gray, (4, 4))[::4, ::4]
        z = np.einsum("cyx,hwyx->chw", stem.weights.sum(axis=1), windows) + stem.bias[:, None, None]
        want = z / np.sqrt((z**2).mean(axis=0) + 9.0)
        got = self.channels("out", gray)
        self.assertTrue(np.abs(got - want).max() < 1e-3, np.abs(got - want).max())
        self.assertTrue(np.all(got.std(axis=(1, 2)) > 0.01), "a filter is dead on gray")

    def test_the_default_filter_alone_has_the_same_values(self):
        gray = drive.Drive(self.folder / "drive").gray(1)
        for shape, step in (((), 1), (("--kernel", "4", "--stride", "4", "--floor", "3"), 2)):
            with self.subTest(shape=shape):
                self.learn("out", "--default-filter", "5", *shape)
                alone = self.channels("out", gray, "default_filter_5.onnx")
                with_others = self.channels("out", gray)
                self.assertEqual(len(alone), 1)
                scale = np.abs(with_others[5]).max()
                self.assertTrue(np.abs(alone[0][::step, ::step] - with_others[5]).max() <= 1e-6 * scale)
        said = metadata.read(self.folder / "out" / "default_filter_5.onnx")
        self.assertEqual((said["filters"], said["filter"], said["default_filter"], said["stride"]), ("16", "5", "5", "2"))

    def test_tracking_has_the_steeper_slope_in_its_worse_direction(self):
        """On the pictures themselves: smaller of the slopes' energies along x and y; the noise is 1 for each filter."""
        self.assertEqual(self.learn("tracking", "--objective", "tracking")[0], 0)
        self.assertIn("--objective tracking", metadata.read(self.folder / "tracking" / "default.onnx")["command"])
        self.learn("matching")
        gray = drive.Drive(self.folder / "drive").gray(1)
        ratios = {}
        for out in ("tracking", "matching"):
            channels = np.stack([[self.channels(out, np.roll(gray, (-y, -x), (0, 1))) for x in range(2)] for y in range(2)])[:, :, :, 8:-8, 8:-8]
            slopes = channels[0, 1] - channels[0, 0], channels[1, 0] - channels[0, 0]
            ratios[out] = np.min([(slope**2).mean(axis=(1, 2)) for slope in slopes], axis=0)
        self.assertGreater(ratios["tracking"][0], 1.1 * ratios["matching"].max(), ratios)

    def test_errors_are_one_line(self):
        sequence = self.folder / "drive" / "sequences" / "00"
        cases = (
            (sequence / "depth" / "000001.npy", b"broken", "000001.npy"),
            (sequence / "calib.txt", b"P0: 1", "P2:"),
            (self.folder / "drive" / "poses" / "00.txt", b"1 2 3", "expected 4 rows of 12 numbers"),
            (sequence / "image_2" / "000002.png", b"broken", "000002.png"),
        )
        for file, content, words in cases:
            with self.subTest(file=file.name):
                whole = file.read_bytes()
                file.write_bytes(content)
                code, printed = self.learn("out")
                file.write_bytes(whole)
                self.assertEqual(code, 1)
                self.assertEqual(printed.count("\n"), 1, printed)
                self.assertIn(words, printed)


class Discriminant(unittest.TestCase):
    def test_planted_slopes_for_tracking(self):
        """Two even filters with a slope in one direction each, energies 4 and 9: their mixture has 4 * 9 / (4 + 9) in both.
        An odd filter with 2 and 1 is not mixed in. (A little of both couples the two: a double eigenvalue is no road's.)"""
        even = np.zeros((2, 16))
        even[0, [0, 3]] = even[1, [5, 6]] = 0.5**0.5
        odd = np.zeros(16)
        odd[[8, 11]] = 0.5**0.5, -(0.5**0.5)
        slopes = [along * np.outer(filter_, filter_) + own * np.outer(odd, odd) + 1e-3 * np.outer(even.sum(axis=0), even.sum(axis=0))
                  for along, filter_, own in ((4, even[0], 2), (9, even[1], 1))]
        filters, ratios = discriminant.tracking_filters(slopes, np.eye(16), 4)
        np.testing.assert_allclose(ratios[[0, 2]], [36 / 13, 1], atol=0.01)
        np.testing.assert_allclose(np.abs(filters[0] @ even.T), [(9 / 13)**0.5, (4 / 13)**0.5], atol=0.01)
        np.testing.assert_allclose(np.abs(filters[2]), np.abs(odd), atol=1e-9)


if __name__ == "__main__":
    unittest.main()
