"""The ground truth of one instant as pictures: depth with its scale, parts with their legend, keypoints by state."""

from __future__ import annotations

from abc import abstractmethod
from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from flyaround.gui import style
from flyaround.gui.canvas import Canvas, Key
from flyaround.gui.picture import label_images
from flyaround.gui.picture.figures import AGE_TIP, age_text
from flyaround.gui.picture.further import LABEL_VIEWS
from flyaround.gui.views.letterbox import Letterbox
from flyaround.gui.widgets import Panel

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.gui.canvas import Place
    from flyaround.gui.console import Console
    from flyaround.gui.picture.feed import Picture
    from flyaround.simulator.labels.truth import Truth
    from flyaround.simulator.runtime.arrays import ByteArray

LIT, UNLIT = ("visible", "saturated"), ("shadowed", "eclipsed", "below_noise")
"""States of a keypoint that the craft does not hide."""
SCALE = "camera z of the target, along the boresight [m]; bright is near"
NO_TARGET = "the camera sees no target"


class _LabelView(Panel):
    """A view of the feed of labels; its picture is computed once per frame."""

    name, title, place, shown = "", "", "bottom", False
    bare = True
    legend_tip = ""

    _newest: Picture | None = None
    _part = (slice(0, 1), slice(0, 1))

    def draw(self, console: Console) -> None:
        """Draw into the current view."""
        place = self._free(32.0)
        canvas = Canvas(self._window)
        canvas.clip(place[:2], place[2:])
        feed = console.feeds.get(LABEL_VIEWS)
        picture = None if feed is None else feed.look()
        if picture is None or picture.frame.truth is None:
            canvas.centred(place, console.preparing)
        else:
            if picture is not self._newest:
                self._part = label_images.close_up(picture.frame)
                self._make(picture)
                self._newest = picture
            self._show(canvas, place)
            age, colour = age_text(console.session, picture.frame.scene.t_s)
            canvas.text((place[0] + 8, place[1] + 6 + canvas.line), age, colour, AGE_TIP if age else "")
        canvas.unclip()

    @abstractmethod
    def _make(self, picture: Picture) -> None:
        """Compute the picture of a new frame."""

    @abstractmethod
    def _show(self, canvas: Canvas, place: Place) -> None:
        """Draw the picture computed last."""

    def _image(self, canvas: Canvas, place: Place, image: ByteArray) -> Letterbox:
        """Draw the part of the picture around the target; return the whole picture's place."""
        rows, columns = self._part
        part = image[rows, columns]
        box = Letterbox.fit((part.shape[1], part.shape[0]), place)
        canvas.picture(self.name, self._newest, part, (box.x, box.y, box.width, box.height))
        if part.shape[1] < image.shape[1] and place[3] > 5 * canvas.line:
            text = f"zoom {image.shape[1] / part.shape[1]:.1f}x"
            at = (place[0] + 8, place[1] + place[3] - 1.2 * canvas.line)
            canvas.text(at, text, style.QUIET, "magnification of the camera's whole picture")
        left, top = box.x - columns.start * box.scale, box.y - rows.start * box.scale
        return Letterbox(left, top, image.shape[1] * box.scale, image.shape[0] * box.scale, box.scale)

    def _legend(self, canvas: Canvas, place: Place, rows: Sequence[tuple[str, style.Rgba]]) -> None:
        """Draw names with their colours in a rectangle, as many as have room."""
        x, y, _, h = place
        keys = [Key("area", colour, name, self.legend_tip) for name, colour in rows]
        canvas.legend((x + 10, y + 6), 0.0, keys[: int((h - 6) / canvas.line)])

    def _split(
        self, canvas: Canvas, place: Place, names: Sequence[str], rows: int | None = None
    ) -> tuple[Place, Place]:
        """Return the places of the picture and its legend, at the right, or below in a narrow view."""
        x, y, w, h = place
        width = max((canvas.size(n)[0] for n in names), default=0.0) + 1.2 * canvas.line + 20.0
        if h < (w if w > 2.4 * width else 0.6 * w):
            width = min(width, 0.6 * w)
            return (x, y, w - width, h), (x + w - width, y, width, h)
        height = min((len(names) if rows is None else rows) * canvas.line + 12, 0.6 * h)
        return (x, y, w, h - height), (x, y + h - height, w, height)


