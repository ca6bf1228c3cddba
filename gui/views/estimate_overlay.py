"""Estimated poses of estimator and board over the camera's picture: the target's wireframe at each."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from flyaround.gui import style
from flyaround.gui.jobs.estimator_process import method_title
from flyaround.gui.picture.truth_overlay import Segment, wireframe_at
from flyaround.hil.host.frame_record import ACCEPTED
from flyaround.simulator.world.frames.pose import Pose
from flyaround.simulator.world.frames.rotation import quat_normalize

if TYPE_CHECKING:
    from flyaround.gui.canvas import Canvas, Place, Point
    from flyaround.gui.jobs.all import Jobs
    from flyaround.gui.picture.feed import Picture
    from flyaround.gui.views.letterbox import Letterbox
    from flyaround.simulator.runtime.arrays import Quat, Vec3

    ShownPose = tuple[str, float, bool, str, Quat | None, Vec3 | None]
    """Name, time of the picture, True if accepted, confidence or reason, attitude and position."""

OLD_S = 5.0
"""Age of a picture, in simulated time, above which its estimate is not drawn."""
SAYS = "estimator's method, or board; its confidence (0 to 1), and the age of the picture that it was given"


def draw_estimates(canvas: Canvas, box: Letterbox, picture: Picture, jobs: Jobs) -> list[Place]:
    """Draw the estimator's newest answer and the board's newest accepted pose, none older than `OLD_S`.

    Returns
    -------
    list of Place
        Rectangles of their texts, which other texts leave free.
    """
    scene, places = picture.frame.scene, []
    for k, (name, t_s, accepted, says, *pose) in enumerate(_newest(jobs, scene.t_s)):
        lines, age_s = _lines(*pose, picture), scene.t_s - t_s
        colour = (*style.ESTIMATE[:3], 1.0 if accepted else 0.55)
        for ends in lines:
            canvas.stroke([box.at(p) for p in ends], colour, 1.5)
        text = f"{name}: {says}{f', {age_s:.1f} s ago' if age_s > 0.05 else ''}"
        # two poses lie over each other, and their texts must not
        x, y = _place(canvas, box, text, lines)
        places.append((x, y + 1.3 * canvas.line * k, *canvas.size(text)))
        canvas.label(places[-1][:2], text, style.ESTIMATE, SAYS)
    return places


def _newest(jobs: Jobs, t_s: float) -> list[ShownPose]:
    """Return the poses of estimator and board that are not too old for a picture."""
    found: list[ShownPose] = []
    if jobs.estimates.on and (e := jobs.estimates.newest):
        a, name = e.answer, method_title(e.method)
        says = f"confidence {a.confidence:.2f}" if a.accepted else f"declined: {a.reason}"
        q, t = a.q_camera_from_target_wxyz, a.t_camera_from_target_m
        found.append((name, e.t_s, a.accepted, says, q, t))
    rows = reversed(jobs.hil.rows) if jobs.hil.on else ()
    if row := next((row for row in rows if row.outcome == ACCEPTED and row.t_s <= t_s), None):
        found.append(("board", row.t_s, True, f"confidence {row.confidence or 0.0:.2f}", row.q_wxyz, row.t_m))
    return [pose for pose in found if 0 <= t_s - pose[1] < OLD_S]


@lru_cache(maxsize=2)
def _lines(q: Quat | None, t: Vec3 | None, picture: Picture) -> tuple[Segment, ...]:
    if q is None or t is None or not np.isfinite([*q, *t]).all() or np.linalg.norm(q) < 1e-9:
        return ()
    pose = Pose.from_arrays("camera", "target", quat_normalize(q), t)
    return wireframe_at(picture.frame.scene.camera, pose, picture.target)


def _place(canvas: Canvas, box: Letterbox, text: str, lines: tuple[Segment, ...]) -> Point:
    """Return a position below the wireframe inside the picture, or at the lower centre without one."""
    width = canvas.size(text)[0]
    ends = [box.at(p) for line in lines for p in line]
    if ends:
        x = (min(p[0] for p in ends) + max(p[0] for p in ends)) / 2 - width / 2
        y = max(p[1] for p in ends) + 8
    else:
        x, y = box.x + (box.width - width) / 2, box.y + 0.72 * box.height
    x = min(max(x, box.x + 8), max(box.x + box.width - width - 8, box.x + 8))
    return x, min(max(y, box.y + 8), box.y + 0.8 * box.height)
