"""The estimated pose over the camera's picture: the target's wireframe where the estimator puts it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from flyaround.gui import hover_text, style
from flyaround.gui.picture.truth_overlay import Segment, wireframe_at
from flyaround.simulator.world.frames.pose import Pose
from flyaround.simulator.world.frames.rotation import quat_normalize

if TYPE_CHECKING:
    from flyaround.gui.jobs.estimates import ComparedEstimate, Estimates
    from flyaround.gui.picture.feed import Picture
    from flyaround.gui.surface import Surface
    from flyaround.gui.views.letterbox import Letterbox

OLD_S = 5.0
"""An estimate of a picture that is older by more of simulated time is not drawn."""
SAYS = "the estimator's method, how sure it is (0 to 1), and how old the picture is that it was given"


class EstimateOverlay:
    """Draws the newest estimate; keeps its lines while estimate and camera stay.

    Parameters
    ----------
    window : drawn in.
    """

    def __init__(self, window: Surface) -> None:
        self._imgui = window.imgui
        self._of: tuple[object, ...] = ()
        self._lines: tuple[Segment, ...] = ()

    def draw(self, draw: Any, box: Letterbox, picture: Picture, estimates: Estimates) -> None:  # noqa: ANN401 - imgui's
        """Draw over a picture what is known of it, or of the one before it."""
        estimate, scene = estimates.newest, picture.frame.scene
        if estimate is None or not estimates.on:
            return
        age_s = scene.t_s - estimate.t_s
        if not 0 <= age_s < OLD_S:
            return
        key = (estimate, scene.camera, picture.target)
        if key != self._of:
            self._of, self._lines = key, self._lines_of(estimate, picture)
        accepted = estimate.answer.accepted
        colour, halo = self._colour(1.0 if accepted else 0.55), self._dark(0.7)
        vec = self._imgui.ImVec2
        ends = [(vec(*box.at(a)), vec(*box.at(b))) for a, b in self._lines]
        for a, b in ends:
            draw.add_line(a, b, halo, 3.4)
        for a, b in ends:
            draw.add_line(a, b, colour, 1.5)
        says = f"{estimate.answer.confidence:.2f}" if accepted else f"declined: {estimate.answer.reason}"
        age = f", {age_s:.1f} s ago" if age_s > 0.05 else ""
        text = f"{estimate.method}  {says}{age}"
        x, y = self._place(box, text)
        for dx, dy in ((-1, 0), (1, 0), (0, -1), (0, 1), (1, 1)):
            draw.add_text(vec(x + dx, y + dy), self._dark(0.85), text)
        draw.add_text(vec(x, y), self._colour(1.0), text)
        size = self._imgui.calc_text_size(text)
        hover_text.tell_place(self._imgui, (x, y), (size.x, size.y), SAYS)

    @staticmethod
    def _lines_of(estimate: ComparedEstimate, picture: Picture) -> tuple[Segment, ...]:
        q, t = estimate.answer.q_camera_from_target_wxyz, estimate.answer.t_camera_from_target_m
        if q is None or t is None or not np.isfinite([*q, *t]).all() or np.linalg.norm(q) < 1e-9:
            return ()
        pose = Pose.of("camera", "target", quat_normalize(q), t)
        return wireframe_at(picture.frame.scene.camera, pose, picture.target)

    def _place(self, box: Letterbox, text: str) -> tuple[float, float]:
        """Under the wireframe, inside the picture; in the middle below where there is none."""
        size = self._imgui.calc_text_size(text)
        ends = [box.at(p) for line in self._lines for p in line]
        if ends:
            x = (min(p[0] for p in ends) + max(p[0] for p in ends)) / 2 - size.x / 2
            y = max(p[1] for p in ends) + 8
        else:
            x, y = box.x + (box.width - size.x) / 2, box.y + 0.72 * box.height
        x = min(max(x, box.x + 8), max(box.x + box.width - size.x - 8, box.x + 8))
        return x, min(max(y, box.y + 8), box.y + 0.8 * box.height)

    def _colour(self, alpha: float) -> int:
        return self._packed((*style.ESTIMATE[:3], alpha))

    def _dark(self, alpha: float) -> int:
        return self._packed((0.0, 0.0, 0.0, alpha))

    def _packed(self, rgba: style.Rgba) -> int:
        return int(self._imgui.color_convert_float4_to_u32(self._imgui.ImVec4(*rgba)))
