# SPDX-License-Identifier: MIT
"""Writes a run's result as an MCAP file of ROS 2 (docs/results.md says which topics); needs no ROS."""

import csv
import dataclasses
import decimal
import io
import json
import pathlib
import shutil

import numpy as np
import PIL.Image
import rosbags.rosbag2
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.typesys import Stores, get_typestore

# Axes of bodies as ROS has them (REP 103: x forward, y left, z up) from a camera's (x right, y down, z forward).
BODY_FROM_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
FOREVER = QosTime(2147483647, 4294967295)
LATCHED = (Qos(QosHistory.KEEP_LAST, 1, QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL, FOREVER, FOREVER, QosLiveliness.AUTOMATIC, FOREVER, False),)


class ResultError(Exception):
    """The result has a fault, which one line names."""


@dataclasses.dataclass
class Frame:
    time_ns: int
    odom_from_base: np.ndarray  # 4x4
    map_from_odom: np.ndarray
    covariance: np.ndarray  # 6x6 of the pose: position, then rotation, about odom's axes
    step: np.ndarray  # 4x4, prev_from_cur of the base
    step_variances: np.ndarray  # 6, about the base's axes
    seconds: float  # since the frame before; 0: the first


def cross(vector):
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_of(*quaternion):
    x, y, z, w = np.array(quaternion) / np.linalg.norm(quaternion)
    turn = cross((x, y, z))
    return np.eye(3) + 2.0 * w * turn + 2.0 * turn @ turn


def quaternion_of(rotation):
    """x, y, z, w; w >= 0."""
    axis = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
    trace = np.trace(rotation)
    quaternion = np.linalg.eigh(np.block([[rotation + rotation.T - trace * np.eye(3), axis[:, None]], [axis, trace]]))[1][:, -1]
    return quaternion if quaternion[3] >= 0.0 else -quaternion


def rotation_vector(rotation):
    *axis, cosine = quaternion_of(rotation)
    sine = np.linalg.norm(axis)
    return np.array(axis) * (2.0 if sine < 1e-9 else 2.0 * np.arctan2(sine, cosine) / sine)


def rigid(rotation, translation):
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, translation
    return pose


def in_body_axes(pose):
    return rigid(BODY_FROM_OPTICAL @ pose[:3, :3] @ BODY_FROM_OPTICAL.T, BODY_FROM_OPTICAL @ pose[:3, 3])


def read_frames(folder):
    """Frames of frames.csv. A pose's covariance joins those of its steps, whose errors are taken for independent."""
    with (folder / "frames.csv").open(newline="", encoding="utf-8", errors="replace") as file:
        rows = list(csv.DictReader(file))
    if not rows or not rows[0].get("step_var_rz"):
        raise ResultError("frames.csv: expected rows with poses and variances, found none; run it again")
    covariance, frames, last = np.zeros((6, 6)), [], None
    for line, row in enumerate(rows, 2):
        def numbers(prefix, names):
            found = [row[prefix + name] for name in names.split()]
            try:
                values = [float(text) for text in found]
            except (TypeError, ValueError):
                values = [np.nan]
            if not np.all(np.isfinite(values)) or names.endswith("qw") and not np.any(values):
                raise ResultError(f"frames.csv:{line}: expected numbers {prefix}({names}), found {found}")
            return values

        optical = rigid(rotation_of(*numbers("", "qx qy qz qw")), numbers("", "x y z"))
        in_map = rigid(rotation_of(*numbers("map_", "qx qy qz qw")) @ optical[:3, :3],
                       numbers("", "map_scale")[0] * rotation_of(*numbers("map_", "qx qy qz qw")) @ optical[:3, 3] + numbers("map_", "x y z"))
        odom_from_base, map_from_base = in_body_axes(optical), in_body_axes(in_map)
        variances = np.array(numbers("step_var_", "x y z rx ry rz"))
        variances = np.concatenate([BODY_FROM_OPTICAL**2 @ variances[:3], BODY_FROM_OPTICAL**2 @ variances[3:]])
        number, time_s = numbers("", "frame timestamp_s")
        first = int(number) if last is None else first
        step, seconds = (np.eye(4), 0.0) if last is None else (np.linalg.inv(last[0]) @ odom_from_base, time_s - last[1])
        back = step[:3, :3].T
        carried = np.block([[back, -back @ cross(step[:3, 3])], [np.zeros((3, 3)), back]])
        covariance = carried @ covariance @ carried.T + np.diag(variances)
        turned = np.kron(np.eye(2), odom_from_base[:3, :3])
        time_ns = round(decimal.Decimal(row["timestamp_s"]) * 10**9) or 1  # tf2 takes a stamp of 0 for the latest
        frames.append(Frame(time_ns, odom_from_base, map_from_base @ np.linalg.inv(odom_from_base), turned @ covariance @ turned.T,
                            step, variances, seconds))
        last = odom_from_base, time_s
    return first, frames


