"""Place the target at a pose, draw it, and let the board's estimator find it.

python examples/own_pose.py OUT_FOLDER
"""

import sys
from pathlib import Path

import numpy as np

import flyaround as fa

Q_CAMERA_FROM_TARGET_WXYZ = (0.3, 0.8, 0.4, -0.3)  # Hamilton, scalar first; need not be normalised exactly
T_CAMERA_FROM_TARGET_M = (0.4, -0.2, 8.0)  # camera axes: x right, y down, z forward


def main(folder: Path) -> None:
    """Draw, save, estimate, compare."""
    plan = fa.plan_flight(fa.load_scenario("tango-space-10m"), n=1)
    # camera, light and background are those of the plan's first frame
    scene = fa.scene_at(plan, Q_CAMERA_FROM_TARGET_WXYZ, T_CAMERA_FROM_TARGET_M)
    with fa.Renderer() as renderer:
        frame = fa.take_frame(renderer, scene, plan.target)
    fa.save_picture(frame, f"{folder}/own_pose.png")
    estimate = fa.estimate(frame.image, plan.camera, plan.target)
    print("flyaround", fa.__version__)
    print("accepted:", estimate.accepted, estimate.reason)
    if estimate.t_camera_from_target_m is not None:
        print(
            "off by [m]:", np.linalg.norm(estimate.t_camera_from_target_m - T_CAMERA_FROM_TARGET_M).round(3)
        )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
