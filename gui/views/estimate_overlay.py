"""The estimated pose over the camera's picture: the target's wireframe at that pose."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.gui import style
from flyaround.gui.jobs.estimator_process import method_title
from flyaround.gui.picture.truth_overlay import Segment, wireframe_at
from flyaround.simulator.world.frames.pose import Pose
from flyaround.simulator.world.frames.rotation import quat_normalize

if TYPE_CHECKING:
    from flyaround.gui.canvas import Canvas, Place, Point
    from flyaround.gui.jobs.estimates import ComparedEstimate, Estimates
    from flyaround.gui.picture.feed import Picture
    from flyaround.gui.views.letterbox import Letterbox

OLD_S = 5.0
"""Age of a picture, in simulated time, above which its estimate is not drawn."""
SAYS = "the estimator's method, its confidence (0 to 1), and the age of the picture that it was given"


class EstimateOverlay:
    """Overlay of the newest estimate, with cached lines."""

    _key: tuple[object, ...] = ()
    _lines: tuple[Segment, ...] = ()

    def draw(self, canvas: Canvas, box: Letterbox, picture: Picture, estimates: Estimates) -> list[Place]:
        """Draw over a picture the newest estimate, if its own picture is less than `OLD_S` older.

        Returns
        -------
        list of Place
            Rectangle of its text, which other texts leave free.
        """
        estimate, scene = estimates.newest, picture.frame.scene
        if estimate is None or not estimates.on or not 0 <= (age_s := scene.t_s - estimate.t_s) < OLD_S:
            return []
        key = (estimate, scene.camera, picture.target)
        if key != self._key:
            self._key, self._lines = key, self._lines_of(estimate, picture)
        accepted = estimate.answer.accepted
        colour = (*style.ESTIMATE[:3], 1.0 if accepted else 0.55)
        for ends in self._lines:
            canvas.stroke([box.at(p) for p in ends], colour, 1.5)
        answer = estimate.answer
        says = f"confidence {answer.confidence:.2f}" if accepted else f"declined: {answer.reason}"
        age = f", {age_s:.1f} s ago" if age_s > 0.05 else ""
        text = f"{method_title(estimate.method)}: {says}{age}"
        corner = self._place(canvas, box, text)
        canvas.label(corner, text, style.ESTIMATE, SAYS)
        return [(*corner, *canvas.size(text))]

    @staticmethod
    def _lines_of(estimate: ComparedEstimate, picture: Picture) -> tuple[Segment, ...]:
        q, t = estimate.answer.q_camera_from_target_wxyz, estimate.answer.t_camera_from_target_m
        if q is None or t is None or not np.isfinite([*q, *t]).all() or np.linalg.norm(q) < 1e-9:
            return ()
        pose = Pose.from_arrays("camera", "target", quat_normalize(q), t)
        return wireframe_at(picture.frame.scene.camera, pose, picture.target)

    def _place(self, canvas: Canvas, box: Letterbox, text: str) -> Point:
        """Return a position below the wireframe inside the picture, or at the lower centre without one."""
        width = canvas.size(text)[0]
        ends = [box.at(p) for line in self._lines for p in line]
        if ends:
            x = (min(p[0] for p in ends) + max(p[0] for p in ends)) / 2 - width / 2
            y = max(p[1] for p in ends) + 8
        else:
            x, y = box.x + (box.width - width) / 2, box.y + 0.72 * box.height
        x = min(max(x, box.x + 8), max(box.x + box.width - width - 8, box.x + 8))
        return x, min(max(y, box.y + 8), box.y + 0.8 * box.height)
