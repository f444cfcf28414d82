# SPDX-License-Identifier: MIT
"""Programs that package_test.py runs with the installed package: what they print, or an assertion, is what it looks at."""

# Writes the files of `stemvo run`, of the same recording: FOLDER, and as JSON what else read_recording takes.
TRACK = """
import json, pathlib, sys
import numpy as np, stemvo
out, path, more = pathlib.Path(sys.argv[1]), sys.argv[2], json.loads(sys.argv[3])
recording = stemvo.read_recording(path, **more)
odometry = stemvo.Odometry(recording)
seen = [frame for frame, (image, _) in enumerate(recording) if image is not None]
results = [odometry.process(image, timestamp) for image, timestamp in recording if image is not None]
def write(name, poses):  # as KITTI's file is written
    lines = [" ".join(f"{value + 0.0:.12e}" for value in pose[:3].ravel()) for pose in poses]
    (out / name).write_text("\\n".join(lines) + "\\n")
poses = np.stack([result.world_from_camera for result in results])
write("trajectory_kitti.txt", poses)
truth, frames, scale = recording.ground_truth, recording.ground_truth_frames, odometry.scale_source
assert (truth is None) == (frames is None) and (truth is None or len(truth) == len(frames))
errors = truth is not None and stemvo.evaluate(poses[np.searchsorted(seen, frames)], truth, "sim3" if all(r.scale_state == "none" for r in results) or scale == "none" else "none")
def camera_of(result):  # as frames.csv has it
    camera, sigma = result.camera, result.camera_sigma
    return [f"{value:.2f}" for value in (camera.fx, camera.cx, camera.cy, sigma.fx, sigma.cx, sigma.cy)]
print(json.dumps({"states": [[r.state, r.num_matches, r.num_inliers, r.scale_state, r.timestamp, *camera_of(r)] for r in results], "scale_source": scale,
                  "errors": errors or None, "true_frames": None if frames is None else frames.tolist()}))
"""

