"""Read a data set of `flyaround capture`: images, masks and poses, and the projection of keypoints by the pose.

python examples/read_dataset.py DATASET_FOLDER [train|validation|test]
"""

import sys

import numpy as np

import flyaround as fa


def main(folder: str, split: str | None = None) -> None:
    """Go through all frames; compare each keypoint of the record with the projection of the model's point."""
    dataset = fa.open_dataset(folder, split)
    print(f"{len(dataset)} frames of {dataset.card.target.name}, {dataset.card.camera.width_px} pixels wide")
    worst = 0.0
    for frame in dataset:
        share = np.mean(frame.mask > 0)
        print(f"frame {frame.number}: {frame.range_m:.2f} m, {frame.image.dtype}, {share:.1%} craft")
        seen = [k for k in frame.truth.keypoints if k.state == "visible"]
        if seen:
            pixels = frame.camera.project(frame.pose.apply([k.target_m for k in seen]))
            worst = max(worst, float(np.abs(pixels - [k.pixel_px for k in seen]).max()))
    print("keypoints lie on their projections to [px]:", f"{worst:.0e}")


if __name__ == "__main__":
    main(*sys.argv[1:])
