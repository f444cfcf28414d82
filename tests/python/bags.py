# SPDX-License-Identifier: MIT
"""Bags of ROS 1 and 2 and MCAP of given images, and `python -m stemvo.bag` on them."""

import contextlib
import io
import pathlib
import sys

import numpy as np
import PIL.Image
import rosbags.rosbag1
import rosbags.rosbag2
from rosbags.typesys import Stores, get_typestore

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "python/stemvo"))  # the file alone: it needs no built module

import bag as bag_module  # noqa: E402


def samples(pixels, encoding):
    """Rows of samples of RGB or gray pixels."""
    gray = pixels if pixels.ndim == 2 else pixels[:, :, 1]
    color = pixels if pixels.ndim == 3 else np.repeat(pixels[:, :, None], 3, axis=2)
    full = np.full((*gray.shape, 1), 255, np.uint8)
    return {"rgb8": color, "bgr8": color[:, :, ::-1], "rgba8": np.dstack([color, full]), "bgra8": np.dstack([color[:, :, ::-1], full]),
            "mono8": gray, "mono16": gray.astype("<u2") * 257}.get(encoding, color)


def write(file, kind, images, stamps_ns, matrix, encoding="rgb8", topic="/cam0/image_raw", info=True, model="plumb_bob", **said):
    """`images`: RGB or gray, 8 bits; `encoding` may be jpeg or png; `said` goes before what camera_info says."""
    height, width = images[0].shape[:2]
    is_ros1 = kind == "bag"
    store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
    if is_ros1:
        writer = rosbags.rosbag1.Writer(file)
    else:
        writer = rosbags.rosbag2.Writer(file, version=9, storage_plugin=getattr(rosbags.rosbag2.StoragePlugin, kind.upper()))
    types = store.types
    image_type = "sensor_msgs/msg/CompressedImage" if encoding in {"jpeg", "png"} else "sensor_msgs/msg/Image"
    first_ns = stamps_ns[0]

    def header(time_ns):
        stamp = types["builtin_interfaces/msg/Time"](sec=time_ns // 10**9, nanosec=time_ns % 10**9)
        return types["std_msgs/msg/Header"](**({"seq": 0} if is_ros1 else {}), stamp=stamp, frame_id="cam")

    def put(connection, time_ns, message, name):
        raw = store.serialize_ros1(message, name) if is_ros1 else store.serialize_cdr(message, name)
        writer.write(connection, time_ns, raw)

    with writer:
        connection = writer.add_connection(topic, image_type, typestore=store)
        if info:
            region = types["sensor_msgs/msg/RegionOfInterest"](x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
            matrices = {"d": np.zeros(5), "k": np.array(matrix), "r": np.eye(3).ravel(), "p": np.zeros(12), "binning_x": 0, "binning_y": 0, "roi": region, **said}
            message = types["sensor_msgs/msg/CameraInfo"](header=header(first_ns), height=height, width=width, distortion_model=model,
                                                         **{(key.upper() if is_ros1 and len(key) == 1 else key): value for key, value in matrices.items()})
            put(writer.add_connection("/cam0/camera_info", "sensor_msgs/msg/CameraInfo", typestore=store), first_ns, message, "sensor_msgs/msg/CameraInfo")
        for index, (pixels, time_ns) in enumerate(zip(images, stamps_ns)):
            if encoding in {"jpeg", "png"}:
                data = io.BytesIO()
                PIL.Image.fromarray(pixels).save(data, encoding, quality=95)
                message = types[image_type](header=header(time_ns), format=f"rgb8; {encoding} compressed bgr8", data=np.frombuffer(data.getvalue(), np.uint8))
            else:
                found = np.ascontiguousarray(samples(pixels, encoding)).reshape(height, -1).view(np.uint8)
                padded = np.pad(found, ((0, 0), (0, 6)))  # drivers align rows
                message = types[image_type](header=header(time_ns), height=height, width=width, encoding=encoding, is_bigendian=0, step=padded.shape[1], data=padded.ravel())
            put(connection, first_ns + index * 10**8, message, image_type)
    return file


def convert(*arguments):
    """Exit code, output, complaints."""
    with contextlib.redirect_stdout(io.StringIO()) as said, contextlib.redirect_stderr(io.StringIO()) as complaints:
        code = bag_module.main([str(argument) for argument in arguments])
    return code, said.getvalue(), complaints.getvalue()
