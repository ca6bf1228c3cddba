"""Stored images as frames of a camera: looped, with the frame numbers and times of a flight."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import msgspec

from flyaround.simulator.dataset.formats.native import read_png
from flyaround.simulator.errors import UserError
from flyaround.simulator.frame import NO_RADIANCE, Frame
from flyaround.simulator.labels.truth import Truth, read_truth
from flyaround.simulator.scene.record import SceneRecord

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    from flyaround.simulator.scenario.plan import Plan
    from flyaround.simulator.scene.state import SceneState

# Maximum size of cached decoded images [bytes]; others are decoded again in each loop.
MAX_CACHED_BYTES = 1 << 30


@dataclass(frozen=True, eq=False)
class StoredPicture:
    """Stored image with its known metadata."""

    path: Path
    image: NDArray[np.unsignedinteger]
    truth: Truth | None


def pictures_in(folder: Path) -> list[Path]:
    """Return the PNG files of a folder, or of a data set's ``images``.

    Returns
    -------
    list of Path
        Files by name, at least one, without masks and other layers.

    Raises
    ------
    UserError
        If there is none.
    """
    image_folder = folder / "images" if (folder / "images").is_dir() else folder
    # layers have a second suffix: 000000.mask.png
    paths = []
    if image_folder.is_dir():
        paths = sorted(path for path in image_folder.glob("*.png") if "." not in path.stem)
    if not paths:
        raise UserError(f"{folder} holds no .png pictures: name a folder of pictures or a data set")
    return paths


def frames_of_folder(plan: Plan, folder: Path) -> Iterator[Frame]:
    """Yield frames of a folder's images, looped until the plan ends.

    Each round has new frame numbers and times, those of the plan. An image with a truth record next to it (as in a data
    set) keeps its own camera, sensor, exposure and truth. Other images use those of the plan, and their pose is
    unknown.

    Raises
    ------
    UserError
        If an image does not match the camera, or shows another target.
    """
    paths = pictures_in(folder)
    cache: dict[int, StoredPicture] = {}
    cached_bytes = 0
    for k in range(plan.n_frames):
        j = k % len(paths)
        picture = cache.get(j)
        if picture is None:
            picture = _read(paths[j])
            if cached_bytes + picture.image.nbytes <= MAX_CACHED_BYTES:
                cache[j] = picture
                cached_bytes += picture.image.nbytes
        yield _frame(plan.scene(k), picture)


def _read(path: Path) -> StoredPicture:
    record = path.with_suffix(".json")
    return StoredPicture(path, read_png(path), read_truth(record) if record.is_file() else None)


def _frame(planned: SceneState, picture: StoredPicture) -> Frame:
    truth = picture.truth
    if truth is None:
        scene = planned
    else:
        if truth.scene.target != planned.target:
            raise UserError(
                f"{picture.path} shows {truth.scene.target.name} but the scenario flies {planned.target.name}, or"
                " another version of it: name a scenario of the same target"
            )
        scene = replace(
            truth.scene, epoch_utc=planned.epoch_utc, t_s=planned.t_s, frame_index=planned.frame_index
        )
        truth = msgspec.structs.replace(
            truth,
            epoch_utc=planned.epoch_utc,
            t_s=planned.t_s,
            frame_index=planned.frame_index,
            record=SceneRecord.from_scene(scene),
        )
    image, bits = picture.image, scene.sensor.bits
    shape = (scene.camera.height_px, scene.camera.width_px)
    if image.shape != shape or image.dtype.itemsize != (1 if bits <= 8 else 2):
        height, width, *channels = image.shape
        actual = f"{width} x {height} px, {(channels or [1])[0]} channel(s), {8 * image.dtype.itemsize} bits"
        expected = f"{shape[1]} x {shape[0]} px, one channel, {bits} bits"
        raise UserError(
            f"{picture.path} has {actual}, but the camera delivers {expected}: use the pictures' camera in the scenario"
        )
    return Frame(scene, image, NO_RADIANCE, truth)
