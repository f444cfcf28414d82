# SPDX-License-Identifier: MIT
"""What evo says of a trajectory, as JSON: APE under three alignments, RPE between neighbours. Runs in build/venv-evo.

    judge.py KIND TRUTH KIND ESTIMATE      kitti, tum or euroc; poses of KITTI's format are a pose per line of the other file
"""

import copy
import json
import sys

from evo.core import metrics, sync, trajectory
from evo.tools import file_interface

READERS = {"kitti": file_interface.read_kitti_poses_file, "tum": file_interface.read_tum_trajectory_file,
           "euroc": file_interface.read_euroc_csv_trajectory}
ALIGNMENTS = {"none": lambda estimate, truth: estimate.align_origin(truth), "se3": lambda estimate, truth: estimate.align(truth),
              "sim3": lambda estimate, truth: estimate.align(truth, correct_scale=True)}


def measure(metric, truth, estimate, statistic):
    metric.process_data((truth, estimate))
    return metric.get_statistic(statistic)


def main():
    truth_kind, truth_file, kind, file = sys.argv[1:]
    truth, estimate = READERS[truth_kind](truth_file), READERS[kind](file)
    if truth_kind != "kitti":
        truth, estimate = sync.associate_trajectories(truth, estimate, max_diff=0.01)
    elif kind != "kitti":
        truth = trajectory.PoseTrajectory3D(poses_se3=truth.poses_se3, timestamps=estimate.timestamps)
    found = {"poses": estimate.num_poses, "ate_rmse_m": {}, "rpe_translation_m": {}}
    for name, align in ALIGNMENTS.items():
        aligned = copy.deepcopy(estimate)
        align(aligned, truth)
        ape = metrics.APE(metrics.PoseRelation.translation_part)
        found["ate_rmse_m"][name] = measure(ape, truth, aligned, metrics.StatisticsType.rmse)
        rpe = metrics.RPE(metrics.PoseRelation.translation_part, 1, metrics.Unit.frames)
        found["rpe_translation_m"][name] = measure(rpe, truth, aligned, metrics.StatisticsType.mean)
    rpe = metrics.RPE(metrics.PoseRelation.rotation_angle_deg, 1, metrics.Unit.frames)
    found["rpe_rotation_deg"] = measure(rpe, truth, estimate, metrics.StatisticsType.mean)
    print(json.dumps(found))


if __name__ == "__main__":
    main()
