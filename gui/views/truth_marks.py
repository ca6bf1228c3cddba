"""The truth over the camera's picture: keypoints with their names, box, axes, wireframe; crosshair and rings."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from flyaround.gui import style
from flyaround.gui.canvas import Canvas
from flyaround.gui.picture.label_placement import PlacedLabel, is_free, place_labels
from flyaround.gui.picture.truth_overlay import Marker, Marks, Seen

if TYPE_CHECKING:
    from flyaround.gui.canvas import Place, Point
    from flyaround.gui.picture.feed import Picture
    from flyaround.gui.picture.view_settings import Options
    from flyaround.gui.surface import Surface
    from flyaround.gui.views.letterbox import Letterbox
    from flyaround.simulator.targets.model import Target

SEEN_COLORS: dict[Seen, style.Rgba] = {"visible": style.GOOD, "shadowed": style.WARN, "hidden": style.BAD}
RINGS_DEG = (5, 10, 15)


class TruthMarks:
    """Marks of the present picture, with cached positions of their names.

    Parameters
    ----------
    window : Surface
        Surface to draw in.
    """

    def __init__(self, window: Surface) -> None:
        self._window = window
        self._target: Target | None = None
        self._marker: Marker | None = None
        self._marks = Marks()
        self._marks_of: tuple[object, ...] = ()
        self._placed: list[PlacedLabel | None] = []
        self._placed_for: tuple[object, ...] = ()
        self._choices: dict[str, int] = {}

    def draw(
        self,
        box: Letterbox,
        picture: Picture,
        options: Options,
        *,
        paused: bool,
        obstacles: tuple[Place, ...] = (),
    ) -> None:
        """Draw over a picture.

        Parameters
        ----------
        box : Letterbox
            Place of the picture on the screen.
        picture : Picture
            The picture with its truth.
        options : Options
            Options of the overlay.
        paused : bool
            True to compute visibility for this picture.
        obstacles : tuple of Place, optional
            X, y, width, height of other text over the view.
        """
        canvas = Canvas(self._window)
        self._remember(picture, options, paused=paused)
        marks = self._marks
        for line in marks.wireframe:
            canvas.stroke([box.at(p) for p in line], (*style.ACCENT[:3], 0.9), 1.2)
        if marks.box is not None:
            x0, y0, x1, y1 = marks.box
            corners = [box.at(p) for p in ((x0, y0), (x1, y0), (x1, y1), (x0, y1))]
            canvas.stroke(corners, style.WARN, 1.3, closed=True)
            name, (left, top), low = picture.target.name, corners[0], corners[2][1]
            width, height = canvas.size(name)
            for y in (max(top - height, box.y), low, top):
                if is_free((left, y, width, height), obstacles):
                    canvas.text((left, y), name, style.WARN)
                    obstacles = (*obstacles, (left, y, width, height))
                    break
        tips = [box.at(tip) for _, tip in marks.axes]
        # square, so that two letters side by side do not read as one word
        sizes = [(canvas.line, canvas.line)] * len(tips)
        area = (box.x, box.y, box.width, box.height)
        letters = place_labels(tips, sizes, area, obstacles=obstacles)
        for k, ((start, _), letter) in enumerate(zip(marks.axes, letters, strict=True)):
            canvas.stroke([box.at(start), tips[k]], style.AXIS_COLORS[k], 2.2)
            if letter is not None:
                canvas.text(letter.corner, "xyz"[k], style.AXIS_COLORS[k])
                obstacles = (*obstacles, (*letter.corner, *sizes[k]))
        # by shape as well as colour: a dot is lit, a diamond shadowed, a ring hidden
        for pixel, state, _ in marks.keypoints:
            canvas.keypoint(box.at(pixel), SEEN_COLORS[state], state)
        if options.overlays.names:
            self._names(canvas, box, picture if options.overlays.crosshair else None, obstacles)

    def crosshair(self, box: Letterbox, picture: Picture) -> None:
        """Draw the principal point, and a ring every five degrees of field angle."""
        canvas = Canvas(self._window)
        (cx, cy), circles = rings(box, picture)
        canvas.rays((cx, cy), 9.0, 26.0, (*style.ACCENT[:3], 0.9), 1.2)
        for degrees, radius in circles:
            canvas.circle((cx, cy), radius, (*style.ACCENT[:3], 0.45), 1.0)
            at, text = (cx + radius + 5, cy + 2), f"{degrees}°"
            canvas.box((at[0] - 3, at[1]), (canvas.size(text)[0] + 6, canvas.size(text)[1]), style.PLATE, 3.0)
            canvas.plain_text(at, text, style.ACCENT)

    def _remember(self, picture: Picture, options: Options, *, paused: bool) -> None:
        on = options.overlays
        key = (picture, paused, on.keypoints, on.box, on.axes, on.wireframe)
        if key == self._marks_of:
            return
        self._marks_of = key
        target = picture.target
        if not (on.keypoints or on.box or on.axes or on.wireframe):
            # the marker joins the whole mesh, which is not needed for a view without marks
            self._marks = Marks()
            return
        if self._marker is None or target is not self._target:
            self._target, self._marker, self._choices = target, Marker(target), {}
        self._marks = self._marker.marks(picture.frame.scene, on, exact=paused)

    def _names(
        self, canvas: Canvas, box: Letterbox, ringed: Picture | None, others: tuple[Place, ...]
    ) -> None:
        """Draw names of visible keypoints, not over each other or the labels of axes or rings."""
        points = [(box.at(p), state, name) for p, state, name in self._marks.keypoints if state != "hidden"]
        key = (self._marks, box, ringed is None, others)
        if key != self._placed_for:
            self._placed_for = key
            occupied = list(others)
            if ringed is not None:
                (cx, cy), circles = rings(box, ringed)
                occupied += [(cx + r + 3, cy + 1, *canvas.size(f"{d}°")) for d, r in circles]
            places, names = [p for p, _, _ in points], [name for *_, name in points]
            sizes, last = [canvas.size(n) for n in names], [self._choices.get(n) for n in names]
            area = (box.x, box.y, box.width, box.height)
            self._placed = place_labels(places, sizes, area, last_choices=last, obstacles=occupied)
        for (at, state, name), placed in zip(points, self._placed, strict=True):
            if placed is None:
                continue
            self._choices[name] = placed.choice
            if placed.lead is not None:
                canvas.stroke([at, placed.lead], (*SEEN_COLORS[state][:3], 0.8), 1.0)
            # text in the marks' darker colours would be hard to read over clouds
            canvas.text(placed.corner, name, style.INK if state == "visible" else SEEN_COLORS[state])


def rings(box: Letterbox, picture: Picture) -> tuple[Point, list[tuple[int, float]]]:
    """Return the principal point on the screen; and of each visible ring its field angle [deg] and radius."""
    camera = picture.frame.scene.camera
    every = [(degrees, math.tan(math.radians(degrees)) * camera.fx_px * box.scale) for degrees in RINGS_DEG]
    visible = [(degrees, radius) for degrees, radius in every if radius < 0.7 * box.height]
    return box.at((camera.cx_px, camera.cy_px)), visible
