"""One picture and its truth, without a data set around it."""

from __future__ import annotations

import io
from statistics import median
from typing import TYPE_CHECKING

import numpy as np

from simulator.dataset.exr import encode_exr
from simulator.dataset.native import encode_png, write_layers
from simulator.dataset.poses import scene_with_pose
from simulator.errors import UserError
from simulator.files import write_atomic
from simulator.labels.frame import Frame, take_frame
from simulator.labels.truth import truth_to_json
from simulator.render.renderer import Renderer

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from simulator.labels.request import LabelRequest
    from simulator.render.earth_maps import EarthMaps
    from simulator.scene.state import Bands, SceneState
    from simulator.targets.model import Target
    from simulator.world.pose import Pose

SUFFIXES = (".png", ".npy", ".exr")


def render_scene(
    scene: SceneState,
    target: Target,
    *,
    labels: LabelRequest | None = None,
    device_index: int | None = None,
    begun: Mapping[Bands, EarthMaps] | None = None,
) -> Frame:
    """Draw one scene with labels in a renderer of its own.

    Parameters
    ----------
    labels : layers to give beyond truth and mask. begun : as of `Renderer`.

    Raises
    ------
    UserError
        If the target's hash is not the scene's: the bytes could not be the same.
    """
    if target.sha256 != scene.target.sha256:
        raise UserError(
            f"the scene was drawn with target {scene.target.name} {scene.target.sha256[:12]}, here it is "
            f"{target.sha256[:12]}; use the flyaround version named in the record"
        )
    with Renderer(device_index=device_index, begun=begun) as renderer:
        return take_frame(renderer, scene, target, labels=labels or True)


def time_passes(
    scene: SceneState, target: Target, *, repeats: int = 5, device_index: int | None = None
) -> dict[str, float]:
    """Time of each stage and pass of a scene [ms]: medians of ``repeats`` pictures after a first that fills caches."""
    with Renderer(device_index=device_index, timed=True) as renderer:
        ledgers = [take_frame(renderer, scene, target, labels=False).stage_ms for _ in range(repeats + 1)][1:]
    return {name: median(ledger[name] for ledger in ledgers) for name in ledgers[0]}


def render_poses(
    scene: SceneState,
    target: Target,
    poses: Sequence[Pose],
    *,
    labels: LabelRequest,
    device_index: int | None = None,
    begun: Mapping[Bands, EarthMaps] | None = None,
) -> Iterator[Frame]:
    """Draw a scene with the craft at each of a list of poses, camera and light as they are."""
    with Renderer(device_index=device_index, begun=begun) as renderer:
        for k, pose in enumerate(poses):
            yield take_frame(renderer, scene_with_pose(scene, target, pose, k), target, labels=labels)


def save_picture(frame: Frame, path: Path) -> Path:
    """Write the image by its ending, the truth to ``.json`` and the layers beside it; returns the truth's path.

    Raises
    ------
    UserError
        If the ending is not known or the folder cannot be written.
    """
    if path.suffix not in SUFFIXES:
        raise UserError(
            f"cannot write '{path.suffix}' images ({path}); end the name in {' or '.join(SUFFIXES)}"
        )
    if not path.parent.is_dir():
        raise UserError(f"folder {path.parent} does not exist; make it, or name another place with -o")
    if frame.truth is None:
        raise RuntimeError("a saved picture needs its truth")
    write_atomic(path, _encode(frame, path.suffix))
    truth_path = path.with_suffix(".json")
    write_layers(path.parent, path.stem, frame)
    write_atomic(truth_path, truth_to_json(frame.truth))
    return truth_path


def _encode(frame: Frame, suffix: str) -> bytes:
    if suffix == ".png":
        return encode_png(frame.image)
    if suffix == ".npy":
        buffer = io.BytesIO()
        np.save(buffer, frame.image)
        return buffer.getvalue()
    # radiance before the detector [W m-2 sr-1], one channel Y or three
    return encode_exr(("Y",) if frame.radiance.ndim == 2 else ("R", "G", "B"), frame.radiance)
