# SPDX-License-Identifier: MIT
"""Methods on the sequences of a KITTI folder: each one's poses and errors, kept so that nothing is computed twice."""

import dataclasses
import functools
import hashlib
import json
import logging
import os
import pathlib

import numpy as np
import yaml

import stemvo

logging.getLogger("stemvo").setLevel(logging.ERROR)  # a lost frame is in the numbers
ROAD, TRUE_STEPS, AS_IT_COMES = "camera height", "per-step ground-truth scale", "as it comes"
METRICS = ("t_rel_percent", "r_rel_deg_per_100m", "average_offset_m", "path_length_m", "segments", "rpe_translation_m", "rpe_rotation_deg")
GROUND = (0, 2)  # axes of KITTI's camera along the road
LENGTH_TOLERANCE_M = 1.5  # between a sequence's path and the official one


def open_folder(out, command):
    """Creates OUT by the rule of `stemvo run`: a new folder, an empty one or results of the same command."""
    mark = f"Results of 'stemvo-lab {command}': its next run may replace them.\n"
    if out.is_dir() and any(out.iterdir()) and not ((out / ".stemvo").is_file() and (out / ".stemvo").read_text() == mark):
        raise ValueError(f"{out}: expected a new folder, an empty one or results of 'stemvo-lab {command}', found other files")
    try:
        out.mkdir(parents=True, exist_ok=True)
        (out / ".stemvo").write_text(mark)
    except OSError as error:
        raise ValueError(f"{out}: expected an output folder that can be written, found: {error.strerror}") from None


def config_file(name):
    """NAME.yaml of the program: of the checkout, else of the installed package; else the file of this name."""
    here = pathlib.Path(__file__).resolve()
    ours = (here.parents[3] / f"config/{name}.yaml", here.with_name(f"{name}.yaml"))
    return next((file for file in ours if file.exists()), pathlib.Path(name))


def image_sizes(folder):
    """Names and sizes of a KITTI sequence's images, which tell others without being read."""
    return "".join(f"{file.relative_to(folder)} {file.stat().st_size}\n" for file in sorted(folder.glob("image_*/*"))).encode()


def published():
    """Official sequences and published numbers."""
    return json.loads(pathlib.Path(__file__).with_name("published.json").read_text())


def options_of(config=None, overrides=(), model=None):
    """Keys and values of a configuration file (`paper`: the program's own), of KEY=VALUE lines and of a model's file. The file's sampling
    is its own model's: another model keeps it where it can."""
    values, given = {}, {}
    if config:
        file = config_file(config)
        stemvo.Options.load(file)  # whose message names file and line
        for group, keys in (yaml.safe_load(file.read_text()) or {}).items():
            values |= {f"{group}.{key}": value for key, value in keys.items()} if isinstance(keys, dict) else {group: keys}
    for line in overrides:
        key, found, value = line.partition("=")
        if not found:
            raise ValueError(f"--set: expected KEY=VALUE, found '{line}'")
        given[key] = value
    given |= {"stem.model": str(model)} if model else {}
    if "stem.model" in given and (sampling := values.get("stem.sampling_px")):
        stride, is_native = stemvo._core.model_stride(given["stem.model"])
        if stride % sampling or (is_native and sampling != stride):
            del values["stem.sampling_px"]
    return values | given


@dataclasses.dataclass(frozen=True)
class Method:
    """Ours under `options`, or trajectory files NN.txt of `folder`; `scale` is one of the three above."""

    name: str
    scale: str
    options: dict | None = None
    folder: pathlib.Path | None = None

    @property
    def title(self):
        return f"{self.name}, {self.scale}"

    def settings(self):
        """`metres from the road` or `steps of the truth` decide scale.source, whatever the configuration says."""
        return stemvo.Options((self.options or {}) | {"scale.source": "camera_height" if self.scale == ROAD else "none"})


class Sequence:
    """KITTI/sequences/NAME. `problem`: why it cannot be read; None: it can."""

    def __init__(self, kitti, name, official=None, frames=None):
        self.name, self.path, self.problem, self.truth = name, pathlib.Path(kitti) / "sequences" / name, None, None
        self.official = official or {}
        try:
            self.recording = stemvo.read_recording(self.path, frames=None if frames is None else f"0:{frames}")
            self.truth = self.recording.ground_truth
        except ValueError as error:
            self.problem, self.recording = str(error), ()

    def __len__(self):
        return len(self.recording)

    @functools.cached_property
    def zero_motion(self):
        """Errors of a path that stays at the start, or None without ground truth."""
        return None if self.truth is None else stemvo.evaluate(np.tile(np.eye(4), (len(self.truth), 1, 1)), self.truth)

    @functools.cached_property
    def is_complete(self):
        """All official frames, at their size, along the official path: a clip, or a drive rendered under that name, is not."""
        if not self.official or self.truth is None or len(self) != self.official["frames"]:
            return False
        camera = self.recording.camera
        return ((camera.width, camera.height) == (self.official["width_px"], self.official["height_px"])
                and abs(self.zero_motion["path_length_m"] - self.official["length_m"]) <= LENGTH_TOLERANCE_M)

    @property
    def frames_text(self):
        if self.is_complete:
            return f"all {len(self)} frames"
        return f"clip 0:{len(self)} of {self.official['frames']}" if self.official else f"frames 0:{len(self)}"

    @functools.cached_property
    def identity(self):
        """Hash of the images' names and sizes, calibration, times and true poses."""
        hashed = hashlib.sha256(f"{len(self)}".encode() + image_sizes(self.path))
        for file in (self.path / "calib.txt", self.path / "times.txt", self.path.parent.parent / "poses" / f"{self.name}.txt"):
            hashed.update(file.read_bytes() if file.exists() else b"none")
        return hashed.hexdigest()


