# SPDX-License-Identifier: MIT
"""make_recordings.py FOLDER: of FOLDER/drive, a rendered one, the same frames as drive.avi (lossless) with camera.yaml, as folders in the layouts
of EuRoC and TUM, and as a ROS bag. Beside it: tests/python/bags.py,
and of python/stemvo bag.py and result_bag.py."""

import pathlib
import shutil
import sys

import bags
import cv2

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
    fx, fy, cx, cy = intrinsics
    bags.write(folder / "drive.bag", "bag", [image[:, :, ::-1] for image in images], times, [fx, 0, cx, 0, fy, cy, 0, 0, 1], "bgr8")


if __name__ == "__main__":
    main()
