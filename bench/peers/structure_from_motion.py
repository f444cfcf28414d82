#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""How far the ground truth of a recording agrees with its images: COLMAP's structure from motion as the judge.

    bench/peers/structure_from_motion.py IMAGES --gt POSES --focal F --work FOLDER [--every 4] [--poses NAME=FILE ..]

All pairs of every N-th image are matched, their poses adjusted together, focal length and two radial
coefficients free: nothing drifts (two runs differ by 0.1 px). Printed are the camera that is found, and for each
trajectory (COLMAP's, the ground truth's, those of --poses; KITTI's format, one pose per image) its error after
a similarity to the ground truth and the median error, px, with which COLMAP's points, triangulated anew
from it, reproject: of all frames, and of each hundred (with a similarity of its own). For the latter a
rigid offset of the camera (the ground truth may be another's) and its intrinsics are fitted to each
trajectory. Needs `pip install pycolmap==4.2.1 scipy`; FOLDER keeps the matches.
"""

import argparse
import pathlib
import shutil

import numpy as np
import pycolmap
from scipy.optimize import least_squares
from scipy.sparse import lil_matrix
from scipy.spatial.transform import Rotation

MIN_VIEWS, MAX_POINTS = 6, 1200


def match(arguments, size, names):
    """The database of all pairs of images."""
    file = arguments.work / "matches.db"
    if not file.exists():
        reader = pycolmap.ImageReaderOptions()
        reader.camera_model = "RADIAL"
        reader.camera_params = f"{arguments.focal},{size[0] / 2},{size[1] / 2},0,0"
        partial = arguments.work / "partial.db"
        partial.unlink(missing_ok=True)
        pycolmap.extract_features(partial, arguments.images, image_names=names, reader_options=reader,
                                  camera_mode=pycolmap.CameraMode.SINGLE)
        pycolmap.match_exhaustive(partial)
        partial.rename(file)
    return file


def reconstruct(arguments, database, frame_of):
    """The largest reconstruction; its poses, 3x4 world_from_camera, by frame. `frame_of`: an image's name -> its frame."""
    options = pycolmap.IncrementalPipelineOptions()
    options.ba_refine_principal_point = False
    found = pycolmap.incremental_mapping(database, arguments.images, arguments.work, options=options)
    if not found:
        raise SystemExit(f"{arguments.images}: expected a reconstruction, found none")
    best = max(found.values(), key=lambda one: one.num_reg_images())
    return best, {frame_of[image.name]: image.cam_from_world().inverse().matrix() for image in best.images.values() if image.has_pose}


def observations_of(model, frame_of):
    """Points (number), frames and pixels of tracks seen often."""
    points = [p for p in model.points3D.values() if p.track.length() >= MIN_VIEWS]
    chosen = np.random.default_rng(1).permutation(len(points))[:MAX_POINTS]
    rows = [(k, frame_of[image.name], *image.points2D[e.point2D_idx].xy)
            for k, p in enumerate(points[i] for i in chosen) for e in p.track.elements for image in [model.images[e.image_id]]]
    rows = np.array(rows)
    return rows[:, 0].astype(int), rows[:, 1].astype(int), rows[:, 2:]


def triangulated(rotations, centers, rays, of_point):
    """Points nearest to their rays."""
    directions = np.einsum("nij,nj->ni", rotations, np.c_[rays, np.ones(len(rays))])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    off = np.eye(3) - np.einsum("ni,nj->nij", directions, directions)
    a, b = np.zeros((of_point.max() + 1, 3, 3)), np.zeros((of_point.max() + 1, 3))
    np.add.at(a, of_point, off)
    np.add.at(b, of_point, np.einsum("nij,nj->ni", off, centers))
    return np.linalg.solve(a, b[..., None])[..., 0]


def reprojection_errors(poses, observations, camera, size):
    """px, with the best points, camera and rigid offset of it; `camera`: f, k1, k2 to start from."""
    of_point, of_frame, uv = observations
    rotations = np.array([poses[f][:, :3] for f in of_frame])
    centers = np.array([poses[f][:, 3] for f in of_frame])
    middle = np.array(size) / 2

    def residuals(x):
        in_body = np.einsum("nji,nj->ni", rotations, x[11:].reshape(-1, 3)[of_point] - centers)
        in_camera = in_body @ Rotation.from_rotvec(x[:3]).as_matrix().T + x[3:6]
        n = in_camera[:, :2] / in_camera[:, 2:]
        r2 = (n ** 2).sum(1, keepdims=True)
        return (n * (1 + x[9] * r2 + x[10] * r2 ** 2) * x[6] + x[7:9] - uv).ravel()

    start = triangulated(rotations, centers, (uv - middle) / camera[0], of_point)
    pattern = lil_matrix((2 * len(uv), 11 + start.size), dtype=int)
    pattern[:, :11] = 1
    rows = np.arange(2 * len(uv))
    for axis in range(3):
        pattern[rows, 11 + 3 * np.repeat(of_point, 2) + axis] = 1
    begin = np.r_[np.zeros(6), camera[0], middle, camera[1:], start.ravel()]
    found = least_squares(residuals, begin, jac_sparsity=pattern, loss="soft_l1", x_scale="jac", max_nfev=100)
    return np.linalg.norm(residuals(found.x).reshape(-1, 2), axis=1)


def error_after_similarity(positions, truth):
    a, b = positions - positions.mean(0), truth - truth.mean(0)
    u, s, v = np.linalg.svd(b.T @ a)
    sign = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))])
    scale = np.trace(np.diag(s) @ sign) / (a ** 2).sum()
    return np.sqrt(((scale * a @ (u @ sign @ v).T - b) ** 2).sum(1).mean())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("images", type=pathlib.Path)
    parser.add_argument("--gt", type=pathlib.Path, required=True)
    parser.add_argument("--focal", type=float, required=True, help="px, to start from")
    parser.add_argument("--work", type=pathlib.Path, required=True)
    parser.add_argument("--every", type=int, default=4)
    parser.add_argument("--poses", action="append", default=[], metavar="NAME=FILE")
    arguments = parser.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    all_names = sorted(file.name for file in arguments.images.iterdir())
    frame_of = {name: i for i, name in enumerate(all_names)}
    bitmap = pycolmap.Bitmap.read(arguments.images / all_names[0], as_rgb=False)
    size = (bitmap.width, bitmap.height)
    database = shutil.copy(match(arguments, size, all_names[::arguments.every]), arguments.work / "mapped.db")
    model, judged = reconstruct(arguments, database, frame_of)
    camera = next(iter(model.cameras.values())).params
    print(f"{len(judged)} images, f {camera[0]:.1f} px, k1 {camera[3]:.3f}, k2 {camera[4]:.3f}")
    files = {"ground truth": arguments.gt} | dict(word.split("=", 1) for word in arguments.poses)
    trajectories = {"COLMAP": judged} | {name: np.loadtxt(file).reshape(-1, 3, 4) for name, file in files.items()}
    observations = observations_of(model, frame_of)
    parts = [sorted(judged)] + [[f for f in sorted(judged) if f // 100 == part] for part in sorted({f // 100 for f in judged})]
    for name, poses in trajectories.items():
        pixels = reprojection_errors(poses, observations, camera[[0, 3, 4]], size)
        errors = [error_after_similarity(*(np.array([of[f][:, 3] for f in part]) for of in (poses, trajectories["ground truth"])))
                  for part in parts]
        print(f"{name}:", ", ".join(f"{error:.4f} m {np.median(pixels[np.isin(observations[1], part)]):.2f} px"
                                    for error, part in zip(errors, parts)), flush=True)


if __name__ == "__main__":
    main()