def sequences_of(kitti, names=(), frames=None):
    """Those asked for, where one that is not there has a problem, or all."""
    folder, official = pathlib.Path(kitti) / "sequences", published()["sequences"]
    if wrong := [name for name in names if not name or name in (".", "..") or "/" in name]:
        raise ValueError(f"{folder}: expected the names of folders in it, found '{wrong[0]}'")
    found = list(dict.fromkeys(names)) or (sorted(entry.name for entry in folder.iterdir() if entry.is_dir()) if folder.is_dir() else [])
    if not found:
        raise ValueError(f"{folder}: expected a folder per sequence, found none; give the folder above it")
    return [Sequence(kitti, name, official.get(name), frames) for name in found]


@functools.cache
def program_hash():
    """A build without a clean commit has a version that does not change with its code."""
    version = stemvo.__version__
    if "+" in version and not version.endswith(".dirty"):
        return version
    return version + hashlib.sha256(pathlib.Path(stemvo._core.__file__).read_bytes()).hexdigest()


def _identity(method, sequence):
    """Hash of everything that poses and errors depend on."""
    hashed = hashlib.sha256(f"{program_hash()} {sequence.identity} {method.scale}".encode())
    if method.folder is not None:
        hashed.update(trajectory_file(method, sequence).read_bytes())
        return hashed.hexdigest()
    settings = (method.options or {}) | {"threads": 0}  # no result depends on them
    hashed.update(str(dataclasses.replace(method, options=settings).settings()).encode())
    model = pathlib.Path(str(settings.get("stem.model", "default")))
    hashed.update(model.read_bytes() if model.is_file() else str(model).encode())
    return hashed.hexdigest()


def trajectory_file(method, sequence):
    file = method.folder / f"{sequence.name}.txt"
    if not file.exists():
        raise ValueError(f"{file}: expected a trajectory, found none")
    return file


def track(recording, options, progress=None):
    """Nx4x4, share of the frames that were measured, and whether the path is in units, not metres."""
    odometry, results = stemvo.Odometry(recording, options), []
    for result in odometry.run(recording):
        results.append(result)
        if progress:
            progress(len(results), len(recording))
    if len(results) < len(recording):
        raise ValueError(f"expected {len(recording)} images, found {len(recording) - len(results)} that cannot be read")
    in_units = odometry.scale_source == "none" or not any(result.scale_state in ("measured", "held") for result in results)
    return np.stack([result.world_from_camera for result in results]), np.mean([result.is_measured for result in results]), in_units


def others_poses(method, sequence):
    """Of a trajectory file: a pose per frame of the sequence; a longer file's first ones."""
    file = trajectory_file(method, sequence)
    poses, times = stemvo.read_trajectory(file)
    if times is not None:
        which, frames = stemvo.pair_by_time(times, sequence.recording.timestamps)
        if len(frames) < len(sequence):
            raise ValueError(f"{file}: expected a pose of each of {len(sequence)} frames, found {len(frames)}")
        poses = poses[which]
    if len(poses) < len(sequence):
        raise ValueError(f"{file}: expected {len(sequence)} poses, found {len(poses)}")
    return poses[:len(sequence)]


def run(method, sequence, folder, progress=None):
    """A row (its state is done, failed or not possible) and Nx4x4 or None. Kept in `folder`: not computed again while program,
    options, model, frames, calibration and ground truth are the same."""
    row = {"sequence": sequence.name, "method": method.name, "scale": method.scale, "alignment": "none", "state": "failed", "problem": None}
    if sequence.problem or (method.scale == TRUE_STEPS and sequence.truth is None):
        return row | ({"problem": sequence.problem} if sequence.problem else {"state": "not possible", "problem": "no ground truth"}), None
    kept, poses_file = folder / "row.json", folder / "trajectory_kitti.txt"
    try:
        identity = _identity(method, sequence)
        before = json.loads(kept.read_text()) if kept.exists() and poses_file.exists() else {}
        if before.get("inputs") == identity and before.get("poses") == hashlib.sha256(poses_file.read_bytes()).hexdigest():
            return before["row"], stemvo.read_trajectory(poses_file)[0]
        row, poses = _compute(method, sequence, row, progress)
    except (ValueError, OSError) as error:
        return row | {"problem": str(error)}, None
    folder.mkdir(parents=True, exist_ok=True)
    text = "".join(" ".join(f"{number + 0.0:.12e}" for number in pose[:3].ravel()) + "\n" for pose in poses)
    poses_file.write_text(text)
    new = folder / "row.json.new"  # so that a run that is killed leaves no half of a file
    new.write_text(json.dumps({"inputs": identity, "poses": hashlib.sha256(text.encode()).hexdigest(), "row": row}, indent=1))
    os.replace(new, kept)
    return row, poses


def _compute(method, sequence, row, progress):
    if method.folder is None:
        poses, measured, in_units = track(sequence.recording, method.settings(), progress)
        row["tracked_fraction"] = float(measured)
    else:
        poses, in_units = others_poses(method, sequence), False
    if method.scale == TRUE_STEPS:
        poses[:, :3, 3], in_units = stemvo.rescale_steps(poses, sequence.truth)[:, :3, 3], False
    row |= {"state": "done", "alignment": "sim3" if in_units else "none"}
    if in_units and method.scale == ROAD:
        row["problem"] = "no road was believed: the path is in units"
    if sequence.truth is not None:
        found = stemvo.evaluate(poses[sequence.recording.ground_truth_frames], sequence.truth, row["alignment"])
        row |= {name: found[name] for name in METRICS} | {"ate_rmse_m": found["ate_rmse_m"]["sim3"]}  # always after Sim(3)
    return row, poses
