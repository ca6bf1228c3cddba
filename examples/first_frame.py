"""Draw one frame of a built-in flight, print its pose, and save it with its truth drawn over it.

python examples/first_frame.py OUT_FOLDER
"""

import sys
from pathlib import Path

import cv2

import flyaround as fa


def main(folder: Path) -> None:
    """Draw, print, save."""
    plan = fa.plan_flight(fa.load_scenario("tango-flyaround"), times=(20.0,))
    with fa.Renderer() as renderer:
        frame = fa.take_frame(renderer, plan.scene(0), plan.target)
    truth_path = fa.save_picture(frame, folder / "frame.png")
    truth = fa.read_truth(truth_path)
    print("target in the camera frame [m]:", truth.t_camera_from_target_m)
    print("visible keypoints:", [k.name for k in truth.keypoints if k.state == "visible"])
    overlay = fa.draw_truth(frame.image, truth, plan.target)
    cv2.imwrite(str(folder / "overlay.png"), overlay[..., ::-1])


if __name__ == "__main__":
    main(Path(sys.argv[1]))
