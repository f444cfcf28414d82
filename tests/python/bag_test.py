# SPDX-License-Identifier: MIT
"""`python -m stemvo.bag` on bags of ROS 1 and 2 and MCAP made here; `stemvo run` takes what it writes."""

import contextlib
import io
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "python/stemvo"))  # the file alone: it needs no built module

import bag as bag_module  # noqa: E402
import numpy as np  # noqa: E402
import PIL.Image  # noqa: E402
import rosbags.rosbag1  # noqa: E402
import rosbags.rosbag2  # noqa: E402
from rosbags.typesys import Stores, get_typestore  # noqa: E402

PROGRAM = os.environ.get("STEMVO_PROGRAM", str(ROOT / "build/release/stemvo"))
FIRST_NS = 1_700_000_000_123_456_789
WIDTH, HEIGHT, COUNT = 160, 120, 5


def scene(index):
    """A textured wall that moves, RGB."""
    rng = np.random.default_rng(3)
    wall = np.kron(rng.integers(0, 255, (HEIGHT // 4 + 8, WIDTH // 4 + 8, 3), dtype=np.uint8), np.ones((4, 4, 1), np.uint8))
    return wall[8:8 + HEIGHT, 2 * index:2 * index + WIDTH]


class Bag(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.out = self.folder / "out"

    def write(self, kind, encoding="rgb8", topic="/cam0/image_raw", stamps=None, info=True, model="plumb_bob", **said):
        """A bag of the scene; `encoding` may be jpeg; `said` goes before what camera_info says."""
        is_ros1 = kind == "bag"
        store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
        file = self.folder / ("made.bag" if is_ros1 else "made_" + kind)
        if is_ros1:
            writer = rosbags.rosbag1.Writer(file)
        else:
            writer = rosbags.rosbag2.Writer(file, version=9, storage_plugin=getattr(rosbags.rosbag2.StoragePlugin, kind.upper()))
        types = store.types
        image_type = "sensor_msgs/msg/CompressedImage" if encoding == "jpeg" else "sensor_msgs/msg/Image"

        def header(time_ns):
            stamp = types["builtin_interfaces/msg/Time"](sec=time_ns // 10**9, nanosec=time_ns % 10**9)
            return types["std_msgs/msg/Header"](**({"seq": 0} if is_ros1 else {}), stamp=stamp, frame_id="cam")

        def put(connection, time_ns, message, name):
            raw = store.serialize_ros1(message, name) if is_ros1 else store.serialize_cdr(message, name)
            writer.write(connection, time_ns, raw)

        with writer:
            images = writer.add_connection(topic, image_type, typestore=store)
            if info:
                region = types["sensor_msgs/msg/RegionOfInterest"](x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
                matrices = {"d": np.array([-0.1, 0.02, 0.0, 0.0, 0.0]), "k": np.array([150.0, 0, 79.5, 0, 151.0, 59.5, 0, 0, 1]), "r": np.eye(3).ravel(), "p": np.zeros(12),
                            "binning_x": 0, "binning_y": 0, "roi": region, **said}
                message = types["sensor_msgs/msg/CameraInfo"](header=header(FIRST_NS), height=HEIGHT, width=WIDTH, distortion_model=model,
                                                             **{(key.upper() if is_ros1 and len(key) == 1 else key): value for key, value in matrices.items()})
                connection = writer.add_connection("/cam0/camera_info", "sensor_msgs/msg/CameraInfo", typestore=store)
                put(connection, FIRST_NS, message, "sensor_msgs/msg/CameraInfo")
            for index in range(COUNT):
                time_ns = FIRST_NS + (stamps[index] if stamps else index * 10**8)
                pixels = scene(index)
                if encoding == "jpeg":
                    data = io.BytesIO()
                    PIL.Image.fromarray(pixels).save(data, "jpeg", quality=95)
                    message = types[image_type](header=header(time_ns), format="rgb8; jpeg compressed bgr8", data=np.frombuffer(data.getvalue(), np.uint8))
                else:
                    samples = {"rgb8": pixels, "bgr8": pixels[:, :, ::-1], "mono8": pixels[:, :, 1], "mono16": pixels[:, :, 1].astype("<u2") * 256 + 7}.get(encoding, pixels)
                    rows = np.ascontiguousarray(samples).reshape(HEIGHT, -1).view(np.uint8)
                    padded = np.pad(rows, ((0, 0), (0, 6)))  # drivers align rows
                    message = types[image_type](header=header(time_ns), height=HEIGHT, width=WIDTH, encoding=encoding, is_bigendian=0, step=padded.shape[1], data=padded.ravel())
                put(images, FIRST_NS + index * 10**8, message, image_type)
        return file

    def convert(self, *arguments):
        with contextlib.redirect_stdout(io.StringIO()) as said, contextlib.redirect_stderr(io.StringIO()) as complaints:
            code = bag_module.main([str(argument) for argument in arguments])
        return code, said.getvalue(), complaints.getvalue()

    def images(self):
        lines = (self.out / "mav0/cam0/data.csv").read_text(encoding="utf-8").splitlines()
        self.assertTrue(lines[0].startswith("#"))
        rows = [line.split(",") for line in lines[1:]]
        return [(int(time), np.asarray(PIL.Image.open(self.out / "mav0/cam0/data" / name))) for time, name in rows]

    def expect_error(self, words, *arguments):
        code, said, complaint = self.convert(*arguments)
        self.assertEqual((code, said, complaint.count("\n")), (1, "", 1), complaint)
        for word in ("error: ", *words):
            self.assertIn(word, complaint)
        self.assertFalse(list(self.folder.glob("*.unfinished")))

    def test_every_kind_of_bag_gives_the_pixels_and_times(self):
        for kind, encoding in (("bag", "bgr8"), ("bag", "mono8"), ("sqlite3", "rgb8"), ("mcap", "mono16"), ("mcap", "rgb8")):
            with self.subTest(kind=kind, encoding=encoding), tempfile.TemporaryDirectory() as folder:
                self.folder, self.out = pathlib.Path(folder), pathlib.Path(folder) / "out"
                code, _, complaint = self.convert(self.write(kind, encoding), self.out)
                self.assertEqual(code, 0, complaint)
                found = self.images()
                self.assertEqual([time for time, _ in found], [FIRST_NS + index * 10**8 for index in range(COUNT)])
                for index, (_, pixels) in enumerate(found):
                    expected = scene(index)[:, :, 1] if encoding.startswith("mono") else scene(index)
                    if encoding == "mono16":
                        expected = expected.astype(np.uint16) * 256 + 7
                    np.testing.assert_array_equal(pixels, expected)

    def test_a_lone_mcap_file_and_jpegs_as_they_are(self):
        file = next(self.write("mcap", "jpeg", "/cam0/image_raw/compressed").glob("*.mcap"))
        self.assertEqual(self.convert(file, self.out)[0], 0)
        self.assertEqual(len(list((self.out / "mav0/cam0/data").glob("*.jpg"))), COUNT)
        self.assertLess(np.abs(self.images()[2][1].astype(int) - scene(2)).mean(), 20)

    def test_stemvo_runs_on_it(self):
        self.assertEqual(self.convert(self.write("sqlite3"), self.out)[0], 0)
        done = subprocess.run([PROGRAM, "run", self.out, "--out", self.folder / "result"], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("input: EuRoC recording out, 5 frames of 160x120 pixels", done.stderr)
        first = (self.folder / "result/trajectory_tum.txt").read_text(encoding="utf-8").split()[0]
        self.assertAlmostEqual(float(first), FIRST_NS * 1e-9, places=5)

    def test_late_images_are_left_out(self):
        code, said, _ = self.convert(self.write("bag", stamps=[0, 10, 10, 5, 20]), self.out)
        self.assertEqual(code, 0)
        self.assertIn("3 images; 2 of no later time", said)
        self.assertEqual([time - FIRST_NS for time, _ in self.images()], [0, 10, 20])

    def test_the_camera_comes_from_a_file_where_the_bag_has_none(self):
        bag = self.write("bag", info=False)
        self.expect_error(["/cam0/camera_info", "--camera FILE"], bag, self.out)
        camera = self.folder / "camera.yaml"
        camera.write_text("resolution: [160, 120]\nintrinsics: [150, 150, 79.5, 59.5]\ndistortion_model: none\n", encoding="utf-8")
        self.assertEqual(self.convert(bag, self.out, "--camera", camera)[0], 0)
        self.assertEqual((self.out / "mav0/cam0/sensor.yaml").read_text(encoding="utf-8"), camera.read_text(encoding="utf-8"))

    def test_a_rectified_topic_has_the_camera_of_p(self):
        projection = np.array([140.0, 0, 80.5, 0, 0, 141.0, 60.5, 0, 0, 0, 1, 0])
        for kind, encoding, topic in (("bag", "rgb8", "/cam0/image_rect"), ("sqlite3", "rgb8", "/cam0/image_rect_color"), ("mcap", "jpeg", "/cam0/image_rect/compressed")):
            with self.subTest(topic=topic), tempfile.TemporaryDirectory() as folder:
                self.folder, self.out = pathlib.Path(folder), pathlib.Path(folder) / "out"
                code, _, told = self.convert(self.write(kind, encoding, topic, p=projection), self.out)
                self.assertEqual(code, 0, told)
                self.assertIn("P without distortion", told)
                text = (self.out / "mav0/cam0/sensor.yaml").read_text(encoding="utf-8")
                self.assertIn("intrinsics: [140.0, 141.0, 80.5, 60.5]\ndistortion_model: none\n", text)

    def test_a_topic_that_may_be_rectified_is_a_warning(self):
        code, _, told = self.convert(self.write("bag", topic="/cam0/direct", p=np.array([140.0, 0, 80.5, 0, 0, 141.0, 60.5, 0, 0, 0, 1, 0])), self.out)
        self.assertEqual(code, 0, told)
        self.assertIn("warning: /cam0/camera_info: K and D", told)
        self.assertIn("intrinsics: [150.0, 151.0, 79.5, 59.5]\ndistortion_model: radial-tangential", (self.out / "mav0/cam0/sensor.yaml").read_text(encoding="utf-8"))

    def test_parts_of_images_and_skew_are_refused(self):
        self.expect_error(["camera of whole images"], self.write("bag", binning_x=2), self.out)
        self.expect_error(["without skew"], self.write("sqlite3", k=np.array([150.0, 3, 79.5, 0, 151.0, 59.5, 0, 0, 1])), self.out)

    def test_a_bag_that_is_not_there(self):
        self.expect_error(["none.bag: expected a bag, found nothing"], self.folder / "none.bag", self.out)

    def test_what_cannot_be_converted_is_one_line(self):
        bag = self.write("bag", "yuv422")
        self.expect_error(["yuv422", "rgb8"], bag, self.out)
        self.expect_error(["/other", "/cam0/image_raw"], bag, self.out, "--topic", "/other")
        whole = bag.read_bytes()
        bag.write_bytes(whole[:len(whole) // 2])
        self.expect_error([str(bag)], bag, self.out)
        self.expect_error(["nothing.mcap"], self.folder / "nothing.mcap", self.out)
        self.expect_error(["does not exist, found one"], bag, self.folder)
        self.assertFalse(self.out.exists())


if __name__ == "__main__":
    unittest.main()
