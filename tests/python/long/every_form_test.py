# SPDX-License-Identifier: MIT
"""One drive in every form of camera file and recording that the program reads: its trajectory is that of the plain form, byte for byte where
the pixels and times are the same. A rendered drive in colours, and KITTI's 06 in gray, as it was recorded."""

import json
import os
import pathlib
import shutil
import subprocess

import bags
import cv2
import numpy as np
import pytest
import scipy.spatial.transform

PROGRAM = os.environ.get("STEMVO_PROGRAM", str(pathlib.Path(__file__).resolve().parents[3] / "build/release/stemvo"))
FRAMES = 10
QUALITY = [cv2.IMWRITE_JPEG_QUALITY, 95]
FIRST_NS = 1_700_000_000_000_000_000
LENSES = {
    "none": ("none", []),
    "radial-tangential": ("radial-tangential", [-0.05, 0.01, 0.0005, -0.0003]),
    "with k3": ("radial-tangential", [-0.05, 0.01, 0.0005, -0.0003, 0.002]),
    "rational": ("radial-tangential", [-0.05, 0.01, 0.0005, -0.0003, 0.002, 0.01, -0.002, 0.001]),
    "thin prism": ("radial-tangential", [-0.05, 0.01, 0.0005, -0.0003, 0.002, 0.01, -0.002, 0.001, 1e-4, 2e-4, -1e-4, 3e-4]),
    "equidistant": ("equidistant", [-0.02, 0.004, -0.001, 0.0005]),
}


def compare(poses, expected, apart_m=0):
    """0: byte for byte."""
    if apart_m == 0:
        assert poses == expected
    else:
        there, here = (np.loadtxt(text.splitlines())[:, 3::4] for text in (poses, expected))
        np.testing.assert_allclose(there, here, rtol=0, atol=apart_m)


def rows(key, numbers):
    """A list as YAML writes it below its key."""
    return f"{key}: []\n" if len(numbers) == 0 else f"{key}:\n" + "".join(f"- {number}\n" for number in numbers)


