"""Estimated poses of estimator and board over the camera's picture: the target's wireframe at each."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

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

OLD_S = 5.0
"""Age of a picture, in simulated time, above which its estimate is not drawn."""
SAYS = (
    "the estimator's method, or board; its confidence (0 to 1), and the age of the picture that it was given"
)


class ShownPose(NamedTuple):
    """An estimated pose over the picture, camera from target; None where there is no pose."""

    name: str
    t_s: float
    accepted: bool
    remark: str
    q_wxyz: Quat | None
    t_m: Vec3 | None


def shown_poses(jobs: Jobs, t_s: float) -> list[ShownPose]:
    """Return the estimator's newest answer and the board's newest accepted pose, none older than `OLD_S`.

    Parameters
    ----------
    jobs : Jobs
        The console's jobs.
    t_s : float
        Simulated time of the picture.

    Returns
    -------
    list of ShownPose
        At most one of each.
    """
    poses, e = [], jobs.estimates.newest if jobs.estimates.on else None
    if e is not None:
        a, name = e.answer, method_title(e.method)
        remark = f"confidence {a.confidence:.2f}" if a.accepted else f"declined: {a.reason}"
        q, t = a.q_camera_from_target_wxyz, a.t_camera_from_target_m
        poses.append(ShownPose(name, e.t_s, a.accepted, remark, q, t))
    rows = reversed(jobs.hil.rows) if jobs.hil.on else ()
    if (row := next((row for row in rows if row.outcome == ACCEPTED and row.t_s <= t_s), None)) is not None:
        remark = f"confidence {row.confidence or 0.0:.2f}"
        poses.append(ShownPose("board", row.t_s, True, remark, row.q_wxyz, row.t_m))
    return [pose for pose in poses if 0 <= t_s - pose.t_s < OLD_S]


class EstimateOverlay:
    """Overlay of estimated poses, with the cached lines of each."""

    def __init__(self) -> None:
        self._lines: dict[str, tuple[tuple[object, ...], tuple[Segment, ...]]] = {}

    def draw(self, canvas: Canvas, box: Letterbox, picture: Picture, jobs: Jobs) -> list[Place]:
        """Draw the poses of `shown_poses` over a picture.

        Returns
        -------
        list of Place
            Rectangles of their texts, which other texts leave free.
        """
        scene, places = picture.frame.scene, []
        for k, pose in enumerate(shown_poses(jobs, scene.t_s)):
            key = pose, scene.camera, picture.target
            if self._lines.get(pose.name, ((),))[0] != key:
                self._lines[pose.name] = key, self._lines_of(pose, picture)
            lines, age_s = self._lines[pose.name][1], scene.t_s - pose.t_s
            colour = (*style.ESTIMATE[:3], 1.0 if pose.accepted else 0.55)
            for ends in lines:
                canvas.stroke([box.at(p) for p in ends], colour, 1.5)
            text = f"{pose.name}: {pose.remark}{f', {age_s:.1f} s ago' if age_s > 0.05 else ''}"
            # two poses lie over each other, and their texts must not
            x, y = self._place(canvas, box, text, lines)
            places.append((x, y + 1.3 * canvas.line * k, *canvas.size(text)))
            canvas.label(places[-1][:2], text, style.ESTIMATE, SAYS)
        return places

    @staticmethod
    def _lines_of(pose: ShownPose, picture: Picture) -> tuple[Segment, ...]:
        q, t = pose.q_wxyz, pose.t_m
        if q is None or t is None or not np.isfinite([*q, *t]).all() or np.linalg.norm(q) < 1e-9:
            return ()
        at = Pose.from_arrays("camera", "target", quat_normalize(q), t)
        return wireframe_at(picture.frame.scene.camera, at, picture.target)

    @staticmethod
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
