# SPDX-License-Identifier: MIT
"""make_recordings.py FOLDER: of FOLDER/drive, a rendered one, the same frames as drive.avi (lossless) with camera.yaml, as folders in the layouts
of EuRoC and TUM, and as a ROS bag."""

import pathlib
import shutil
import sys

import cv2
import numpy as np
import rosbags.rosbag1
from rosbags.typesys import Stores, get_typestore

FIRST_NS, STEP_NS = 1_400_000_000_000_000_000, 100_000_000


def main():
    folder = pathlib.Path(sys.argv[1])
    sequence = folder / "drive/sequences/00"
    files = sorted((sequence / "image_2").glob("*.png"))
    images = [cv2.imread(str(file)) for file in files]
    height, width = images[0].shape[:2]
    p2 = next(line for line in (sequence / "calib.txt").read_text().splitlines() if line.startswith("P2:")).split()
    intrinsics = [float(p2[i]) for i in (1, 6, 3, 7)]
    camera = f"resolution: [{width}, {height}]\nintrinsics: {intrinsics}\ndistortion_model: none\n"
    (folder / "camera.yaml").write_text(camera)
    video = cv2.VideoWriter(str(folder / "drive.avi"), cv2.VideoWriter_fourcc(*"FFV1"), 10.0, (width, height))
    euroc, tum = folder / "euroc/mav0/cam0", folder / "tum"
    (euroc / "data").mkdir(parents=True)
    (tum / "rgb").mkdir(parents=True)
    (euroc / "sensor.yaml").write_text(camera)
    (tum / "camera.yaml").write_text(camera)
    times = [FIRST_NS + i * STEP_NS for i in range(len(files))]
    for file, image, time in zip(files, images, times):
        video.write(image)
        shutil.copy(file, euroc / f"data/{time}.png")
        shutil.copy(file, tum / f"rgb/{time}.png")
    video.release()
    (euroc / "data.csv").write_text("#timestamp [ns],filename\n" + "".join(f"{time},{time}.png\n" for time in times))
    (tum / "rgb.txt").write_text("".join(f"{1e-9 * time:.6f} rgb/{time}.png\n" for time in times))
    write_bag(folder / "drive.bag", images, times, intrinsics)


def write_bag(file, images, times, intrinsics):
    store = get_typestore(Stores.ROS1_NOETIC)
    types = store.types
    height, width = images[0].shape[:2]

    def header(time):
        return types["std_msgs/msg/Header"](seq=0, stamp=types["builtin_interfaces/msg/Time"](sec=time // 10**9, nanosec=time % 10**9), frame_id="camera")

    fx, fy, cx, cy = intrinsics
    region = types["sensor_msgs/msg/RegionOfInterest"](x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    info = types["sensor_msgs/msg/CameraInfo"](
        header=header(times[0]), height=height, width=width, distortion_model="plumb_bob", D=np.zeros(5), K=np.array([fx, 0, cx, 0, fy, cy, 0, 0, 1]),
        R=np.eye(3).ravel(), P=np.zeros(12), binning_x=0, binning_y=0, roi=region)
    with rosbags.rosbag1.Writer(file) as writer:
        kinds = {"image_raw": "sensor_msgs/msg/Image", "camera_info": "sensor_msgs/msg/CameraInfo"}
        topics = {name: writer.add_connection(f"/camera/{name}", kind, typestore=store) for name, kind in kinds.items()}
        writer.write(topics["camera_info"], times[0], store.serialize_ros1(info, kinds["camera_info"]))
        for image, time in zip(images, times):
            message = types[kinds["image_raw"]](header=header(time), height=height, width=width, encoding="bgr8", is_bigendian=0, step=3 * width, data=image.ravel())
            writer.write(topics["image_raw"], time, store.serialize_ros1(message, kinds["image_raw"]))


if __name__ == "__main__":
    main()
