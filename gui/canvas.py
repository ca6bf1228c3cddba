"""Drawing over pictures and maps: lines, marks and text with a dark outline, in screen units."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from flyaround.gui import hover_text, style
from flyaround.gui.texts import texts

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from flyaround.gui.surface import ImageSource, Surface
    from flyaround.simulator.runtime.arrays import FloatArray

Point = tuple[float, float]
Place = tuple[float, float, float, float]
"""x, y, width and height on the screen."""
MOST_POINTS = 600
"""Largest number of points per line; more than a panel has pixels would be invisible."""
# offsets of the dark halo around a text
_AROUND = ((-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1))


class Key(NamedTuple):
    """An entry of a legend.

    Parameters
    ----------
    sample : str
        Form of the sample: ``line``, ``dashes``, ``arrow``, ``dot``, ``diamond`` or ``area``.
    rgba : Rgba
        Colour.
    name : str
        Name of what is drawn so.
    tip : str, optional
        Hover text.
    """

    sample: str
    rgba: style.Rgba
    name: str
    tip: str = ""


def legend_keys(subject: str) -> list[Key]:
    """Return the legend of a map, in the order of the texts."""
    rows = texts(subject).items()
    return [Key(sample, getattr(style, colour), name, tip) for name, (sample, colour, tip) in rows]


class Canvas:
    """Drawing surface of the current window.

    Parameters
    ----------
    window : Surface
        Surface with the fonts and scale.
    """

    def __init__(self, window: Surface) -> None:
        self._window = window
        self._imgui = window.imgui
        self._draw = self._imgui.get_window_draw_list()

    @property
    def line(self) -> float:
        """Height of a line of text [px]."""
        return float(self._imgui.get_text_line_height_with_spacing())

    def size(self, text: str) -> Point:
        """Return width and height of a text."""
        size = self._imgui.calc_text_size(text)
        return (float(size.x), float(size.y))

    def vec(self, p: Sequence[float]) -> Any:  # noqa: ANN401 - an imgui value
        """Return a point."""
        return self._imgui.ImVec2(float(p[0]), float(p[1]))

    def color(self, rgba: style.Rgba) -> int:
        """Return a colour for the draw list."""
        return int(self._imgui.color_convert_float4_to_u32(self._imgui.ImVec4(*rgba)))

    # --- clipping

    def clip(self, corner: Point, size: Point) -> None:
        """Draw inside a rectangle only, until `unclip`."""
        end = (corner[0] + size[0], corner[1] + size[1])
        self._draw.push_clip_rect(self.vec(corner), self.vec(end), True)

    def unclip(self) -> None:
        """End the clipping of `clip`."""
        self._draw.pop_clip_rect()

    # --- text

    def text(self, at: Point, text: str, rgba: style.Rgba = style.INK, tip: str = "") -> None:
        """Draw text with an outline, legible on black and white; ``tip`` is its hover text."""
        # whole pixels, because text blurs in between
        x, y = float(round(at[0])), float(round(at[1]))
        halo = self.color((*style.HALO[:3], style.HALO[3] * rgba[3]))
        for dx, dy in _AROUND:
            self._draw.add_text(self.vec((x + dx, y + dy)), halo, text)
        self.plain_text(at, text, rgba, tip)

    def centred(self, place: Place, *lines: str) -> None:
        """Draw lines centred in a rectangle."""
        for k, text in enumerate(lines):
            width, height = self.size(text)
            at = (place[0] + (place[2] - width) / 2, place[1] + place[3] / 2 + (k - 0.5) * 1.4 * height)
            self.text(at, text)

    def plain_text(self, at: Point, text: str, rgba: style.Rgba = style.INK, tip: str = "") -> None:
        """Draw text without an outline, for a dark background."""
        self._draw.add_text(self.vec((round(at[0]), round(at[1]))), self.color(rgba), text)
        if tip:
            self.tip(at, self.size(text), tip)

    def label(self, at: Point, text: str, rgba: style.Rgba = style.INK, tip: str = "") -> None:
        """Draw text on a plate that hides the lines of a map."""
        width, height = self.size(text)
        self.box((at[0] - 3, at[1] - 1), (width + 6, height + 2), (*style.RAISED[:3], 0.9), 3.0)
        self.plain_text(at, text, rgba, tip)

    def legend(self, corner: Point, width: float, keys: Iterable[Key]) -> float:
        """Draw keys from left to right, in lines up to a width; return the height of all lines."""
        (x, y), line = corner, self.line
        for key in keys:
            wide = self.size(key.name)[0] + 2.0 * line
            if x > corner[0] and x + wide > corner[0] + width:
                x, y = corner[0], y + line
            middle = (x + 0.5 * line, y + 0.45 * line)
            if key.sample == "area":
                self.box((x, y + 0.15 * line), (0.6 * line, 0.6 * line), key.rgba, 2.0)
            elif key.sample in {"dot", "diamond"}:
                getattr(self, key.sample)(middle, 0.21 * line, key.rgba)
            elif key.sample == "arrow":
                self.arrow((x + 0.1 * line, middle[1]), (x + line, middle[1]), key.rgba)
            else:
                ends = [(x, middle[1]), (x + line, middle[1])]
                self.stroke(ends, key.rgba, 2.0, halo=False, dashed=key.sample == "dashes")
            self.plain_text((x + 1.2 * line, y), key.name, style.INK, key.tip)
            x += wide
        return y + line - corner[1]

    def tip(self, corner: Point, size: Point, text: str) -> None:
        """Give a rectangle a hover text."""
        with self._window.ctx.push_font(self._window.text_font, 0.0):
            hover_text.area_tip(self._imgui, corner, size, text)

    # --- lines

    def stroke(
        self,
        points: FloatArray | Sequence[Point],
        rgba: style.Rgba,
        width: float = 1.5,
        *,
        closed: bool = False,
        halo: bool = True,
        dashed: bool = False,
    ) -> None:
        """Draw a line through points (n, 2), with an outline; non-finite points interrupt it."""
        for run in finite_runs(thinned(np.asarray(points, float).reshape(-1, 2))):
            ring = closed and len(run) == len(points)
            parts = dashes(np.vstack([run, run[:1]]) if ring else run) if dashed else [run]
            lines = [[self._imgui.ImVec2(x, y) for x, y in part.tolist()] for part in parts]
            forms = self._imgui.ImDrawFlags_
            flags = forms.closed if ring and not dashed else forms.none
            for outline in (True, False) if halo else (False,):
                shade = (*style.HALO[:3], 0.55 * rgba[3]) if outline else rgba
                weight = width + 2.0 if outline else width
                for line in lines:
                    self._draw.add_polyline(line, self.color(shade), weight, flags)

    def circle(self, centre: Point, radius: float, rgba: style.Rgba, width: float = 1.5) -> None:
        """Draw a ring with an outline."""
        sides = 0 if radius < 200 else 128
        halo = self.color((*style.HALO[:3], 0.55 * rgba[3]))
        self._draw.add_circle(self.vec(centre), radius, halo, sides, width + 2.0)
        self._draw.add_circle(self.vec(centre), radius, self.color(rgba), sides, width)

    def rays(
        self, centre: Point, start: float, end: float, rgba: style.Rgba, width: float, count: int = 4
    ) -> None:
        """Draw lines that lead away from a point, from one distance to another: a reticle, if they are four."""
        for turn in np.arange(count) * 2 * np.pi / count:
            outward = np.array([np.cos(turn), np.sin(turn)])
            self.stroke(centre + np.outer([start, end], outward), rgba, width)

    def arrow(self, tail: Point, tip: Point, rgba: style.Rgba, width: float = 1.5) -> None:
        """Draw a line with a head at its tip."""
        a, b = np.array(tail), np.array(tip)
        length = float(np.linalg.norm(b - a))
        if length < 1e-6:
            return
        along = (b - a) / length
        across = np.array([-along[1], along[0]])
        head = min(7.0 * self._window.scale, length)
        base = b - head * along
        self.stroke([tail, (float(base[0]), float(base[1]))], rgba, width)
        self.area([tip, base + 0.45 * head * across, base - 0.45 * head * across], rgba)

    # --- areas and marks

    def area(self, points: Iterable[Sequence[float]], rgba: style.Rgba) -> None:
        """Draw a filled convex outline."""
        self._draw.add_convex_poly_filled([self.vec(p) for p in points], self.color(rgba))

    def disc(self, centre: Point, radius: float, rgba: style.Rgba) -> None:
        """Draw a filled circle."""
        self._draw.add_circle_filled(self.vec(centre), radius, self.color(rgba), 0 if radius < 200 else 128)

    def box(self, corner: Point, size: Point, rgba: style.Rgba, rounding: float = 0.0) -> None:
        """Draw a filled rectangle."""
        end = (corner[0] + size[0], corner[1] + size[1])
        self._draw.add_rect_filled(self.vec(corner), self.vec(end), self.color(rgba), rounding)

    def dot(self, centre: Point, radius: float, rgba: style.Rgba) -> None:
        """Draw a round mark with an outline."""
        self.disc(centre, radius + 1.5, (*style.HALO[:3], 0.7 * rgba[3]))
        self.disc(centre, radius, rgba)

    def diamond(self, centre: Point, radius: float, rgba: style.Rgba) -> None:
        """Draw a diamond with an outline."""
        x, y = centre
        for r, c in ((radius + 2.0, (*style.HALO[:3], 0.7 * rgba[3])), (radius, rgba)):
            self.area([(x, y - r), (x + r, y), (x, y + r), (x - r, y)], c)

    def keypoint(self, at: Point, rgba: style.Rgba, state: str) -> None:
        """Draw a keypoint by shape and colour: a dot if visible, a diamond if shadowed, a ring if hidden."""
        if state == "hidden":
            self.circle(at, 4.0, rgba, 1.4)
        elif state == "shadowed":
            self.diamond(at, 5.0, rgba)
        else:
            self.dot(at, 4.0, rgba)

    def picture(self, view: str, key: object, image: ImageSource, place: Place) -> None:
        """Draw an image over a rectangle of whole units.

        Parameters
        ----------
        view : str
            Name of the view; each has its own texture.
        key : object
            Object that stands for the picture's content, compared by identity.
        image : ByteArray or callable
            (H, W) or (H, W, 3) screen values, or a function that computes them for a new ``key``.
        place : tuple of float
            Column and row of the top left corner, width and height, rounded to whole units.
        """
        x, y, w, h = (float(round(v)) for v in place)
        texture = self._window.show_picture(view, key, image, size=(w, h))
        self._draw.add_image(texture, self.vec((x, y)), self.vec((x + w, y + h)))


def thinned(points: FloatArray, most: int = MOST_POINTS) -> FloatArray:
    """Return a line with fewer points, evenly spaced, including its last one.

    Parameters
    ----------
    points : (n, 2) array
        Screen positions.
    most : int, optional
        Approximate number of remaining points.
    """
    if len(points) <= most:
        return points
    return np.vstack([points[:: -(-len(points) // most)], points[-1:]])


def finite_runs(points: FloatArray) -> list[FloatArray]:
    """Return the runs of at least two finite points of a line (n, 2)."""
    good = np.isfinite(points).all(axis=1)
    cuts = np.flatnonzero(np.diff(good.astype(np.int8))) + 1
    return [run for run in np.split(points, cuts) if len(run) > 1 and np.isfinite(run[0]).all()]


def dashes(points: FloatArray, on: float = 7.0, off: float = 5.0, most: int = 400) -> list[FloatArray]:
    """Return a line divided into dashes of equal length.

    Parameters
    ----------
    points : (n, 2) array
        Finite.
    on : float, optional
        Length of a dash.
    off : float, optional
        Length of a gap.
    most : int, optional
        Number of dashes; longer lines get longer ones.
    """
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    at = np.concatenate([[0.0], np.cumsum(steps)])
    if at[-1] <= on:
        return [points]
    period = max(on + off, at[-1] / most)
    share = on / (on + off)
    parts = []
    for start in np.arange(0.0, at[-1], period):
        end = min(start + share * period, at[-1])
        inside = points[(at > start) & (at < end)]
        ends = [[np.interp(s, at, points[:, k]) for k in (0, 1)] for s in (start, end)]
        parts.append(np.vstack([ends[:1], inside, ends[1:]]))
    return parts


def point(p: FloatArray) -> Point:
    """Return the first two numbers of an array as a screen position."""
    return (float(p[0]), float(p[1]))
