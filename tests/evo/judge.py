# SPDX-License-Identifier: MIT
"""What evo says of a trajectory, as JSON: APE under four alignments, RPE between neighbours. Runs in build/venv-evo.

    judge.py kitti|tum TRUTH ESTIMATE      the truth in KITTI's format, a pose per line of the estimate
"""

import copy
import json
import sys

from evo.core import metrics, trajectory
from evo.tools import file_interface

ALIGNMENTS = {"none": None, "se3": {}, "sim3": {"correct_scale": True}}


def measure(metric, truth, estimate, statistic):
    metric.process_data((truth, estimate))
    return metric.get_statistic(statistic)


def main():
    kind, truth_file, estimate_file = sys.argv[1:]
    truth = file_interface.read_kitti_poses_file(truth_file)
    if kind == "kitti":
        estimate = file_interface.read_kitti_poses_file(estimate_file)
    else:
        estimate = file_interface.read_tum_trajectory_file(estimate_file)
        truth = trajectory.PoseTrajectory3D(poses_se3=truth.poses_se3, timestamps=estimate.timestamps)
    found = {"poses": estimate.num_poses, "ate_rmse_m": {}}
    for name, options in ALIGNMENTS.items():
        aligned = copy.deepcopy(estimate)
        if options is not None:
            aligned.align(truth, **options)
        ape = metrics.APE(metrics.PoseRelation.translation_part)
        found["ate_rmse_m"][name] = measure(ape, truth, aligned, metrics.StatisticsType.rmse)
    rpe = metrics.RPE(metrics.PoseRelation.rotation_angle_deg, 1, metrics.Unit.frames)
    found["rpe_rotation_deg"] = measure(rpe, truth, estimate, metrics.StatisticsType.mean)
    print(json.dumps(found))


if __name__ == "__main__":
    main()