class Drive:
    def __init__(self, folder, sequence):
        self.folder, self.count = folder, 0
        self.images = sorted(next(sequence.glob("image_[02]")).glob("*.png"))[:FRAMES]
        self.times = [float(time) for time in (sequence / "times.txt").read_text(encoding="utf-8").split()[:FRAMES]]
        self.pixels = [cv2.imread(str(image), cv2.IMREAD_UNCHANGED) for image in self.images]
        self.is_gray = self.pixels[0].ndim == 2
        self.height, self.width = self.pixels[0].shape[:2]
        self.poses = sequence.parents[1] / f"poses/{sequence.name}.txt"
        self.row = "P0:" if self.is_gray else "P2:"
        numbers = next(line for line in (sequence / "calib.txt").read_text(encoding="utf-8").splitlines() if line.startswith(self.row)).split()
        # COLMAP adds half a pixel: a number that loses nothing by it.
        fx, cx, fy, cy = (round(float(numbers[i]) * 64) / 64 for i in (1, 3, 6, 7))
        self.focal, self.centre = (fx, fy), (cx, cy)
        self.matrix = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]
        self.known = {}

    def run(self, source, *more, scale="camera_height", frames=FRAMES):
        """The trajectory as text."""
        self.count += 1
        out = self.result = self.folder / f"result_{self.count}"
        done = subprocess.run([PROGRAM, "run", source, "--out", out, "--set", f"scale.source={scale}", "--frames", f":{frames}", *more], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        text = (out / "trajectory_kitti.txt").read_text(encoding="utf-8")
        assert text.count("\n") == frames and np.ptp(np.loadtxt(text.splitlines())[:, 11]) > 1, "the camera has moved"
        self.stamps = np.loadtxt(out / "trajectory_tum.txt")[:, 0]
        return text

    def new(self, name="drive"):
        self.count += 1
        folder = self.folder / f"{self.count}" / name
        folder.mkdir(parents=True)
        return folder

    def put(self, folder, names, pixels=None, **options):
        """Images of these names: the same files, or new ones of these pixels."""
        folder.mkdir(parents=True, exist_ok=True)
        for i in range(FRAMES):
            if pixels is None:
                shutil.copy(self.images[i], folder / names(i))
            else:
                assert cv2.imwrite(str(folder / names(i)), pixels[i], **options)
        return folder

    def camera(self, folder, more="", model="none", coefficients=(), name="camera.yaml"):
        (folder / name).write_text(f"resolution: [{self.width}, {self.height}]\nintrinsics: {[*self.focal, *self.centre]}\ndistortion_model: {model}\n"
                                   f"distortion_coefficients: {list(coefficients)}\n{more}", encoding="utf-8")
        return folder / name

    def kitti(self, row=None, unit=1, calib="calib.txt"):
        folder = self.new("00")
        self.put(folder / ("image_0" if self.is_gray else "image_2"), lambda i: f"{i:06}.png")
        numbers = np.column_stack([np.reshape(self.matrix, (3, 3)), np.zeros(3)]).ravel()
        (folder / calib).write_text(f"{row or self.row} " + " ".join(map(repr, map(float, numbers))) + "\n", encoding="utf-8")
        (folder / "times.txt").write_text("".join(f"{time * unit!r}\n" for time in self.times), encoding="utf-8")
        return folder

    def plain(self):
        """The trajectory of KITTI's layout."""
        if "plain" not in self.known:
            self.known["plain"] = self.run(self.kitti())
        return self.known["plain"]

    def own(self, more="", pixels=None, suffix=".png", times=True, inside="", **options):
        """A folder of images with camera.yaml."""
        folder = self.new()
        self.put(folder / inside, lambda i: f"{i:06}{suffix}", pixels, **options)
        self.camera(folder, more)
        if times:
            self.write_times(folder / "times.txt")
        return folder

    def write_times(self, file, unit=1, end="\n", first=""):
        file.write_bytes((first + "".join(f"{time * unit!r}{end}" for time in self.times)).encode())
        return file

    def even(self):
        """Of the same images, ten a second."""
        if "even" not in self.known:
            self.known["even"] = self.run(self.own("rate_hz: 10\n", times=False))
        return self.known["even"]

    def video(self, name, codec="FFV1"):
        file = self.new() / name
        writer = cv2.VideoWriter(str(file), cv2.VideoWriter_fourcc(*codec), 10.0, (self.width, self.height))
        assert writer.isOpened()
        for pixels in self.pixels:
            writer.write(cv2.cvtColor(pixels, cv2.COLOR_GRAY2BGR) if self.is_gray else pixels)
        writer.release()
        return [file, "--camera", self.camera(file.parent)]

    def stream_of(self, suffix):
        """Images behind one another, as in a pipe."""
        file = self.new() / ("drive" + {".png": ".mkv", ".jpg": ".mjpeg"}[suffix])
        file.write_bytes(b"".join(cv2.imencode(suffix, image)[1].tobytes() for image in self.pixels))
        return [file, "--camera", self.camera(file.parent, "rate_hz: 10\n")]

    def stamps_ns(self, first_ns=0):
        return [first_ns + round(time * 1e9) for time in self.times]

    def euroc(self, camera="cam0", first_ns=0, inside="", in_s=False):
        folder = self.new() / f"MH/mav0/{camera}"
        stamps = self.times if in_s else self.stamps_ns(first_ns)

        def stamp(i):
            return f"{stamps[i]!r}"

        self.put(folder / "data", lambda i: f"{stamp(i)}.png")
        (folder / "data.csv").write_text("#timestamp,filename\n" + "".join(f"{stamp(i)},{stamp(i)}.png\r\n" for i in range(FRAMES)), encoding="utf-8")
        self.camera(folder, "sensor_type: camera\ncomment: left\nrate_hz: 20\nT_BS:\n  cols: 4\n  rows: 4\n  data: [0, 0, 1, 3, -1, 0, 0, 4, 0, -1, 0, 5, 0, 0, 0, 1]\n", name="sensor.yaml")
        return folder.parents[1] / inside

    def tum(self, between=" ", unit=1):
        folder = self.new("desk")
        self.put(folder / "rgb", lambda i: f"{self.times[i]:.6f}.png")
        (folder / "rgb.txt").write_text("# timestamp filename\n" + "".join(f"{time * unit!r}{between}rgb/{time:.6f}.png\n" for time in self.times), encoding="utf-8")
        self.camera(folder)
        return folder

    def bag(self, kind, encoding, gray=None, first_ns=0):
        folder = self.new()
        file = folder / ("drive.bag" if kind == "bag" else "drive")
        pixels = gray or self.pixels if self.is_gray or gray else [image[:, :, ::-1] for image in self.pixels]
        bags.write(file, kind, pixels, self.stamps_ns(first_ns), self.matrix, encoding=encoding)
        bags.convert(file, folder / "out")
        return folder / "out"


@pytest.fixture(scope="module", params=["rendered", "06"])
def drive(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp("of")
    if request.param == "rendered":
        subprocess.run([PROGRAM, "synth", folder / "made", "--frames", str(FRAMES), "--width", "320", "--height", "96"], check=True, capture_output=True)
        return Drive(folder, folder / "made/sequences/00")
    if "STEMVO_SHARED_DATA" not in os.environ:
        pytest.skip("STEMVO_SHARED_DATA is not set")
    return Drive(folder, pathlib.Path(os.environ["STEMVO_SHARED_DATA"]) / "kitti/sequences/06")


@pytest.fixture(autouse=True)
def clear(drive):
    """Recordings and results of 128 cases would fill a small disk."""
    before = set(drive.folder.iterdir())
    yield
    for folder in set(drive.folder.iterdir()) - before:
        shutil.rmtree(folder)


def camera_files(drive, model, k):
    """Name of the form, of the file, and its text."""
    (fx, fy), (cx, cy), matrix, size = drive.focal, drive.centre, drive.matrix, (drive.width, drive.height)
    is_fisheye, padded = model == "equidistant", [*k, *[0.0] * 8][:max(8, len(k))]
    ros = "equidistant" if is_fisheye else "plumb_bob" if len(k) < 6 else "rational_polynomial"
    sides = f"image_width: {size[0]}\nimage_height: {size[1]}\n"
    for name in {"none": ["plumb_bob", "none"], "equidistant": ["equidistant", "fisheye"]}.get(model, ["radtan", ros, "rational_polynomial"]):
        if model == "none" and name == "plumb_bob":
            k = [0.0] * 4
        yield f"ours, {name}", "camera.yaml", f"{sides}camera_model: pinhole\nintrinsics: {[fx, fy, cx, cy]}\ndistortion_model: {name}\ndistortion_coefficients: {k if name != 'none' else []}\n"
    chain = "camera_model: pinhole\n  intrinsics: {}\n  distortion_model: {}\n  distortion_coeffs: {}\n  resolution: {}\n  rostopic: /cam0/image_raw\n"
    if len(k) == 4:
        yield "Kalibr", "camchain.yaml", "cam0:\n  cam_overlaps: []\n  " + chain.format([fx, fy, cx, cy], "equidistant" if is_fisheye else "radtan", k, list(size))

    def opencv(numbers, shape):
        return f"rows: {shape[0]}\n   cols: {shape[1]}\n   dt: d\n   data: {numbers}\n"

    numbers = k if is_fisheye else [*k, *[0.0] * 14][:5 if len(k) < 6 else 14]
    flag = "fisheye_model: 1\n" if is_fisheye else "flags: 0\n"
    yield "OpenCV", "camera.yml", ("%YAML:1.0\n---\n" + sides + flag + "camera_matrix: !!opencv-matrix\n   " + opencv(matrix, (3, 3)) +
                                   "distortion_coefficients: !!opencv-matrix\n   " + opencv(numbers, (len(numbers), 1)))
    ros_numbers = k if is_fisheye or len(k) == 12 else padded
    yield "ROS calibrator", "ost.yaml", (f"{sides}camera_name: head\ncamera_matrix:\n   " + opencv(matrix, (3, 3)) + f"distortion_model: {ros}\ndistortion_coefficients:\n   " +
                                         opencv(ros_numbers, (1, len(ros_numbers))) + "rectification_matrix:\n   " + opencv(list(np.eye(3).ravel().tolist()), (3, 3)) +
                                         "projection_matrix:\n   " + opencv([0.0] * 12, (3, 4)))
    for capital in (False, True):
        def key(name):
            return name.upper() if capital else name
        head = "header:\n  stamp:\n    sec: 1\n    nanosec: 2\n  frame_id: head\n"
        tail = "binning_x: 0\nbinning_y: 0\nroi:\n  x_offset: 0\n  y_offset: 0\n  height: 0\n  width: 0\n  do_rectify: false\n---\n"
        for form in (rows, lambda name, numbers: f"{name}: {list(numbers)}\n"):
            yield f"ROS {2 - capital} message", "info.yaml", (f"{head}height: {size[1]}\nwidth: {size[0]}\ndistortion_model: {ros}\n" + form(key("d"), [] if model == "none" else k) +
                                                             form(key("k"), matrix) + form(key("r"), np.eye(3).ravel().tolist()) + form(key("p"), [0.0] * 12) + tail)
    colmap = {("none", 0): ["PINHOLE"], ("radial-tangential", 4): ["OPENCV"], ("radial-tangential", 8): ["FULL_OPENCV"], ("equidistant", 4): ["OPENCV_FISHEYE"]}
    for name in colmap.get((model, len(k) if model != "none" else 0), []):
        numbers = [fx, fy, cx + 0.5, cy + 0.5, *(k if model != "none" else [])]
        yield f"COLMAP {name}", "cameras.txt", f"# Camera list\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n1 {name} {size[0]} {size[1]} " + " ".join(map(repr, numbers)) + "\n"


@pytest.mark.parametrize("lens", LENSES)
@pytest.mark.parametrize("drive", ["rendered"], indirect=True, scope="module")  # a camera file is read alike for colours and gray
def test_camera_files(drive, lens):
    model, k = LENSES[lens]
    recording = drive.put(drive.new(), lambda i: f"{i:06}.png")
    times = drive.write_times(recording / "times.txt")

    def poses(camera):
        return drive.run(recording, "--camera", camera, "--times", times, frames=4)

    expected = poses(drive.camera(drive.new(), "", model, k))
    assert drive.plain().startswith(expected) == (lens == "none")
    differ = []
    for name, file, text in camera_files(drive, model, k):
        path = drive.new() / file
        path.write_text(text, encoding="utf-8")
        if poses(path) != expected:
            differ.append(name)
    assert not differ


def listed(drive, names, pattern=None, **options):
    """Images alone; camera and times are named."""
    folder = drive.put(drive.new(), names, **options)
    return [f"{folder}/{pattern}" if pattern else folder, "--camera", drive.camera(drive.new()), "--times", drive.write_times(drive.new() / "times.txt")]


def beside_another(drive):
    """Two cameras in one folder."""
    words = listed(drive, lambda i: f"left_{i}.png", "left_*.png")
    drive.put(pathlib.Path(words[0]).parent, lambda i: f"right_{i}.png", [image[:, ::-1] for image in drive.pixels])
    return words


def timed(drive, **options):
    words = listed(drive, lambda i: f"{i:06}.png")
    drive.write_times(words[-1], **options)
    return words


def with_alpha(pixels):
    return np.dstack([cv2.cvtColor(pixels, cv2.COLOR_GRAY2BGR) if pixels.ndim == 2 else pixels, np.full(pixels.shape[:2], 255, np.uint8)])


def bound_m(drive, form):
    """Gray levels that are summed of three equal colours are rounded."""
    return 2e-5 if drive.is_gray and any(word in form for word in ("alpha", "FFV1", "PNG behind", "rgb", "bgr")) else 0


RECORDINGS = {
    "KITTI's raw data": lambda d: [d.kitti(d.row.replace("P", "P_rect_0"))],
    "--calib": lambda d: [d.kitti(calib="other.txt"), "--calib", d.folder / str(d.count) / "00/other.txt"],
    "KITTI, times in ms": lambda d: [d.kitti(unit=1e3)],
    "--stream": lambda d: [d.kitti(), "--stream"],
    "own folder": lambda d: [d.own()],
    "own folder with images/": lambda d: [d.own(inside="images")],
    "--camera and --times": lambda d: listed(d, lambda i: f"{i:06}.png"),
    "a pattern": beside_another,
    "numbers without zeros": lambda d: listed(d, lambda i: f"frame{i + 7}.png"),
    "numbers of other lengths behind others": lambda d: listed(d, lambda i: f"cam2_{i + 93}_rect.PNG"),
    "names that are seconds": lambda d: listed(d, lambda i: f"{d.times[i]:.3f}.png"),
    "names that are times of day": lambda d: listed(d, lambda i: f"23-59-{54 + i}.png" if i < 6 else f"24-00-{i - 6:02}.png"),
    "times in ms": lambda d: timed(d, unit=1e3),
    "times in us, lines of Windows": lambda d: timed(d, unit=1e6, end="\r\n"),
    "times in ns, a comment and commas": lambda d: timed(d, unit=1e9, end=",\n", first="# time\n"),
    "EuRoC": lambda d: [d.euroc()],
    "EuRoC's mav0": lambda d: [d.euroc(inside="mav0")],
    "EuRoC's cam1": lambda d: [d.euroc("cam1", inside="mav0/cam1/")],
    "EuRoC since 1970": lambda d: [d.euroc(first_ns=FIRST_NS)],
    "EuRoC in seconds": lambda d: [d.euroc(in_s=True)],
    "TUM": lambda d: [d.tum()],
    "TUM with commas": lambda d: [d.tum(between=",")],
    "TUM in ms": lambda d: [d.tum(unit=1e3)],
    "PNG without compression": lambda d: [d.own(pixels=d.pixels, params=[cv2.IMWRITE_PNG_COMPRESSION, 0])],
    "PNG with alpha": lambda d: [d.own(pixels=[with_alpha(pixels) for pixels in d.pixels])],
    **{f"bag: {kind}, {encoding}": lambda d, kind=kind, encoding=encoding: [d.bag(kind, encoding)]
       for kind, encoding in [("bag", "bgr8"), ("sqlite3", "rgb8"), ("mcap", "rgba8"), ("bag", "bgra8"), ("mcap", "png")]},
    "bag since 1970": lambda d: [d.bag("bag", "mono8" if d.is_gray else "rgb8", first_ns=FIRST_NS)],
}


@pytest.mark.parametrize("form", RECORDINGS)
def test_recordings(drive, form):
    poses = drive.run(*RECORDINGS[form](drive))
    stamps = drive.stamps
    expected = drive.plain()
    # Seconds since 1970 are numbers with steps of 2.4e-7 s.
    compare(poses, expected, 0.01 if "1970" in form else bound_m(drive, form))
    np.testing.assert_allclose(stamps - stamps[0], drive.times, atol=2e-6)


EVEN = {
    "--rate": lambda d: [d.own(times=False), "--rate", "10"],
    "FFV1 in AVI": lambda d: d.video("drive.avi"),
    "FFV1 in Matroska": lambda d: d.video("drive.mkv"),
    "PNG behind one another": lambda d: d.stream_of(".png"),
}


@pytest.mark.parametrize("form", EVEN)
def test_ten_a_second(drive, form):
    poses = drive.run(*EVEN[form](drive))
    compare(poses, drive.even(), bound_m(drive, form))


def test_jpeg_behind_one_another(drive):
    poses = drive.run(*drive.stream_of(".jpg"), scale="none")
    compare(poses, drive.run(drive.own("rate_hz: 10\n", times=False), scale="none"), 0.15)


@pytest.mark.parametrize("form", ["jpg", "JPEG", "bag"])
def test_jpeg(drive, form):
    """As a PNG of what the JPEG is decoded to."""
    recording = drive.bag("bag", "jpeg") if form == "bag" else drive.own(pixels=drive.pixels, suffix=f".{form}", params=QUALITY)
    images = sorted(recording.rglob("*.j*g" if form != "JPEG" else "*.JPEG"), key=lambda image: int(image.stem))
    poses = drive.run(recording)
    compare(poses, drive.run(drive.own(pixels=[cv2.imread(str(image), cv2.IMREAD_UNCHANGED) for image in images])))


@pytest.mark.parametrize("form", ["10 bits", "12 bits", "16 bits", "mono16", "mono8"])
def test_gray_levels(drive, form):
    gray = [pixels if drive.is_gray else cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY) for pixels in drive.pixels]
    if form.startswith("mono"):
        recording = drive.bag("bag", form, gray)
    else:
        top = 2 ** int(form.split()[0]) - 1
        recording = drive.own(pixels=[np.round(pixels * (top / 255)).astype(np.uint16) for pixels in gray])
    poses = drive.run(recording)
    if "gray" not in drive.known:
        drive.known["gray"] = drive.run(drive.own(pixels=gray))
    compare(poses, drive.known["gray"])


@pytest.mark.parametrize("form", ["KITTI", "KITTI with commas", "TUM", "TUM with commas", "EuRoC"])
def test_ground_truth(drive, form):
    truth = np.loadtxt(drive.poses).reshape(-1, 3, 4)[:FRAMES]
    if form.startswith("KITTI"):
        table = truth.reshape(-1, 12).tolist()
    else:
        turns = [(w, x, y, z) for x, y, z, w in scipy.spatial.transform.Rotation.from_matrix(truth[:, :, :3]).as_quat().tolist()]
        table = [[time, *pose[:, 3], *(turn if form == "EuRoC" else [*turn[1:], turn[0]])] for time, pose, turn in zip(drive.stamps_ns() if form == "EuRoC" else drive.times, truth, turns)]
    file = drive.new() / "truth.txt"
    between = "," if "commas" in form or form == "EuRoC" else " "
    first = "#timestamp [ns],..\n" if form == "EuRoC" else ""
    file.write_text(first + "".join(between.join(map(str, row)) + "\n" for row in table), encoding="utf-8")
    drive.run(drive.own("T_BS: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0]\n"), "--gt", file)
    found = json.loads((drive.result / "metrics.json").read_text(encoding="utf-8"))["ate_rmse_m"]["sim3"]
    assert found == pytest.approx(drive.known.setdefault("error", found), rel=1e-6)
