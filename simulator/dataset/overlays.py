"""Copies of a data set's images with labels drawn over them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.dataset.formats.native import encode_png
from flyaround.simulator.dataset.labelled_dataset import open_dataset
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.overlay import (
    draw_axes,
    draw_box,
    draw_keypoints,
    draw_outline,
    draw_wireframe,
    screen_rgb,
)
from flyaround.simulator.labels.truth import Truth
from flyaround.simulator.runtime.files import empty_folder, write_atomic
from flyaround.simulator.targets.joined_mesh import joined_mesh
from flyaround.simulator.targets.library import load_target

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from flyaround.simulator.dataset.formats.labelled_frame import LabelledFrame
    from flyaround.simulator.runtime.arrays import ByteArray
    from flyaround.simulator.targets.model import Target

MARKS = ("axes", "wireframe", "keypoints", "box", "mask")

_AXIS_LENGTH = 0.6
"""Length of an arrow relative to the distance of the mesh's farthest vertex."""


def parse_marks(text: str) -> tuple[str, ...]:
    """Parse a comma-separated list of marks to draw.

    Returns
    -------
    tuple of str
        Distinct marks in the order of the text, at least one.

    Raises
    ------
    UserError
        If it names nothing, or an unknown mark.
    """
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    unknown = [name for name in names if name not in MARKS]
    if unknown or not names:
        problem = f"there is no '{unknown[0]}'" if unknown else "nothing is named"
        raise UserError(f"--draw '{text}': {problem}; choose from {', '.join(MARKS)}")
    return names


def write_overlays(
    folder: Path,
    output: Path,
    marks: tuple[str, ...] = ("axes",),
    n: int | None = None,
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> int:
    """Write ``NNNNNN.png`` of a data set's frames with marks; return their number.

    Parameters
    ----------
    folder : Path
        Data set.
    output : Path
        New or empty folder outside it.
    marks : tuple of str, optional
        Names out of `MARKS`, in drawing order.
    n : int, optional
        Number of frames, spread evenly; by default all.
    progress : callable, optional
        Called with the number done, and the total.

    Returns
    -------
    int
        Number of written images.

    Raises
    ------
    UserError
        If the folder is not a data set, its target differs from the one here, or ``output`` is in use or within it.
    """
    frames = open_dataset(folder)
    target = load_target(frames.card.target.name)
    if target.sha256 != frames.card.target.sha256:
        raise UserError(
            f"the target {target.name} of data set {folder} is not the one here ({target.sha256[:12]}, there "
            f"{frames.card.target.sha256[:12]}); use the flyaround version named in its card"
        )
    if folder.resolve() in (output.resolve(), *output.resolve().parents):
        raise UserError(f"{output} is within the data set {folder}; name a folder elsewhere with -o")
    empty_folder(output)
    indices = np.linspace(0, len(frames) - 1, min(n or len(frames), len(frames))).round().astype(int)
    for n_done, k in enumerate(indices.tolist()):
        write_atomic(output / f"{frames[k].number:06d}.png", encode_png(overlay(frames[k], target, marks)))
        progress(n_done + 1, len(indices))
    return len(indices)


def overlay(frame: LabelledFrame, target: Target, marks: tuple[str, ...]) -> ByteArray:
    """Return a frame's image, (H, W, 3) RGB, with marks drawn over it.

    Parameters
    ----------
    frame : LabelledFrame
        Frame with its labels.
    target : Target
        Model that the data set names.
    marks : tuple of str
        Names out of `MARKS`.

    Returns
    -------
    (H, W, 3) array
        RGB, 8 bits.
    """
    truth, camera, pose = frame.truth, frame.camera, frame.pose
    if isinstance(truth, Truth):
        sensor = truth.scene.sensor
    else:
        sensor = replace(sensor_preset("ideal"), bits=8 * frame.image.itemsize)
    variant = target if not isinstance(truth, Truth) else truth.scene.target.drawn(target)
    radius_m = float(np.linalg.norm(joined_mesh(variant).positions_m, axis=1).max())
    canvas = screen_rgb(frame.image, sensor, camera.pixel_encoding)
    for mark in marks:
        if mark == "axes":
            canvas = draw_axes(canvas, camera, pose, _AXIS_LENGTH * radius_m)
        elif mark == "wireframe":
            canvas = draw_wireframe(canvas, camera, pose, variant)
        elif mark == "keypoints":
            canvas = draw_keypoints(canvas, camera, truth.keypoints)
        elif mark == "box":
            canvas = draw_box(canvas, camera, truth.box_px)
        else:
            canvas = draw_outline(canvas, camera, frame.mask)
    return canvas
