# SPDX-License-Identifier: MIT
"""Makes a folder in EuRoC's layout of a camera in a ROS 1 bag, a ROS 2 bag or an MCAP file: `stemvo run FOLDER` takes it. Needs no ROS.
Of what `stemvo run` wrote it makes an MCAP file, that ROS 2 tools play and draw.

Compressed images stay the bytes they are. The camera is that of the camera_info topic beside the images', or --camera FILE.
"""

import argparse
import pathlib
import re
import shutil
import sys

import numpy as np

try:
    import PIL.Image
    import rosbags.highlevel
    import rosbags.typesys
    if __package__:
        from . import result_bag
    else:
        import result_bag  # beside this file
except ImportError as error:
    if __name__ != "__main__":
        raise
    sys.exit(f"error: expected the package {error.name}: pip install 'stemvo[bag]', or '.[bag]' in a checkout")

IMAGE_TYPES = ("sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage")
# Encoding: type of a sample, channels, order of those that are kept.
ENCODINGS = {"mono8": (np.uint8, 1, (0,)), "8UC1": (np.uint8, 1, (0,)), "mono16": (np.uint16, 1, (0,)), "16UC1": (np.uint16, 1, (0,)),
             "rgb8": (np.uint8, 3, (0, 1, 2)), "bgr8": (np.uint8, 3, (2, 1, 0)), "8UC3": (np.uint8, 3, (2, 1, 0)),
             "rgba8": (np.uint8, 4, (0, 1, 2)), "bgra8": (np.uint8, 4, (2, 1, 0))}
# Their name of a model: ours, the numbers of coefficients it may have.
MODELS = {"plumb_bob": ("radial-tangential", (4, 5)), "rational_polynomial": ("radial-tangential", (4, 5, 8, 12)),
          "equidistant": ("equidistant", (4,)), "fisheye": ("equidistant", (4,))}
RECTIFIED = re.compile(r"(^|[/_])(rect(ified)?|undist(orted)?)([/_]|$)")  # image_rect, image_rect_color, color/rect/image, image_undistorted


class BagError(Exception):
    """What is wrong with the bag or the request, in one line."""