def read_landmarks(file):
    """Positions in the map (its x forward, z up) and colours of map.ply, without the path behind them."""
    header, _, body = file.read_bytes().partition(b"end_header\n")
    counts = {words[1]: int(words[2]) for words in (line.split() for line in header.decode("latin-1").splitlines()) if words[0] == "element"}
    kind = np.dtype([("xyz", "<f4", 3), ("rgb", "u1", 3)])
    if "edge" not in counts or len(body) < counts["vertex"] * kind.itemsize:
        raise ResultError(f"{file.name}: expected vertices and edges as `stemvo run` writes them, found {len(body)} bytes behind the header")
    landmarks = np.frombuffer(body, kind, counts["vertex"])[:counts["vertex"] - (counts["edge"] + 1)]
    return landmarks["xyz"] @ BODY_FROM_OPTICAL.T.astype(np.float32), landmarks["rgb"]


def check_recording(result, frames, recording):
    """Its times are the result's, but even ones, which a rate may have made in place of --times; its camera is, as far as it was refined."""
    times, found = (np.array(times) - times[0] for times in ([frame.time_ns * 1e-9 for frame in frames], recording.timestamps))
    is_counted = len(found) > 1 and np.ptp(np.diff(found)) < 1e-6
    if len(found) != len(times) or not is_counted and np.abs(found - times).max() > 1e-3:
        raise ResultError(f"--recording: expected {len(times)} frames over {times[-1]:.3f} s at the result's times, found {len(found)} over {found[-1]:.3f} s: another recording")
    given = recording.camera
    try:
        camera = json.loads((result / "metrics.json").read_text(encoding="utf-8"))["camera"]
        known = np.array([camera[name] for name in ("fx_px", "cx_px", "cy_px")], float)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise ResultError(f"metrics.json: expected the camera of the result, found {type(error).__name__}: {error}") from None
    if not np.abs(known - (given.fx, given.cx, given.cy)).max() < 0.05 * given.width:
        raise ResultError(f"--recording: expected the result's camera (fx, cx, cy {known.round(1)}), found {given}: another recording, or another size")


