"""Search of the console's last frame for texts that are cut off or lie over another one.

Dear ImGui hands the window quads of letters. A letter that reaches out of its clip rectangle, or whose quad was made
smaller than the letter is, is not read whole; texts whose boxes share room are not read at all.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from flyaround.gui.surface import Surface
    from flyaround.simulator.runtime.arrays import FloatArray

Box = tuple[float, float, float, float]
"""x0, y0, x1, y1 on the screen."""
VERTEX = np.dtype([("at", np.float32, 2), ("uv", np.float32, 2), ("colour", np.uint32)])
LETTERS = [chr(c) for c in range(33, 127)] + ["°", "µ", "²", "±", "·"]
OUT = 1.0
"""Screen units by which a letter may leave its place: the soft edge of its last column."""
SHARED = 0.2
"""Of the smaller text's area: less is a descender that touches the line below."""
OUTLINE = 2.5
"""Copies of a text that are no farther apart are one text with its outline."""
SCROLLED = frozenset({"WindowOverViewport_11111111"})
"""The tabs of docks, which have arrows where there are more than fit."""
_QUAD = np.array([0, 1, 2, 0, 2, 3])

Glyphs = dict[tuple[int, int], tuple[str, float, float]]
"""Letters by the place of their upper left corner in the font's texture, with the lower right one."""


@dataclass(frozen=True)
class TextRun:
    """Letters in one line.

    Parameters
    ----------
    window : that they are in. box : about them. cut : whether a letter is not whole.
    """

    window: str
    text: str
    box: Box
    cut: bool


def faults_of(runs: Sequence[TextRun]) -> list[str]:
    """What is wrong with texts."""
    single = _without_outlines(runs)
    faults = [f"{r.window}: '{r.text}' is cut off" for r in single if r.cut and r.window not in SCROLLED]
    by_window: dict[str, list[TextRun]] = {}
    for run in single:
        by_window.setdefault(run.window, []).append(run)
    for name, texts in by_window.items():
        faults += [
            f"{name}: '{a.text}' and '{b.text}' lie over each other"
            for a, b in combinations(texts, 2)
            if _shared(a.box, b.box) > SHARED
        ]
    return list(dict.fromkeys(faults))


def drawn_texts(window: Surface) -> list[TextRun]:
    """Every line of letters that the last frame drew."""
    imgui = window.imgui
    glyphs = _glyphs(window)
    runs: list[TextRun] = []
    for part in imgui.get_draw_data().cmd_lists:
        vertices = array_of(part.vtx_buffer, VERTEX)
        indices = array_of(part.idx_buffer, np.dtype(np.uint32 if imgui.INDEX_SIZE == 4 else np.uint16))
        for command in part.cmd_buffer:
            if command.elem_count == 0:
                continue
            chosen = indices[command.idx_offset : command.idx_offset + command.elem_count]
            clip = command.clip_rect
            box = (clip.x, clip.y, clip.z, clip.w)
            runs += runs_of(part._owner_name, vertices[command.vtx_offset :], chosen, box, glyphs)
    return runs


def array_of(buffer: Any, kind: np.dtype) -> np.ndarray:
    size = buffer.size() * kind.itemsize
    if size == 0:
        return np.zeros(0, kind)
    raw = (ctypes.c_ubyte * size).from_address(buffer.data_address())
    return np.frombuffer(raw, kind).copy()


def _glyphs(window: Surface) -> Glyphs:
    """The letters of both fonts at the size that panels have."""
    imgui = window.imgui
    size = imgui.get_style().font_size_base * imgui.get_style().font_scale_main
    glyphs: Glyphs = {}
    for font in (window.text_font, window.figure_font):
        baked = font.get_font_baked(size)
        for letter in LETTERS:
            g = baked.find_glyph_no_fallback(ord(letter))
            if g is not None:
                glyphs[_key(g.u0, g.v0)] = (letter, float(g.u1), float(g.v1))
    return glyphs


