"""The samples of a recipe as a table, before anything is drawn: algorithm 1 of the data-set paper, and more."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING

from msgspec import UnsetType

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.simulator.recipes.plan import RecipePlan
    from flyaround.simulator.scene.state import SceneState

POSE = ("q_w", "q_x", "q_y", "q_z", "t_x_m", "t_y_m", "t_z_m")
RAW = ("x", "y", "z", "rx", "ry", "rz", "q1", "q2", "q3", "q4")
COLUMNS = ("sample", *RAW, *POSE, "background", "redraws", "epoch_utc")


def samples_csv(plan: RecipePlan, progress: Callable[[int, int], None] = lambda _done, _of: None) -> str:
    """One row for each sample, numbers in full.

    ``x`` to ``q4`` are the paper's raw data (left-handed: metres, degrees, quaternion), empty where no Euler angles
    were drawn; ``q_w`` to ``t_z_m`` the pose label, as `render --poses` reads it.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for k in range(plan.n_frames):
        writer.writerow(_row(k, plan.scene(k)))
        progress(k + 1, plan.n_frames)
    return text.getvalue()


def _row(k: int, scene: SceneState) -> list[object]:
    sample = None if isinstance(scene.sample, UnsetType) else scene.sample
    raw: tuple[object, ...] = ("",) * len(RAW)
    background, redraws = "", 0
    if sample is not None:
        if sample.raw is not None:
            raw = (*sample.raw.position_m, *sample.raw.euler_deg, *sample.raw.q_wxyz)
        if sample.background is not None:
            background = f"{sample.background.body}-{sample.background.id:04d}"
        redraws = sum(sample.redraws.values())
    pose = (*scene.q_camera_from_target_wxyz, *scene.t_camera_from_target_m)
    return [k, *raw, *pose, background, redraws, scene.epoch_utc]