class Topics:
    """Makes messages and puts them into the bag."""

    def __init__(self, writer):
        self.writer, self.store, self.connections = writer, get_typestore(Stores.ROS2_HUMBLE), {}

    def make(self, kind, /, **fields):
        return self.store.types[kind](**fields)

    def put(self, topic, time_ns, message, qos=()):
        name = message.__msgtype__
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, name, typestore=self.store, offered_qos_profiles=qos)
        self.writer.write(self.connections[topic], time_ns, self.store.serialize_cdr(message, name))

    def header(self, time_ns, frame):
        stamp = self.make("builtin_interfaces/msg/Time", sec=time_ns // 10**9, nanosec=time_ns % 10**9)
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)

    def parts(self, pose):
        x, y, z, w = quaternion_of(pose[:3, :3])
        return dict(zip("xyz", pose[:3, 3])), self.make("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)

    def transform(self, time_ns, parent, child, pose):
        position, rotation = self.parts(pose)
        transform = self.make("geometry_msgs/msg/Transform", translation=self.make("geometry_msgs/msg/Vector3", **position), rotation=rotation)
        return self.make("geometry_msgs/msg/TransformStamped", header=self.header(time_ns, parent), child_frame_id=child, transform=transform)

    def put_frame(self, frame):
        transforms = [self.transform(frame.time_ns, "map", "odom", frame.map_from_odom), self.transform(frame.time_ns, "odom", "base_link", frame.odom_from_base)]
        self.put("/tf", frame.time_ns, self.make("tf2_msgs/msg/TFMessage", transforms=transforms))
        position, rotation = self.parts(frame.odom_from_base)
        pose = self.make("geometry_msgs/msg/Pose", position=self.make("geometry_msgs/msg/Point", **position), orientation=rotation)
        rate_hz = 1.0 / frame.seconds if frame.seconds > 0.0 else 0.0
        to_base = frame.step[:3, :3].T  # the step is in the axes of the frame before
        twist = self.make("geometry_msgs/msg/Twist", **{
            name: self.make("geometry_msgs/msg/Vector3", **dict(zip("xyz", rate_hz * vector)))
            for name, vector in (("linear", to_base @ frame.step[:3, 3]), ("angular", rotation_vector(frame.step[:3, :3])))})
        self.put("/odometry", frame.time_ns, self.make(
            "nav_msgs/msg/Odometry", header=self.header(frame.time_ns, "odom"), child_frame_id="base_link",
            pose=self.make("geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=frame.covariance.ravel()),
            twist=self.make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.diag(rate_hz**2 * frame.step_variances).ravel())))

    def put_image(self, time_ns, image, camera):
        data = io.BytesIO()
        PIL.Image.fromarray(image).save(data, "jpeg", quality=90)
        header = self.header(time_ns, "camera_optical")
        self.put("/camera/image/compressed", time_ns, self.make("sensor_msgs/msg/CompressedImage", header=header, format="jpeg", data=np.frombuffer(data.getvalue(), np.uint8)))
        region = self.make("sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
        k = np.array([[camera.fx, 0.0, camera.cx], [0.0, camera.fy, camera.cy], [0.0, 0.0, 1.0]])
        self.put("/camera/camera_info", time_ns, self.make(
            "sensor_msgs/msg/CameraInfo", header=header, height=camera.height, width=camera.width, distortion_model="plumb_bob", d=np.zeros(5), k=k.ravel(),
            r=np.eye(3).ravel(), p=np.hstack([k, np.zeros((3, 1))]).ravel(), binning_x=0, binning_y=0, roi=region))

    def put_landmarks(self, time_ns, xyz, rgb):
        points = np.zeros(len(xyz), np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rgb", "<u4")]))
        points["x"], points["y"], points["z"] = xyz.T
        points["rgb"] = rgb.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)
        fields = [self.make("sensor_msgs/msg/PointField", name=name, offset=4 * i, datatype=7, count=1) for i, name in enumerate(points.dtype.names)]  # FLOAT32
        self.put("/landmarks", time_ns, self.make(
            "sensor_msgs/msg/PointCloud2", header=self.header(time_ns, "map"), height=1, width=len(points), fields=fields, is_bigendian=False, point_step=16,
            row_step=16 * len(points), data=points.view(np.uint8), is_dense=True), LATCHED)


def write_result(result, out, open_recording=None):
    """Frames written. `open_recording(first, count)` gives (image, time) pairs and a `camera` without distortion."""
    first, frames = read_frames(result)
    recording = open_recording(first, len(frames)) if open_recording else None
    if recording:
        check_recording(result, frames, recording)
    unfinished = out.parent / f"{out.name}.unfinished"
    shutil.rmtree(unfinished, ignore_errors=True)
    try:
        with rosbags.rosbag2.Writer(unfinished, version=9, storage_plugin=rosbags.rosbag2.StoragePlugin.MCAP) as writer:
            topics = Topics(writer)
            start_ns = frames[0].time_ns
            optical = topics.transform(start_ns, "base_link", "camera_optical", rigid(BODY_FROM_OPTICAL, np.zeros(3)))
            topics.put("/tf_static", start_ns, topics.make("tf2_msgs/msg/TFMessage", transforms=[optical]), LATCHED)
            if (result / "map.ply").exists():
                topics.put_landmarks(start_ns, *read_landmarks(result / "map.ply"))
            for index, frame in enumerate(frames):
                image = recording[index][0] if recording else None
                if image is not None:
                    topics.put_image(frame.time_ns, image, recording.camera)
                topics.put_frame(frame)
        next(unfinished.glob("*.mcap")).rename(out)
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)
    return len(frames)


def is_result(folder):
    return (pathlib.Path(folder) / "frames.csv").is_file()
