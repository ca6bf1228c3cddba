"""Single frames and their truth, without a data set."""

from __future__ import annotations

import io
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.dataset.formats.exr import encode_exr
from flyaround.simulator.dataset.formats.native import encode_png, write_layers
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.truth import truth_to_json
from flyaround.simulator.loop import FrameRequest, open_frames, whole_frame
from flyaround.simulator.runtime.files import empty_folder, write_atomic
from flyaround.simulator.scene.limits import scene_problem

if TYPE_CHECKING:
    from collections.abc import Mapping

    from flyaround.simulator.frame import Frame
    from flyaround.simulator.labels.request import LabelRequest
    from flyaround.simulator.render.earth.map_textures import EarthMaps
    from flyaround.simulator.scene.illumination.bands import Bands
    from flyaround.simulator.scene.state import SceneState
    from flyaround.simulator.targets.model import Target

SUFFIXES = (".png", ".npy", ".exr")

# A record states its kind in the first line.
_HEAD_BYTES = 512


def render_scene(
    scene: SceneState,
    target: Target,
    *,
    labels: LabelRequest | None = None,
    device_index: int | None = None,
    prefetched: Mapping[Bands, EarthMaps] | None = None,
) -> Frame:
    """Draw one scene with labels, in a renderer of its own.

    Parameters
    ----------
    scene : SceneState
        Scene at mid-exposure.
    target : Target
        Target model.
    labels : LabelRequest, optional
        Layers besides truth and mask.
    device_index : int, optional
        EGL device to render on; None for the driver's choice.
    prefetched : mapping, optional
        Maps that are being decoded, see `flyaround.simulator.loop.open_frames`.

    Returns
    -------
    Frame
        Image, radiance, truth and the requested layers.

    Raises
    ------
    UserError
        If a number of the scene is out of range, or the target's hash differs from the scene's, so that the bytes could
        differ.
    """
    problem = scene_problem(scene)
    if problem is not None:
        raise UserError(f"the scene cannot be drawn: {problem}")
    target = scene.target.drawn(target)
    if target.sha256 != scene.target.sha256:
        raise UserError(
            f"the scene was drawn with target {scene.target.name} {scene.target.sha256[:12]}, here it is "
            f"{target.sha256[:12]}; use the flyaround version named in the record"
        )
    with open_frames(
        whole_frame, device_index=device_index, prefetched=prefetched or {}, target=target
    ) as producer:
        producer.submit(FrameRequest(scene=scene, labels=labels or True))
        return producer.result()


def time_passes(
    scene: SceneState, target: Target, *, repeats: int = 5, device_index: int | None = None
) -> dict[str, float]:
    """Measure the time of each stage and pass of a scene, after a warm-up frame.

    Returns
    -------
    dict of str to float
        Medians of ``repeats`` frames [ms], by name of the stage or pass.
    """
    with open_frames(whole_frame, device_index=device_index, prefetched={}, target=target) as producer:
        requests = (FrameRequest(scene=scene, labels=False, timed=True) for _ in range(repeats + 1))
        ledgers = [frame.stage_ms for frame in producer.frames(requests)][1:]
    return {name: median(ledger[name] for ledger in ledgers) for name in ledgers[0]}


def check_picture_path(path: str | Path) -> Path:
    """Return a path that an image and its truth can be written to; an existing image there is replaced.

    Returns
    -------
    Path
        The given path; an existing image there will be replaced.

    Raises
    ------
    UserError
        If the suffix is unknown, the folder does not exist, or the record would replace a file that is not one.
    """
    path = Path(path)
    if path.is_dir():
        raise UserError(f"{path} is a folder; name a file in it, for example {path / 'frame.png'}")
    if not path.suffix:
        raise UserError(
            f"{path} has no suffix, which selects the format; end the name in {' or '.join(SUFFIXES)}"
        )
    if path.suffix not in SUFFIXES:
        raise UserError(
            f"cannot write '{path.suffix}' images ({path}); end the name in {' or '.join(SUFFIXES)}"
        )
    if not path.parent.is_dir():
        raise UserError(f"folder {path.parent} does not exist; make it, or name another place with -o")
    record = path.with_suffix(".json")
    if record.exists() and not _is_truth(record):
        raise UserError(
            f"the truth of {path} would replace {record}, which is not a truth record; choose another name with -o"
        )
    return path


def _is_truth(path: Path) -> bool:
    """Return True if a file looks like a truth record, even a truncated one."""
    try:
        with path.open("rb") as file:
            return b'"flyaround.truth"' in file.read(_HEAD_BYTES)
    except OSError:
        return False


def save_picture(frame: Frame, path: str | Path) -> Path:
    """Write the image in the format of its suffix, truth (``.json``) and layers next to it; return the truth's path.

    Returns
    -------
    Path
        Path of the truth record.

    Raises
    ------
    UserError
        If the suffix is unknown, the folder cannot be written, or an existing ``.json`` is not a truth record.
    """
    path = check_picture_path(path)
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


class NumberedPictures:
    """The sink of `render --poses`: OUT-000000.png and so on, with their truth.

    Parameters
    ----------
    path : Path
        OUT with its suffix. A name without one is a folder (created if missing) of frame-000000.png and so on.
    n_frames : int
        Number of frames.

    Raises
    ------
    UserError
        If one of them cannot be written there.
    """

    def __init__(self, path: Path, n_frames: int) -> None:
        self.written: list[tuple[Path, Path]] = []
        in_folder = path.is_dir() or not path.suffix
        if not in_folder and not (path.suffix in SUFFIXES and path.parent.is_dir()):
            check_picture_path(path)  # report the name that the user typed, not a numbered one
        self._path = empty_folder(path, resume=True) / "frame.png" if in_folder else path
        for k in range(n_frames):
            check_picture_path(self._numbered(k))

    def _numbered(self, k: int) -> Path:
        return self._path.with_name(f"{self._path.stem}-{k:06d}{self._path.suffix}")

    def write(self, frame: Frame) -> None:
        """Write one frame and its truth."""
        image = self._numbered(frame.number)
        self.written.append((image, save_picture(frame, image)))
