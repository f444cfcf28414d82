# SPDX-License-Identifier: MIT
"""`python -m stemvo.bag` on bags of ROS 1 and 2 and MCAP made here; `stemvo run` takes what it writes."""

import contextlib
import io
import json
import os
import subprocess
import types

import bags
import numpy as np
import PIL.Image
import pytest
import rosbags.highlevel
from bags import ROOT, bag_module
from rosbags.typesys import Stores, get_typestore

PROGRAM = os.environ.get("STEMVO_PROGRAM", str(ROOT / "build/release/stemvo"))
FIRST_NS = 1_700_000_000_123_456_789
WIDTH, HEIGHT, COUNT = 160, 120, 5


def scene(index):
    """A textured wall that moves, RGB."""
    rng = np.random.default_rng(3)
    wall = np.kron(rng.integers(0, 255, (HEIGHT // 4 + 8, WIDTH // 4 + 8, 3), dtype=np.uint8), np.ones((4, 4, 1), np.uint8))
    return wall[8:8 + HEIGHT, 2 * index:2 * index + WIDTH]


class TestBag:
    @pytest.fixture(autouse=True)
    def set_up(self, tmp_path):
        self.folder = tmp_path
        self.out = self.folder / "out"

    def write(self, kind, encoding="rgb8", stamps=None, **more):
        stamps = stamps or [index * 10**8 for index in range(COUNT)]
        return bags.write(self.folder / ("made.bag" if kind == "bag" else "made_" + kind), kind, [scene(index) for index in range(COUNT)],
                          [FIRST_NS + stamp for stamp in stamps], [150.0, 0, 79.5, 0, 151.0, 59.5, 0, 0, 1], encoding,
                          **{"d": np.array([-0.1, 0.02, 0.0, 0.0, 0.0]), **more})

    def images(self):
        lines = (self.out / "mav0/cam0/data.csv").read_text(encoding="utf-8").splitlines()
        assert lines[0].startswith("#")
        rows = [line.split(",") for line in lines[1:]]
        return [(int(time), np.asarray(PIL.Image.open(self.out / "mav0/cam0/data" / name))) for time, name in rows]

    def expect_error(self, words, *arguments):
        code, said, complaint = bags.convert(*arguments)
        assert (code, said, complaint.count("\n")) == (1, "", 1), complaint
        assert all(word in complaint for word in ("error: ", *words)), complaint
        assert not list(self.folder.glob("*.unfinished"))

    @pytest.mark.parametrize(("kind", "encoding"), [("bag", "bgr8"), ("bag", "mono8"), ("sqlite3", "rgb8"), ("mcap", "mono16"), ("mcap", "rgb8")])
    def test_every_kind_of_bag_gives_the_pixels_and_times(self, kind, encoding):
        code, _, complaint = bags.convert(self.write(kind, encoding), self.out)
        assert code == 0, complaint
        found = self.images()
        assert [time for time, _ in found] == [FIRST_NS + index * 10**8 for index in range(COUNT)]
        for index, (_, pixels) in enumerate(found):
            expected = scene(index)[:, :, 1] if encoding.startswith("mono") else scene(index)
            if encoding == "mono16":
                expected = expected.astype(np.uint16) * 257
            np.testing.assert_array_equal(pixels, expected)

    def test_a_lone_mcap_file_and_jpegs_as_they_are(self):
        file = next(self.write("mcap", "jpeg", topic="/cam0/image_raw/compressed").glob("*.mcap"))
        assert bags.convert(file, self.out)[0] == 0 and len(list((self.out / "mav0/cam0/data").glob("*.jpg"))) == COUNT
        assert np.abs(self.images()[2][1].astype(int) - scene(2)).mean() < 20

    def test_stemvo_runs_on_it(self):
        assert bags.convert(self.write("sqlite3"), self.out)[0] == 0
        done = subprocess.run([PROGRAM, "run", self.out, "--out", self.folder / "result"], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        assert "input: EuRoC recording out, 5 frames of 160x120 pixels" in done.stderr
        first = (self.folder / "result/trajectory_tum.txt").read_text(encoding="utf-8").split()[0]
        assert float(first) == pytest.approx(FIRST_NS * 1e-9, abs=0.5e-5, rel=0)

    def test_late_images_are_left_out(self):
        self.expect_error(["expected stamps that rise, found 4 of 5"], self.write("sqlite3", stamps=[90, 10, 20, 30, 40]), self.out)
        code, said, _ = bags.convert(self.write("bag", stamps=[0, 10, 10, 5, 20]), self.out)
        assert code == 0 and "3 images; 2 of no later time" in said and [time - FIRST_NS for time, _ in self.images()] == [0, 10, 20]

    def test_the_camera_comes_from_a_file_where_the_bag_has_none(self):
        bag = self.write("bag", info=False)
        self.expect_error(["/cam0/camera_info", "--camera FILE"], bag, self.out)
        camera = self.folder / "camera.yaml"
        camera.write_text("resolution: [160, 120]\nintrinsics: [150, 150, 79.5, 59.5]\ndistortion_model: none\n", encoding="utf-8")
        assert bags.convert(bag, self.out, "--camera", camera)[0] == 0
        assert (self.out / "mav0/cam0/sensor.yaml").read_text(encoding="utf-8") == camera.read_text(encoding="utf-8")

    def test_the_camera_of_a_chain_is_that_of_the_topic(self):
        bag = self.write("bag", topic="/cam1/image_raw", info=False)
        chain = self.folder / "camchain.yaml"
        camera = "cam{0}:\n  intrinsics: [15{0}, 150, 79.5, 59.5]\n  distortion_model: radtan\n  distortion_coeffs: [0, 0, 0, 0]\n  resolution: [160, 120]\n  rostopic: {1}\n"
        chain.write_text(camera.format(0, "/cam0/image_raw") + camera.format(1, "/cam1/image_raw"), encoding="utf-8")
        assert bags.convert(bag, self.out, "--camera", chain)[0] == 0
        assert (self.out / "mav0/cam0/sensor.yaml").read_text(encoding="utf-8") == camera.format(1, "/cam1/image_raw").replace("cam1:", "cam0:", 1)
        chain.write_text(camera.format(0, "/left") + camera.format(1, "/right"), encoding="utf-8")
        other = self.folder / "other"
        self.expect_error(["camchain.yaml", "/cam1/image_raw", "/left, /right"], bag, other, "--camera", chain)
        colmap = self.folder / "cameras.txt"
        colmap.write_text("# Camera list: one line each\n1 PINHOLE 160 120 150 150 80 60\n", encoding="utf-8")
        self.expect_error(["cameras.txt", "COLMAP"], bag, other, "--camera", colmap)

    def test_rectified_images_without_their_camera_are_refused(self):
        self.expect_error(["expected P", "/cam0/image_rect"], self.write("bag", topic="/cam0/image_rect"), self.out)
        self.expect_error(["of 3 coefficients"], self.write("sqlite3", d=np.array([-0.1, 0.02, 0.01])), self.out)

    @pytest.mark.parametrize(("kind", "encoding", "topic"), [("bag", "rgb8", "/cam0/image_rect"), ("bag", "rgb8", "/cam0/image_undistorted"), ("sqlite3", "rgb8", "/cam0/image_rect_color"), ("mcap", "jpeg", "/cam0/image_rect/compressed")])
    def test_a_rectified_topic_has_the_camera_of_p(self, kind, encoding, topic):
        projection = np.array([140.0, 0, 80.5, 0, 0, 141.0, 60.5, 0, 0, 0, 1, 0])
        code, _, told = bags.convert(self.write(kind, encoding, topic=topic, p=projection), self.out)
        assert code == 0, told
        assert "P without distortion" in told
        text = (self.out / "mav0/cam0/sensor.yaml").read_text(encoding="utf-8")
        assert "intrinsics: [140.0, 141.0, 80.5, 60.5]\ndistortion_model: none\n" in text

    def test_a_topic_that_may_be_rectified_is_a_warning(self):
        code, _, told = bags.convert(self.write("bag", topic="/cam0/direct", p=np.array([140.0, 0, 80.5, 0, 0, 141.0, 60.5, 0, 0, 0, 1, 0])), self.out)
        assert code == 0, told
        assert "warning: /cam0/camera_info: K and D" in told
        assert "intrinsics: [150.0, 151.0, 79.5, 59.5]\ndistortion_model: radial-tangential" in (self.out / "mav0/cam0/sensor.yaml").read_text(encoding="utf-8")

    def test_parts_of_images_and_skew_are_refused(self):
        self.expect_error(["camera of whole images"], self.write("bag", binning_x=2), self.out)
        self.expect_error(["without skew"], self.write("sqlite3", k=np.array([150.0, 3, 79.5, 0, 151.0, 59.5, 0, 0, 1])), self.out)

    def test_what_cannot_be_converted_is_one_line(self):
        bag = self.write("bag", "yuv422")
        self.expect_error(["yuv422", "rgb8"], bag, self.out)
        self.expect_error(["/other", "/cam0/image_raw"], bag, self.out, "--topic", "/other")
        whole = bag.read_bytes()
        bag.write_bytes(whole[:len(whole) // 2])
        self.expect_error([str(bag)], bag, self.out)
        self.expect_error(["nothing.mcap"], self.folder / "nothing.mcap", self.out)
        self.expect_error(["does not exist, found one"], bag, self.folder)
        assert not self.out.exists()


class TestResult:
    """A result as a bag, read back with rosbags and compared with the numbers it was made of."""

    FRAMES, STEP_S = 4, 0.1
    CAMERA = types.SimpleNamespace(fx=150.0, fy=151.0, cx=79.5, cy=59.5, width=WIDTH, height=HEIGHT)

    @pytest.fixture(autouse=True)
    def set_up(self, tmp_path):
        self.folder = tmp_path
        self.result = self.folder / "result"
        self.result.mkdir()
        half = float(np.sin(np.pi / 4))
        with (self.result / "frames.csv").open("w", encoding="utf-8") as file:
            columns = ["frame", "timestamp_s", "map_scale", *(f"map_{c}" for c in ("x", "y", "z", "qx", "qy", "qz", "qw")), "x", "y", "z", "qx", "qy", "qz", "qw",
                       *(f"step_var_{c}" for c in ("x", "y", "z", "rx", "ry", "rz"))]
            file.write(",".join(columns) + "\n")
            for i in range(self.FRAMES):  # 2 m a frame forward (z), then turned to the right by 90 degrees (about y, down); the map is twice as large, 1 m to the right
                turn = [0, half, 0, half] if i == 3 else [0, 0, 0, 1]
                values = [7 + i, 1.7e9 + self.STEP_S * i, 2, 1, 0, 0, 0, 0, 0, 1, 0, 0, 2.0 * i, *turn, *([0.01, 0.02, 0.04, 1e-4, 2e-4, 3e-4] if i else [0] * 6)]
                file.write(",".join(map(repr, values)) + "\n")
        vertices = np.array([((1, 2, 3), (10, 20, 30)), ((4, 5, 6), (40, 50, 60)), ((0, 0, 0), (1, 1, 1)), ((0, 0, 2), (1, 1, 1))],
                            np.dtype([("xyz", "<f4", 3), ("rgb", "u1", 3)]))
        header = "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nelement edge 1\nproperty int vertex1\nend_header\n"
        (self.result / "metrics.json").write_text(json.dumps({"camera": {"fx_px": 150.0, "cx_px": 80.0, "cy_px": 59.0}}), encoding="utf-8")
        (self.result / "map.ply").write_bytes(header.encode() + vertices.tobytes() + bytes(8))

    def write(self, **more):
        out = self.folder / "out.mcap"
        bag_module.result_bag.write_result(self.result, out, **more)
        store = get_typestore(Stores.ROS2_HUMBLE)
        with rosbags.highlevel.AnyReader([out], default_typestore=store) as reader:
            found = {}
            for connection, time_ns, raw in reader.messages():
                found.setdefault(connection.topic, []).append((time_ns, reader.deserialize(raw, connection.msgtype)))
            self.latched = {c.topic for c in reader.connections if any(q.durability.name == "TRANSIENT_LOCAL" for q in c.ext.offered_qos_profiles)}
        return found

    def recording(self, frames, **more):
        times = [self.STEP_S * i for i in range(len(frames))]  # counted from a rate
        return type("Recording", (list,), {"camera": self.CAMERA, "timestamps": times, **more})(frames)

    @staticmethod
    def vector(message):
        return [message.x, message.y, message.z]

    def test_messages_hold_what_the_result_says(self):
        recording = [(scene(i), 0.0) for i in range(self.FRAMES)]
        recording[1] = (None, 0.0)  # cannot be read
        asked = []

        def open_recording(first, count):
            asked.append((first, count))
            return self.recording(recording)

        found = self.write(open_recording=open_recording)
        assert asked == [(7, self.FRAMES)]
        assert set(found) == {"/tf_static", "/landmarks", "/tf", "/odometry", "/camera/image/compressed", "/camera/camera_info"}
        assert self.latched == {"/tf_static", "/landmarks"}
        times = [1_700_000_000_000_000_000 + 100_000_000 * i for i in range(self.FRAMES)]
        assert [time for time, _ in found["/odometry"]] == times
        for (time_ns, odometry), (_, tf) in zip(found["/odometry"], found["/tf"]):
            i = times.index(time_ns)
            assert bag_module.stamp_ns(odometry) == time_ns and (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_link")
            assert [(t.header.frame_id, t.child_frame_id, bag_module.stamp_ns(t)) for t in tf.transforms] == [("map", "odom", time_ns), ("odom", "base_link", time_ns)]
            np.testing.assert_allclose(self.vector(odometry.pose.pose.position), [2.0 * i, 0, 0], atol=1e-12)  # x is forward
            half = float(np.sin(np.pi / 4))
            turn = [0, 0, -half, half] if i == 3 else [0, 0, 0, 1]  # right is clockwise from above
            q = odometry.pose.pose.orientation
            np.testing.assert_allclose([q.x, q.y, q.z, q.w], turn, atol=1e-12)
            np.testing.assert_allclose(self.vector(tf.transforms[1].transform.translation), self.vector(odometry.pose.pose.position))
            # Where the base is in the map: twice as far, and 1 m to the right (-y).
            np.testing.assert_allclose(self.vector(tf.transforms[0].transform.translation) + np.array([2.0 * i, 0, 0]), [4.0 * i, -1, 0], atol=1e-12)
            assert tf.transforms[0].transform.rotation.w == 1.0
        first, second, last = found["/odometry"][0][1], found["/odometry"][1][1], found["/odometry"][3][1]
        assert not first.pose.covariance.any() and not self.vector(first.twist.twist.linear)[0]
        np.testing.assert_allclose(second.pose.covariance.reshape(6, 6), np.diag([0.04, 0.01, 0.02, 3e-4, 1e-4, 2e-4]), atol=1e-15)
        np.testing.assert_allclose(self.vector(second.twist.twist.linear), [20, 0, 0], rtol=1e-6)
        np.testing.assert_allclose(second.twist.covariance.reshape(6, 6).diagonal(), [4, 1, 2, 0.03, 0.01, 0.02], rtol=1e-5)
        np.testing.assert_allclose(self.vector(last.twist.twist.linear), [0, 20, 0], rtol=1e-6, atol=1e-6)  # turned to the right it moves to its left
        np.testing.assert_allclose(self.vector(last.twist.twist.angular), [0, 0, -np.pi / 2 / self.STEP_S], rtol=1e-6)
        # Steps of 2 m in y: a yaw's variance of 2e-4 each, behind one and two steps.
        covariance = found["/odometry"][2][1].pose.covariance.reshape(6, 6)
        np.testing.assert_allclose(covariance[1, 1], 2 * 0.01 + 4 * 2e-4)
        np.testing.assert_allclose(covariance[1, 5], 2 * 2e-4)
        np.testing.assert_allclose(covariance, covariance.T)
        static = found["/tf_static"][0][1].transforms[0]
        assert (static.header.frame_id, static.child_frame_id) == ("base_link", "camera_optical")
        q = static.transform.rotation
        np.testing.assert_allclose([q.x, q.y, q.z, q.w], [-0.5, 0.5, -0.5, 0.5], atol=1e-12)
        self.check_images(found, times)

    def check_images(self, found, times):
        assert [time for time, _ in found["/camera/image/compressed"]] == [times[0], *times[2:]]
        image = found["/camera/image/compressed"][1][1]
        assert (image.header.frame_id, image.format, bag_module.stamp_ns(image)) == ("camera_optical", "jpeg", times[2])
        pixels = np.asarray(PIL.Image.open(io.BytesIO(image.data.tobytes())))
        assert np.abs(pixels.astype(int) - scene(2)).mean() < 20
        info = found["/camera/camera_info"][0][1]
        assert (info.width, info.height, info.header.frame_id, info.distortion_model) == (WIDTH, HEIGHT, "camera_optical", "plumb_bob")
        assert list(info.k) == [150, 0, 79.5, 0, 151, 59.5, 0, 0, 1] and list(info.p) == [150, 0, 79.5, 0, 0, 151, 59.5, 0, 0, 0, 1, 0]
        assert not info.d.any()
        cloud = found["/landmarks"][0][1]
        assert (cloud.header.frame_id, cloud.width, cloud.height, cloud.point_step, cloud.row_step) == ("map", 2, 1, 16, 32)
        assert [(f.name, f.offset, f.datatype) for f in cloud.fields] == [("x", 0, 7), ("y", 4, 7), ("z", 8, 7), ("rgb", 12, 7)]
        points = cloud.data.view(np.dtype([("xyz", "<f4", 3), ("rgb", "<u4")]))
        np.testing.assert_array_equal(points["xyz"], [[3, -1, -2], [6, -4, -5]])
        assert list(points["rgb"]) == [0x0A141E, 0x28323C]

    def test_a_recording_of_another_result_is_refused(self):
        frames = [(scene(i), 0.0) for i in range(self.FRAMES)]
        larger = types.SimpleNamespace(**vars(self.CAMERA) | {"fx": 300.0, "cx": 159.5, "cy": 119.5, "width": 2 * WIDTH})
        for other in (self.recording(frames[1:]), self.recording(frames, camera=larger), self.recording(frames, timestamps=[0.0, 0.1, 0.19, 0.3])):
            with pytest.raises(bag_module.result_bag.ResultError, match="--recording: expected .* another recording"):
                self.write(open_recording=lambda first, count, other=other: other)
        assert len(self.write(open_recording=lambda first, count: self.recording(frames))["/camera/camera_info"]) == self.FRAMES

    def test_a_damaged_result_is_named_with_its_line(self):
        lines = (self.result / "frames.csv").read_text(encoding="utf-8").splitlines()
        for damaged, words in ((lines[2].replace("1700000000.1", "soon"), r"frames.csv:3: .*timestamp_s.*soon"), (lines[2][:30], r"frames.csv:3: expected numbers"),
                               (lines[2].replace(",2,1,", ",2,nan,"), r"frames.csv:3: .*map_\(x y z\).*nan")):
            (self.result / "frames.csv").write_text("\n".join([*lines[:2], damaged, *lines[3:]]), encoding="utf-8")
            with pytest.raises(bag_module.result_bag.ResultError, match=words):
                self.write()
        (self.result / "frames.csv").write_text("\n".join(lines), encoding="utf-8")
        (self.result / "map.ply").write_bytes((self.result / "map.ply").read_bytes()[:-40])
        with pytest.raises(bag_module.result_bag.ResultError, match="map.ply: expected vertices"):
            self.write()

    def test_images_that_cannot_be_read_are_no_fault_of_a_result(self):
        subprocess.run([PROGRAM, "synth", self.folder / "drive", "--frames", "12", "--width", "320", "--height", "96"], check=True, capture_output=True)
        for index in (0, 6):
            (self.folder / f"drive/sequences/00/image_2/{index:06}.png").write_bytes(b"")
        self.result = self.folder / "real"
        subprocess.run([PROGRAM, "run", self.folder / "drive/sequences/00", "--out", self.result, "--quiet"], check=True, capture_output=True)
        odometry = self.write()["/odometry"]
        assert len(odometry) == 12 and odometry[0][0] == 1, "a stamp of 0 is no time"
        covariances = [message.pose.covariance for _, message in odometry]
        assert np.isfinite(covariances).all() and not covariances[1].any() and covariances[6].any()

    def test_the_command_writes_one_file_or_says_why_not(self):
        out = self.folder / "made.mcap"
        with contextlib.redirect_stdout(io.StringIO()) as said:
            assert bag_module.main([str(self.result), str(out)]) == 0
        with contextlib.redirect_stderr(io.StringIO()) as complaint:
            assert bag_module.main([str(self.result), str(self.folder / "none.mcap"), "--recording", __file__]) == 1
        assert "--recording" in complaint.getvalue() and "expected a folder or a pattern of images, found a file" in complaint.getvalue()
        assert said.getvalue() == f"{out}: 4 frames\n" and sorted(file.name for file in self.folder.iterdir()) == ["made.mcap", "result"]
        (self.result / "frames.csv").write_text("frame,timestamp_s\n0,0\n", encoding="utf-8")
        with contextlib.redirect_stderr(io.StringIO()) as complaint:
            assert bag_module.main([str(self.result), str(self.folder / "none.mcap")]) == 1
        assert "frames.csv: expected rows with poses and variances, found none" in complaint.getvalue() and not (self.folder / "none.mcap").exists()