class DepthView(_LabelView):
    """Depth of the ground truth, not of the estimate, in colours: bright is near; with its scale in metres."""

    name, title = "depth", "True depth"

    _depth: label_images.DepthPicture | None = None

    def _make(self, picture: Picture) -> None:
        depth = picture.frame.layers.get("depth")
        self._depth = None if depth is None else label_images.depth_picture(depth)

    def _show(self, canvas: Canvas, place: Place) -> None:
        depth = self._depth
        if depth is None:
            canvas.centred(place, NO_TARGET)
            return
        picture, scale = self._split(canvas, place, ("0000.00 m    ",), rows=7)
        self._image(canvas, picture, depth.image)
        x, y, _, h = scale
        line = canvas.line
        left, top = x + 12, y + 1.3 * line
        height = max(h - 2.6 * line, line)
        scale_rgb = label_images.depth_colours()[:, None]
        canvas.picture("depth-scale", depth, np.repeat(scale_rgb, 16, axis=1), (left, top, 16, height))
        digits = max(0, int(np.ceil(-np.log10(max(depth.far_m - depth.near_m, 1e-6)))) + 1)
        nearest, farthest = f"{depth.near_m:.{digits}f} m", f"{depth.far_m:.{digits}f} m"
        canvas.plain_text((left, top - 1.1 * line), nearest, tip="camera z of the target's nearest point")
        canvas.plain_text((left, top + height + 0.1 * line), farthest, tip="camera z of its farthest")
        canvas.tip((left, top), (21, height), SCALE)
        for tick in depth.ticks_m:
            at = top + (tick - depth.near_m) / (depth.far_m - depth.near_m) * height
            canvas.stroke([(left + 16, at), (left + 21, at)], style.INK, 1.0, halo=False)
            if top + 0.6 * line < at < top + height - 0.6 * line:
                canvas.plain_text((left + 25, at - line / 2), f"{tick:.{digits}f}", style.QUIET, SCALE)


class PartsView(_LabelView):
    """Parts of the target by the ground truth, not the estimate, in the colours of their classes."""

    name, title = "parts", "True parts"
    legend_tip = "class of the part, as capture --labels parts writes it"

    _image_rgb: ByteArray | None = None
    _rows: Sequence[tuple[str, style.Rgba]] = ()

    def _make(self, picture: Picture) -> None:
        parts = label_images.part_picture(picture.frame)
        self._image_rgb, classes = (None, ()) if parts is None else parts
        self._rows = [(n.replace("_", " "), label_images.PART_COLOURS[n]) for n in classes]

    def _show(self, canvas: Canvas, place: Place) -> None:
        if self._image_rgb is None:
            canvas.centred(place, NO_TARGET)
            return
        picture, legend = self._split(canvas, place, [name for name, _ in self._rows])
        self._image(canvas, picture, self._image_rgb)
        self._legend(canvas, legend, self._rows)


class KeypointsView(_LabelView):
    """Keypoints of the ground truth by their states, as a data set has them, over the dimmed picture."""

    name, title = "keypoints", "True keypoints"
    legend_tip = "how many keypoints are in this state: dots are seen, diamonds unlit, rings hidden"

    _image_rgb: ByteArray | None = None
    _truth: Truth | None = None

    def _make(self, picture: Picture) -> None:
        self._image_rgb, self._truth = label_images.dimmed(picture.frame), picture.frame.truth

    def _show(self, canvas: Canvas, place: Place) -> None:
        truth = self._truth
        if truth is None or self._image_rgb is None:
            return
        count = Counter(k.state for k in truth.keypoints)
        rows = [(f"{n} {s.replace('_', ' ')}", label_images.STATE_COLOURS[s]) for s, n in count.items()]
        picture, legend = self._split(canvas, place, [name for name, _ in rows])
        box = self._image(canvas, picture, self._image_rgb)
        for k in truth.keypoints:
            if k.pixel_px is not None and k.state != "out_of_frame":
                mark = "visible" if k.state in LIT else "shadowed" if k.state in UNLIT else "hidden"
                canvas.keypoint(box.at(k.pixel_px), label_images.STATE_COLOURS[k.state], mark)
        self._legend(canvas, legend, rows)