def _key(u: float, v: float) -> tuple[int, int]:
    # textures have a few thousand texels
    return round(u * 16384), round(v * 16384)


def runs_of(
    owner: str, vertices: np.ndarray, indices: np.ndarray, clip: Box, glyphs: Glyphs
) -> Iterable[TextRun]:
    """The lines of letters of one draw command, but for those that lie outside its clip rectangle.

    Parameters
    ----------
    vertices : (n,) of `VERTEX`. indices : of its triangles. glyphs : the letters that are known.
    """
    quads = _letter_quads(vertices, indices, glyphs)
    name = owner.rsplit("###", maxsplit=1)[-1].split("/", maxsplit=1)[0]
    run: list[tuple[str, FloatArray, bool]] = []
    for quad in quads:
        letter, box, whole = quad
        if run:
            last = run[-1][1]
            near = box[0] >= run[0][1][0] and -2.0 < box[0] - last[2] < 0.7 * (last[3] - last[1] + 8.0)
            if not near or abs((box[1] + box[3]) - (last[1] + last[3])) > 14.0:
                yield from _run(name, run, clip)
                run = []
        run.append((letter, box, whole))
    if run:
        yield from _run(name, run, clip)


def _letter_quads(
    vertices: np.ndarray, indices: np.ndarray, glyphs: Glyphs
) -> list[tuple[str, FloatArray, bool]]:
    """Letter, box, and whether its quad is as large as the letter, of each quad that shows one."""
    found = []
    k, n = 0, len(indices)
    while k + 6 <= n:
        first = int(indices[k])
        if np.array_equal(indices[k : k + 6] - first, _QUAD):
            corners = vertices[first : first + 4]
            uv, at = corners["uv"], corners["at"]
            known = glyphs.get(_key(*uv[0]))
            if known is not None and uv[0, 1] == uv[1, 1] and uv[2, 0] == uv[1, 0] > uv[0, 0]:
                letter, u1, _ = known
                whole = abs(u1 - float(uv[2, 0])) < 1e-5
                found.append((letter, np.concatenate([at[0], at[2]]).astype(float), whole))
            k += 6
        else:
            k += 3
    return found


def _run(name: str, run: list[tuple[str, FloatArray, bool]], clip: Box) -> Iterable[TextRun]:
    boxes = np.array([b for _, b, _ in run])
    box = (boxes[:, 0].min(), boxes[:, 1].min(), boxes[:, 2].max(), boxes[:, 3].max())
    seen = (max(box[0], clip[0]), max(box[1], clip[1]), min(box[2], clip[2]), min(box[3], clip[3]))
    if seen[2] - seen[0] < 2.0 or seen[3] - seen[1] < 2.0:
        return
    # lines that are cut above or below are scrolled; one that is cut across is lost
    out = box[0] < clip[0] - OUT or box[2] > clip[2] + OUT
    text = "".join(letter for letter, _, _ in run)
    x0, y0, x1, y1 = (float(v) for v in seen)
    yield TextRun(name, text, (x0, y0, x1, y1), out or not all(whole for _, _, whole in run))


def _without_outlines(runs: Sequence[TextRun]) -> list[TextRun]:
    """Each text once, where copies of it make its outline."""
    kept: dict[tuple[str, str], list[TextRun]] = {}
    for run in runs:
        same = kept.setdefault((run.window, run.text), [])
        if not any(np.abs(np.subtract(run.box, other.box)).max() <= OUTLINE for other in same):
            same.append(run)
    return [run for same in kept.values() for run in same]


def _shared(a: Box, b: Box) -> float:
    """Room that two boxes share, over the smaller one's."""
    w = min(a[2], b[2]) - max(a[0], b[0])
    h = min(a[3], b[3]) - max(a[1], b[1])
    if w <= 0 or h <= 0:
        return 0.0
    smaller = min((x[2] - x[0]) * (x[3] - x[1]) for x in (a, b))
    return w * h / max(smaller, 1e-6)