def stamp_ns(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def to_pixels(message):
    """Height x width (x 3, RGB) of 8 bit, or of 16."""
    if message.encoding not in ENCODINGS:
        raise BagError(f"expected images of encoding {', '.join(ENCODINGS)}, found '{message.encoding}'")
    kind, channels, order = ENCODINGS[message.encoding]
    sample = np.dtype(kind).newbyteorder(">" if message.is_bigendian else "<")
    row = message.width * channels * sample.itemsize
    data = np.asarray(message.data, np.uint8)
    if message.step < row or data.size < message.height * message.step or message.height * row == 0:
        raise BagError(f"expected {message.height} rows of {message.step} bytes for {message.width} {message.encoding} pixels, found {data.size} bytes")
    rows = data[:message.height * message.step].reshape(message.height, message.step)[:, :row]
    pixels = np.ascontiguousarray(rows).view(sample).reshape(message.height, message.width, channels)[:, :, order]
    return pixels.astype(kind).squeeze()


def write_image(message, kind, stem):
    """The file's name."""
    if kind.endswith("/Image"):
        PIL.Image.fromarray(to_pixels(message)).save(stem.with_suffix(".png"), compress_level=1)
        return stem.with_suffix(".png").name
    data = bytes(message.data)
    suffix = {b"\xff\xd8": ".jpg", b"\x89P": ".png"}.get(data[:2])
    if suffix is None:
        raise BagError(f"expected compressed images that are JPEG or PNG, found format '{message.format}'")
    stem.with_suffix(suffix).write_bytes(data)
    return stem.with_suffix(suffix).name


def choose_topic(reader, asked):
    found = sorted({c.topic for c in reader.connections if c.msgtype in IMAGE_TYPES})
    names = ", ".join(found) or "none"
    if asked is None and len(found) != 1:
        raise BagError(f"expected one topic of images, or --topic, found {names}")
    if asked is not None and asked not in found:
        raise BagError(f"expected a topic of images, found no '{asked}' among {names}")
    return asked or found[0]


def numbers(info, name):
    """Of a message of ROS 2, or of ROS 1, which writes it large."""
    return [float(x) for x in (getattr(info, name) if hasattr(info, name) else getattr(info, name.upper()))]


def camera_yaml(reader, topic):
    """sensor.yaml of the first camera_info beside the topic: /cam0/image_raw has /cam0/camera_info."""
    folder = topic.rsplit("/compressed", 1)[0].rsplit("/", 1)[0]
    wanted = (f"{folder}/camera_info", f"{topic}/camera_info")
    connections = [c for c in reader.connections if c.topic in wanted and c.msgtype == "sensor_msgs/msg/CameraInfo"]
    for connection, _, raw in reader.messages(connections) if connections else ():
        info = reader.deserialize(raw, connection.msgtype)
        matrix, lens, projection = numbers(info, "k"), numbers(info, "d"), numbers(info, "p")
        roi = info.roi
        if max(info.binning_x, info.binning_y) > 1 or roi.x_offset or roi.y_offset or (roi.width or info.width) != info.width or (roi.height or info.height) != info.height:
            raise BagError(f"{connection.topic}: expected the camera of whole images, found one with binning or a region of interest; see --camera")
        of_projection = [projection[0], 0.0, projection[2], 0.0, projection[5], projection[6]]
        if RECTIFIED.search(topic) and any(lens) and not projection[0] > 0.0:
            raise BagError(f"{connection.topic}: expected P, the camera of the rectified images of {topic}, found zeros; see --camera")
        if RECTIFIED.search(topic) and projection[0] > 0.0:
            matrix, lens = of_projection, []
            print(f"{connection.topic}: P without distortion, for {topic} is rectified", file=sys.stderr)
        elif any(lens) and projection[0] > 0.0 and not np.allclose(of_projection, matrix[:6], atol=0.01):
            print(f"warning: {connection.topic}: K and D, for images as the sensor gives them; for rectified ones --camera with P", file=sys.stderr)
        model, counts = MODELS.get(info.distortion_model, (None, (0,)))
        lens, more = lens[:counts[-1]], lens[counts[-1]:]
        if any(more) or any(lens) and len(lens) not in counts:
            lens += more
            raise BagError(f"{connection.topic}: expected distortion_model plumb_bob or equidistant, found '{info.distortion_model}' of {len(lens)} coefficients; see --camera")
        if any(matrix[i] for i in (1, 3)):
            raise BagError(f"{connection.topic}: expected a camera without skew, found {matrix}; see --camera")
        if not matrix[0] > 0.0:
            raise BagError(f"{connection.topic}: expected a calibrated camera, found focal length {matrix[0]}; see --camera")
        return (f"# {connection.topic}\nresolution: [{info.width}, {info.height}]\nintrinsics: [{matrix[0]}, {matrix[4]}, {matrix[2]}, {matrix[5]}]\n"
                + (f"distortion_model: {model}\ndistortion_coefficients: {lens}\n" if any(lens) or (model == "equidistant" and lens) else "distortion_model: none\n"))
    raise BagError(f"expected messages of {' or '.join(wanted)}, or --camera FILE, found none")


def file_yaml(file, topic):
    """sensor.yaml of a camera file; of Kalibr's chain the camera whose rostopic is the images'."""
    text = file.read_text(encoding="utf-8")
    if not re.search(r"^[\s{]*[\"']?\w+[\"']?\s*:", text, re.MULTILINE):
        raise BagError(f"{file}: expected a camera file with keys and values (COLMAP's has rows), found none")
    cameras = re.split(r"^(?=cam\d+:)", text, flags=re.MULTILINE)[1:]
    if len(cameras) < 2:
        return text
    topics = [found.group(1) if (found := re.search(r"^\s+rostopic:\s*[\"']?([^\s\"']+)", camera, re.MULTILINE)) else "" for camera in cameras]
    wanted = topic.rsplit("/compressed", 1)[0]
    if topics.count(wanted) != 1:
        raise BagError(f"{file}: expected one camera with rostopic {wanted}, found {', '.join(filter(None, topics)) or 'none'}; give a file of one camera")
    return re.sub(r"^cam\d+", "cam0", cameras[topics.index(wanted)])


def convert(options, folder):
    """Images written, images left out."""
    default = rosbags.typesys.get_typestore(rosbags.typesys.Stores.ROS2_HUMBLE)  # ROS 2 bags before Iron say nothing of types
    with rosbags.highlevel.AnyReader([options.bag], default_typestore=default) as reader:
        topic = choose_topic(reader, options.topic)
        camera = folder / "mav0/cam0"
        (camera / "data").mkdir(parents=True)
        sensor = file_yaml(options.camera, topic) if options.camera else camera_yaml(reader, topic)
        (camera / "sensor.yaml").write_text(sensor, encoding="utf-8")
        last_ns, written, left_out = -1, 0, 0
        with (camera / "data.csv").open("w", encoding="utf-8") as table:
            table.write("#timestamp [ns],filename\n")
            for connection, bag_ns, raw in reader.messages([c for c in reader.connections if c.topic == topic]):
                message = reader.deserialize(raw, connection.msgtype)
                time_ns = stamp_ns(message) or bag_ns
                if time_ns <= last_ns:  # twice, or late: the order of the pictures is that of their times
                    left_out += 1
                    continue
                table.write(f"{time_ns},{write_image(message, connection.msgtype, camera / 'data' / str(time_ns))}\n")
                last_ns, written = time_ns, written + 1
    if written == 0:
        raise BagError(f"{topic}: expected at least one image, found none")
    if left_out > written:
        raise BagError(f"{topic}: expected stamps that rise, found {left_out} of {left_out + written} images of no later time than the one before")
    return written, left_out


def opener(options):
    if options.recording is None:
        return None
    if options.recording.is_file():
        raise BagError(f"--recording {options.recording}: expected a folder or a pattern of images, found a file; of a video "
                       f"'ffmpeg -i {options.recording} -fps_mode passthrough FOLDER/%06d.png' makes one, beside --camera")
    import stemvo

    return lambda first, count: stemvo.read_recording(options.recording, options.camera, frames=f"{first}:{first + count}")


def main(arguments=None):
    parser = argparse.ArgumentParser(prog="python -m stemvo.bag", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bag", type=pathlib.Path, help="a .bag file (ROS 1), a folder with metadata.yaml (ROS 2), an .mcap or .db3 file, or the --out of `stemvo run`")
    parser.add_argument("out", type=pathlib.Path, help="the folder to make, of a result the .mcap file; must not exist")
    parser.add_argument("--recording", type=pathlib.Path, help="of a result, as a folder or a pattern of images: its frames are written too")
    parser.add_argument("--topic", help="of the images; default: the only one")
    parser.add_argument("--camera", type=pathlib.Path, help="a camera file in place of the camera_info topic")
    options = parser.parse_args(arguments)
    unfinished = options.out.parent / f"{options.out.name}.unfinished"
    try:
        if not options.bag.exists():
            raise BagError("expected a bag, found nothing of that name; check the path")
        if options.out.exists():
            raise BagError(f"{options.out}: expected a name that does not exist, found one")
        if result_bag.is_result(options.bag):
            if options.out.suffix != ".mcap":
                raise BagError(f"{options.out}: expected a name that ends with .mcap, the only kind a result becomes")
            written = result_bag.write_result(options.bag, options.out, opener(options))
            print(f"{options.out}: {written} frames")
            return 0
        shutil.rmtree(unfinished, ignore_errors=True)
        written, left_out = convert(options, unfinished)
        unfinished.rename(options.out)
    except Exception as error:  # rosbags throws whatever a damaged file leads to
        shutil.rmtree(unfinished, ignore_errors=True)
        text = " ".join(str(error).replace("camera_file", "--camera").split())
        print(f"error: {options.bag}: {text or type(error).__name__}", file=sys.stderr)
        return 1
    print(f"{options.out}: {written} images" + (f"; {left_out} of no later time than the one before are left out" if left_out else ""))
    return 0


if __name__ == "__main__":
    sys.exit(main())