# run() against process(), whatever becomes of the loop; what else a frame may bring; the map and its changes.
RUN = """
import gc, itertools, logging, sys, types
import numpy as np, stemvo
recording = stemvo.read_recording(sys.argv[1])
frames = list(recording)
def same(found, expected):
    for a, b in itertools.zip_longest(found, expected):
        assert (a.timestamp, a.state, a.num_inliers, a.scale_sigma) == (b.timestamp, b.state, b.num_inliers, b.scale_sigma), (a, b)
        assert np.array_equal(a.world_from_camera, b.world_from_camera) and np.array_equal(a.motion_covariance, b.motion_covariance), (a, b)
def left(odometry):
    changes = odometry.landmarks_since(0)
    return [*odometry.landmarks(), *odometry.tracked_points(), odometry.channel_image(), changes.ids, changes.positions, changes.colors]
def raises(call, text):
    try:
        call()
    except (ValueError, OSError) as error:
        assert text in str(error), error
    else:
        raise SystemExit("expected " + text)
def broken():
    yield from frames[:5]
    raise OSError("the cable")

odometry = stemvo.Odometry(recording)
plain = [odometry.process(*frame) for frame in frames]
for threads in (1, 2, 4):
    other = stemvo.Odometry(recording, {"threads": threads})
    same(other.run(frames), plain)
    assert all(map(np.array_equal, left(other), left(odometry))), threads
gone = [frame for number, frame in enumerate(frames) if number not in (4, 5)]
other.reset()
rest = [other.process(*frame) for frame in gone]
same(stemvo.Odometry(recording).run((None if number in (4, 5) else image, time) for number, (image, time) in enumerate(frames)), rest)

odometry.reset()
for result in odometry.run(frames):  # and leaves the loop
    if result.timestamp == frames[2][1]:
        break
same(odometry.run(frames[8:]), plain[8:])
for source, text, number in ((broken(), "the cable", 5), ([*frames[:4], frames[2]], "after the last frame's, 0.3 s, found 0.2 s", 4)):
    odometry.reset()
    found = []
    raises(lambda: found.extend(odometry.run(source)), text)
    same(found, plain[:number])
odometry.reset()
unfinished = odometry.run(frames)
next(unfinished)
for call in (lambda: odometry.process(*frames[9]), odometry.reset, lambda: next(odometry.run(frames))):
    raises(call, "expected a run that is over, found one with 5 frames at work")
unfinished.close()
odometry.process(*frames[9])
unfinished = stemvo.Odometry(recording).run(frames)
next(unfinished)
del unfinished
gc.collect()

half = np.zeros(frames[0][0].shape[:2], np.uint8)
half[:, :310] = 255
turn = np.eye(3)
masked = stemvo.Odometry(recording)
for image, time in frames:
    result = masked.process(image, time, mask=half, rotation_hint=turn)
    assert np.all(masked.tracked_points()[0][:, 2] < 310)
masked = stemvo.Odometry(recording, mask=half)
for result in masked.run(frames):
    assert np.all(masked.tracked_points()[0][:, 2] < 310)
assert plain[-1].motion_covariance.shape == (6, 6) and np.all(np.linalg.eigvalsh(plain[-1].motion_covariance) > 0.0)

metres = stemvo.Odometry(recording.camera, stemvo.Options.driving(1.65))
assert metres.scale_source == "camera_height"
same(metres.run(frames), plain)  # as a KITTI folder has it
changes = metres.landmarks_since(0)
keyframes = metres.keyframes()
assert [keyframe.id for keyframe in keyframes] == list(range(len(keyframes))) and len(keyframes) > 1
for keyframe in keyframes:
    assert plain[keyframe.frame].timestamp == keyframe.timestamp
    assert np.array_equal(plain[keyframe.frame].world_from_camera, keyframe.world_from_camera)
assert repr(keyframes[1]).startswith(f"Keyframe(frame: {keyframes[1].frame}, id: 1, timestamp: ") and "world_from_camera: 4x4" in repr(keyframes[1])
assert "positions: " in repr(changes) and repr(stemvo.Options({"stem": {"filter": 3}})) == repr(stemvo.Options({"stem.filter": 3})) == "Options({'stem.filter': '3'})" and repr(stemvo.Options()) == "Options({})"
keys = {"features.ratio": 0.7, "features.klt_levels": 3, "stem.sampling_px": 2, "stem.filter": 3}
assert repr(stemvo.Options(keys)) == "Options({'stem.filter': '3', 'stem.sampling_px': '2', 'features.klt_levels': '3', 'features.ratio': '0.7'})"  # as in the file
assert len(metres.keyframes(1)) == len(keyframes) - 1
assert len(metres.landmarks_since(changes.version).ids) == 0 < len(changes.ids) == len(changes.positions) == len(changes.colors)
last = keyframes[-1].frame
whole = metres.adjust_map(covariance_of=[last])
assert len(whole.map_from_camera) == len(plain) and whole.loops == [] and len(whole.landmarks[0]) == len(metres.landmarks()[0])
covariance = whole.keyframes[-1].covariance
assert whole.keyframes[-1].frame == last and (covariance is None or np.all(np.linalg.eigvalsh(covariance) > 0.0))
assert whole.keyframes[0].covariance is None and abs(whole.camera.fx / recording.camera.fx - 1.0) < 0.01
assert np.array_equal(plain[-1].map_from_world, np.eye(4)) and plain[-1].recognized_frame is None and plain[-1].map_id == 0 and plain[-1].is_measured
raises(lambda: metres.adjust_map([-7]), "covariance_of: expected frames of keyframes, found -7")
metres.save_map(sys.argv[1] + ".map")
visit = stemvo.Odometry(recording)
visit.load_map(sys.argv[1] + ".map")
visit.process(*frames[0])
raises(lambda: visit.load_map(sys.argv[1] + ".map"), "expected a call before the first frame")
raises(lambda: stemvo.Odometry(recording, {"odometry.loops": False}).adjust_map(), "found loops false")
truth = recording.ground_truth[:, :3, 3]
steps = np.linalg.norm(np.diff(truth, axis=0), axis=1)
wheels = stemvo.Odometry(recording.camera)
def rolling():  # at the mean speed of the step to come
    for (image, time), step in zip(frames, [*steps, steps[-1]]):
        wheels.add_speed(time, step / 0.1)
        yield image, time
ends = [result.world_from_camera[:3, 3] for result in wheels.run(rolling())][-2:]
assert abs(np.linalg.norm(ends[1] - ends[0]) / steps[-1] - 1.0) < 0.05, (ends, steps[-1])
assert wheels.scale_source == "speed" and metres.scale_source == "camera_height"
raises(lambda: wheels.add_speed(0.5, 1.0, 0.1), "speed: expected")
raises(lambda: wheels.add_distance(2.0, 1.0, 1.0, 0.1), "distance: expected a time after its beginning")
wheels.reset()
assert wheels.scale_source == "none"
lines = []
logger = logging.getLogger("stemvo")
logger.setLevel(logging.INFO)
logger.addHandler(types.SimpleNamespace(level=logging.INFO, handle=lambda record: lines.append((record.levelname, record.getMessage()))))
metres.reset()
same(metres.run(frames), plain)
assert [line for line in lines if line[0] == "INFO" and line[1].endswith(": a map was opened")], lines
last = stemvo.Odometry(recording).run(frames)  # unfinished when the interpreter ends
next(last)
"""

