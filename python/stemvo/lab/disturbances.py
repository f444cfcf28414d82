# SPDX-License-Identifier: MIT
"""Frames as they would be in worse light, weather or hands: 22 kinds at three strengths, the same for the same seed and frame."""

import math
import typing

import cv2
import numpy as np

import stemvo

WHOLE_DRIVE = 2**32 - 1  # frame of what stays the same over a drive
CALM_FRAMES = 30  # at the end of a drive, of short ones an eighth: how soon is the camera found again?


class At(typing.NamedTuple):
    """What an effect may depend on."""

    frame: int
    seed: int
    camera: stemvo.Camera

    @property
    def random(self):
        return np.random.default_rng([self.seed, self.frame])


class Disturbance(typing.NamedTuple):
    name: str
    group: str
    effect: str  # what happens, and what the strengths are
    strengths: tuple
    apply: typing.Callable | None = None  # (image, strength, At) -> image
    resample: typing.Callable | None = None  # (recording, strength, seed) -> frames in place of those
    is_on: typing.Callable | None = None  # (frame, strength); None: always

    def disturbs(self, frame, count, strength):
        return self.apply is None or (frame + min(CALM_FRAMES, count // 8) < count and (self.is_on is None or self.is_on(frame, strength)))


class Frames(typing.NamedTuple):
    """Frames `shown` of a recording, at the time and place of frames `kept`; `view` makes them those of `camera`."""

    shown: list
    kept: list
    camera: stemvo.Camera
    view: typing.Callable = lambda image: image


class Disturbed:
    """A recording as it is disturbed. Ground truth and times stay with their frames."""

    def __init__(self, recording, disturbance, index, seed=1):
        self._recording, self._how, self._strength, self._seed = recording, disturbance, disturbance.strengths[index], seed
        everything = list(range(len(recording)))
        self._frames = disturbance.resample(recording, self._strength, seed) if disturbance.resample else Frames(everything, everything, recording.camera)
        self.camera, self.ground_truth = self._frames.camera, recording.ground_truth[self._frames.kept]
        self.timestamps = recording.timestamps[self._frames.kept]

    def __len__(self):
        return len(self._frames.kept)

    def __getitem__(self, i):
        if i >= len(self):
            raise IndexError(i)
        image, time = self._recording[self._frames.shown[i]][0], float(self.timestamps[i])
        if image is not None and self._how.apply is None:
            image = self._frames.view(image)
        elif image is not None and self.is_disturbed(i):
            image = self._how.apply(image, self._strength, At(i, self._seed, self.camera))
        return image, time

    def is_disturbed(self, i):
        return self._how.disturbs(i, len(self), self._strength)


def _pixels(image, of_1242):
    """Sizes in pixels are those of a KITTI frame."""
    return of_1242 * image.shape[1] / 1242.0


def levels(values):
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def _map_levels(image, function):
    return cv2.LUT(image, levels(function(np.arange(256.0))))


def _blend(image, weight, gray):
    """weight * image + (1 - weight) * gray."""
    weight = np.asarray(weight, np.float32)
    weight = weight if image.ndim == 2 else weight[..., None]
    return levels((image.astype(np.float32) - np.float32(gray)) * weight + np.float32(gray))


def _texture(width, height, like, seed):
    """Smooth gray levels of a surface that nobody has seen: for things that pass by."""
    noise = At(WHOLE_DRIVE, seed, None).random.integers(256, size=(height // 4 + 2, width // 4 + 2), dtype=np.uint8)
    image = cv2.resize(noise, (width, height), interpolation=cv2.INTER_CUBIC)
    return image if like.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_GRAY2RGB)


def _vignette(image, strength, at):
    height, width = image.shape[:2]
    v, u = np.ogrid[: image.shape[0], : image.shape[1]]
    return _blend(image, 1.0 - strength * ((u - 0.5 * width) ** 2 + (v - 0.5 * height) ** 2) / ((0.5 * at.camera.width) ** 2 + (0.5 * at.camera.height) ** 2), 0.0)


def _dusk(image, strength, at):
    """A sensor of 4000 electrons at white and 3 electrons of read noise; photon noise is normal with Poisson's variance."""
    light = strength ** min(1.0, at.frame / 50.0)
    electrons = image * (light * 4000.0 / 255.0)
    return levels((electrons + np.sqrt(electrons + 9.0) * at.random.standard_normal(image.shape)) * 255.0 / (4000.0 * math.sqrt(light)))


def _motion_blur(image, strength, at):
    angle, length = at.random.uniform(0.0, math.pi), _pixels(image, strength)
    radius, samples = math.ceil(0.5 * length), max(1, int(4 * length))
    kernel = np.zeros((2 * radius + 1, 2 * radius + 1), np.float32)
    along = length * ((np.arange(samples) + 0.5) / samples - 0.5)
    np.add.at(kernel, (radius + np.rint(along * math.sin(angle)).astype(int), radius + np.rint(along * math.cos(angle)).astype(int)), 1.0)
    return cv2.filter2D(image, -1, kernel / kernel.sum(), borderType=cv2.BORDER_REFLECT)


def _jpeg(image, strength, at):
    swap = (lambda one: one) if image.ndim == 2 else (lambda one: one[..., ::-1])
    bytes_of = cv2.imencode(".jpg", swap(image), [cv2.IMWRITE_JPEG_QUALITY, int(strength)])[1]
    return np.ascontiguousarray(swap(cv2.imdecode(bytes_of, cv2.IMREAD_UNCHANGED)))


def _fog(image, strength, at):
    """Over a flat road 1.65 m below the camera, between walls 40 m away (Koschmieder's law: contrast falls with
    exp(-3.9 d / visibility))."""
    below = np.arange(image.shape[0]) - at.camera.cy
    road_m = np.where(below > 0.0, 1.65 * at.camera.fy / np.where(below > 0.0, below, 1.0), 40.0)
    return _blend(image, np.broadcast_to(np.exp(-3.9 * np.minimum(road_m, 40.0) / strength)[:, None], image.shape[:2]), 190.0)


def _rain(image, strength, at):
    random, streaks = at.random, np.zeros(image.shape[:2], np.uint8)
    for _ in range(round(strength * _pixels(image, 1.0) * image.shape[0] / 375.0)):
        u, v = random.uniform(0.0, image.shape[1]), random.uniform(-20.0, image.shape[0])
        length, lean = _pixels(image, random.uniform(10.0, 40.0)), random.uniform(0.10, 0.20)
        cv2.line(streaks, (round(u), round(v)), (round(u + length * lean), round(v + length)), int(random.integers(40, 120)), 1, cv2.LINE_AA)
    return _blend(image, 1.0 - streaks / 255.0, 220.0)


def _shadows(image, strength, at):
    v, u = np.ogrid[: image.shape[0], : image.shape[1]]
    is_shaded = np.fmod(u + 0.5 * v + _pixels(image, 9.0) * at.frame, _pixels(image, 280.0)) < _pixels(image, 140.0)
    weight = np.where(is_shaded, np.float32(1.0 - strength), np.float32(1.0))
    return _blend(image, cv2.GaussianBlur(weight, (0, 0), _pixels(image, 2.0)), 0.0)


def _dirt(image, strength, at):
    random, weight = at._replace(frame=WHOLE_DRIVE).random, np.ones(image.shape[:2], np.float32)
    while 1.0 - weight.mean() < strength:
        center = int(random.integers(image.shape[1])), int(random.integers(image.shape[0]))
        cv2.circle(weight, center, int(_pixels(image, random.uniform(10.0, 45.0))), 0.0, cv2.FILLED)
    return _blend(image, cv2.GaussianBlur(weight, (0, 0), _pixels(image, 5.0)), 60.0)


def _occluder(image, strength, at):
    height, width = image.shape[:2]
    size = int(strength * width)
    left = round((at.frame % 60 - 20) / 29 * (width + size)) - size
    first, last = max(left, 0), min(left + size, width)
    image = image.copy()
    if first < last:
        image[:, first:last] = _texture(size, height, image, at.seed)[:, first - left : last - left]
    return image


def _moving_third(image, strength, at):
    height, width = image.shape[0], image.shape[1] // 3
    shift = round(abs(math.fmod(_pixels(image, strength) * at.frame, 2.0 * width) - width))
    image = image.copy()
    image[:, width : 2 * width] = _texture(2 * width, height, image, at.seed)[:, shift : shift + width]
    return image


def _falls_out(i, share, seed):
    return i > 0 and At(i, seed, None).random.uniform() < share


def _kept(recording, kept):
    return Frames(kept, kept, recording.camera)


def _repeated(recording, share, seed):
    shown = list(range(len(recording)))
    for i in shown[1:]:
        shown[i] = shown[i - 1] if _falls_out(i, share, seed) else i
    return Frames(shown, list(range(len(recording))), recording.camera)


def _viewed(recording, share=1.0, factor=1.0):
    """Another camera's frames: the middle of the image, this share of its sides, resized."""
    camera = recording.camera
    width, height = int(share * camera.width), int(share * camera.height)
    left, top, size = (camera.width - width) // 2, (camera.height - height) // 2, (round(factor * width), round(factor * height))
    x, y = size[0] / width, size[1] / height
    made = stemvo.Camera(camera.fx * x, camera.fy * y, (camera.cx - left + 0.5) * x - 0.5, (camera.cy - top + 0.5) * y - 0.5, *size)

    def view(image):
        part = np.ascontiguousarray(image[top : top + height, left : left + width])
        return part if size == (width, height) else cv2.resize(part, size, interpolation=cv2.INTER_AREA)

    everything = list(range(len(recording)))
    return Frames(everything, everything, made, view)


ALL = (
    Disturbance("exposure_steps", "light", "gain jumps every 12 frames, up to this factor", (1.2, 1.5, 2.0),
                lambda image, factor, at: _map_levels(image, lambda level: level * factor ** at._replace(frame=at.frame // 12).random.uniform(-1.0, 1.0))),
    Disturbance("exposure_drift", "light", "gain swings slowly up to this factor", (1.5, 2.0, 3.0),
                lambda image, factor, at: _map_levels(image, lambda level: level * factor ** -math.sin(2.0 * math.pi * at.frame / 80.0))),
    Disturbance("gamma", "light", "gray levels to this power", (1.5, 2.2, 3.0), lambda image, power, at: _map_levels(image, lambda level: 255.0 * (level / 255.0) ** power)),
    Disturbance("vignette", "light", "this share of the light is lost in the corners", (0.3, 0.6, 0.9), _vignette),
    Disturbance("dusk", "noise", "the light falls to this share in 50 frames, photon and read noise; gain makes up for half of the stops", (0.1, 0.03, 0.01), _dusk),
    Disturbance("low_contrast", "light", "this share of the contrast is left", (0.5, 0.25, 0.1),
                lambda image, share, at: _map_levels(image, lambda level: 128.0 + share * (level - 128.0))),
    Disturbance("sensor_noise", "noise", "normal noise of this many gray levels", (6.0, 12.0, 24.0),
                lambda image, sigma, at: levels(image + sigma * at.random.standard_normal(image.shape))),
    Disturbance("gaussian_blur", "blur", "of this sigma, pixels of a frame 1242 wide", (1.0, 2.0, 3.0),
                lambda image, sigma, at: cv2.GaussianBlur(image, (0, 0), _pixels(image, sigma))),
    Disturbance("motion_blur", "blur", "along a line so long, of another direction in each frame", (5.0, 11.0, 21.0), _motion_blur),
    Disturbance("jpeg", "noise", "compressed at this quality", (30.0, 15.0, 7.0), _jpeg),
    Disturbance("fog", "weather", "visible so far, metres, on a flat road between walls 40 m away", (100.0, 50.0, 25.0), _fog),
    Disturbance("rain", "weather", "so many streaks per frame of 1242x375", (200.0, 600.0, 1500.0), _rain),
    Disturbance("shadows", "light", "bands that move over the image take this share of the light", (0.3, 0.5, 0.7), _shadows),
    Disturbance("dirt", "in the way", "blots on the lens over this share of the image", (0.05, 0.1, 0.2), _dirt),
    Disturbance("occluder", "in the way", "something passes before the camera, of this share of the image", (0.1, 0.2, 0.4), _occluder, None,
                lambda frame, share: 20 <= frame % 60 < 50),  # the first 20 of every 60 frames without
    Disturbance("moving_third", "in the way", "a third of the image moves on its own, pixels per frame", (2.0, 5.0, 10.0), _moving_third),
    Disturbance("blackout", "in the way", "no light in so many of 100 frames", (3.0, 10.0, 20.0),
                lambda image, count, at: np.zeros_like(image), None, lambda frame, count: 30 <= frame % 100 < 30 + int(count)),
    Disturbance("dropped", "other frames", "this share of the frames is missing", (0.05, 0.1, 0.2), None,
                lambda recording, share, seed: _kept(recording, [i for i in range(len(recording)) if not _falls_out(i, share, seed)])),
    Disturbance("repeated", "other frames", "this share of the frames shows the one before", (0.05, 0.1, 0.2), None, _repeated),
    Disturbance("every_nth", "other frames", "only every so many frames", (2.0, 3.0, 5.0), None,
                lambda recording, step, seed: _kept(recording, list(range(0, len(recording), int(step))))),
    Disturbance("cropped", "other views", "only the middle of the image, this share of its sides", (0.8, 0.6, 0.4), None,
                lambda recording, share, seed: _viewed(recording, share=share)),
    Disturbance("scaled", "other views", "the image made smaller by this factor", (0.75, 0.5, 0.35), None,
                lambda recording, factor, seed: _viewed(recording, factor=factor)),
)


def find(name):
    for one in ALL:
        if one.name == name:
            return one
    raise ValueError(f"--kinds: expected some of {', '.join(one.name for one in ALL)}, found '{name}'")