# A video through OpenCV's package: made of the images of a folder; then tracked, as TRACK does it.
VIDEO = """
import pathlib, sys
import cv2, stemvo
images = sorted(pathlib.Path(sys.argv[1]).glob("*.png"))
writer = cv2.VideoWriter(sys.argv[2], cv2.VideoWriter_fourcc(*"FFV1"), 10.0, cv2.imread(str(images[0])).shape[1::-1])
for image in images:
    writer.write(cv2.imread(str(image)))
writer.release()
view = stemvo.FrameView(sys.argv[3], masks=sys.argv[4:])
odometry, video = stemvo.Odometry(view), cv2.VideoCapture(sys.argv[2])
while (read := video.read())[0]:
    image = view.apply(cv2.cvtColor(read[1], cv2.COLOR_BGR2RGB))
    pose = odometry.process(image, video.get(cv2.CAP_PROP_POS_MSEC) * 1e-3).world_from_camera
    print(*(f"{value + 0.0:.12e}" for value in pose[:3].ravel()))
"""

# Where the viewer puts a path of half the size whose frames 1 to 3 have a true pose.
FITTED = """
import types
import numpy as np
from stemvo.view import View
logged = {}
rr = types.SimpleNamespace(log=lambda name, entity, **_: logged.update({name: entity}), LineStrips3D=lambda strips, colors: strips,
                           Transform3D=lambda translation, mat3x3: (translation, mat3x3), ViewCoordinates=types.SimpleNamespace(RIGHT_HAND_Y_DOWN=0))
turn = np.array([[0.0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]])
poses = np.tile(np.eye(4), (5, 1, 1))
poses[:, :3, 3] = np.array([[0, 0, 0], [1, 0, 0], [1, 2, 0], [1, 2, 3], [9, 9, 9]])
truth = np.linalg.inv(turn @ poses[1]) @ turn @ poses[1:4]
truth[:, :3, 3] *= 2.0
recording = types.SimpleNamespace(ground_truth=truth, ground_truth_frames=np.array([1, 2, 3]))
for scale_source, factor in (("none", 2.0), ("camera_height", 1.0)):
    view = View(rr, recording, scale_source)
    view.fit(list(poses))
    translation, matrix = logged["world/estimate"]
    moved = poses[1:4, :3, 3] @ matrix.T + translation
    assert np.allclose(moved, truth[:, :3, 3] * factor / 2.0), (scale_source, moved)
assert np.array_equal(logged["world/truth"][0], truth[:, :3, 3])
"""

# The viewer is found beside the Python that runs, and where there is none one line says what to do.
FOUND = """
import os, shutil, sys, types
from stemvo.view import open_window
def spawn():
    assert shutil.which("rerun").startswith(sys.prefix), shutil.which("rerun")
    raise RuntimeError("none found\\nmore")
os.environ["PATH"] = "/usr/bin:/bin"
try:
    open_window(types.SimpleNamespace(spawn=spawn))
except ValueError as error:
    assert "none found" in str(error) and "--save" in str(error) and "\\n" not in str(error), error
else:
    raise SystemExit("expected an error, found none")
"""
