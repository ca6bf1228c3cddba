"""Views rendered by several processes into array files, chunk by chunk, so that an interrupted run can resume."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from flyaround.hil.train.keypoints.views import LIGHTS, VIEW_PX, draw_earths, draw_views
from flyaround.simulator.errors import UserError, write_error
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.runtime.task_pool import run_tasks
from flyaround.simulator.targets.library import load_target

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from flyaround.simulator.runtime.arrays import Float32Array
    from flyaround.simulator.targets.model import Target

# Number of views per chunk, and of backgrounds.
CHUNK_VIEWS, N_BACKGROUNDS = 25, 80

# Type and shape of each array of the views.
ARRAYS = {
    "lit": ("u1", (LIGHTS, VIEW_PX, VIEW_PX)),
    "scale": ("f4", (LIGHTS,)),
    "cover": ("u1", (VIEW_PX, VIEW_PX)),
    "label": ("u1", (VIEW_PX, VIEW_PX)),
    "pose": ("f8", (5,)),
}


@dataclass(frozen=True)
class Drawing:
    """Specification of rendered views.

    Parameters
    ----------
    folder : Path
        Folder of the arrays.
    paints : tuple of str
        Targets of the same shape with different surfaces.
    views : int
        Number of views.
    seed : int
        Seed of poses and lights.
    """

    folder: Path
    paints: tuple[str, ...]
    views: int
    seed: int


def render_views(drawing: Drawing, workers: int, progress: Callable[[int, int], None]) -> None:
    """Render the missing chunks.

    Parameters
    ----------
    drawing : Drawing
        Views to render.
    workers : int
        Number of processes.
    progress : callable
        Called with the number of finished views, and the total.

    Raises
    ------
    UserError
        If the disk is full, a process is killed, or the folder holds other views.
    """
    try:
        _create_arrays(drawing)
        chunks = [k for k in range(-1, -(-drawing.views // CHUNK_VIEWS)) if not _marker(drawing, k).exists()]
        done = drawing.views - CHUNK_VIEWS * len([k for k in chunks if k >= 0])
        for k in run_tasks(_draw_chunk, chunks, workers, start=_start, arguments=(drawing,)):
            write_atomic(_marker(drawing, k), b"")
            done += CHUNK_VIEWS if k >= 0 else 0
            progress(min(done, drawing.views), drawing.views)
    except OSError as error:
        raise write_error(drawing.folder, error) from error


def _create_arrays(drawing: Drawing) -> None:
    """Create the arrays, or check that those of an interrupted run belong to the same views."""
    plan = [
        list(drawing.paints),
        [load_target(name).sha256 for name in drawing.paints],
        drawing.views,
        drawing.seed,
    ]
    specification = drawing.folder / "drawing.json"
    drawing.folder.mkdir(parents=True, exist_ok=True)
    if specification.is_file() and specification.read_bytes() != msgspec.json.encode(plan):
        raise UserError(
            f"{drawing.folder} holds views of another target, number or seed; use the same again, or remove the folder"
        )
    for name, (kind, shape) in ARRAYS.items():
        path = drawing.folder / f"{name}.npy"
        if not specification.is_file():
            np.lib.format.open_memmap(path, "w+", kind, (drawing.views, *shape)).flush()
            if hasattr(os, "posix_fallocate"):
                # preallocate: writing into a hole of a sparse file on a full disk would kill the process with a signal
                with path.open("r+b") as file:
                    os.posix_fallocate(file.fileno(), 0, path.stat().st_size)
    if not specification.is_file():
        write_atomic(specification, msgspec.json.encode(plan))


def earths_of(drawing: Drawing) -> Float32Array:
    """Load the rendered backgrounds of a drawing.

    Returns
    -------
    (M, h, w) array
        Signals as of `draw_earths`, rounded to half precision, float32.
    """
    return np.asarray(np.load(drawing.folder / "earths.npy"), np.float32)


def _marker(drawing: Drawing, chunk: int) -> Path:
    return drawing.folder / f"drawn-{chunk}"


# Renderer and targets of a render process, made at its start.
_worker_state: list[tuple[Drawing, Renderer, Sequence[Target]]] = []


def _start(drawing: Drawing) -> None:
    _worker_state.append((drawing, Renderer(), [load_target(name) for name in drawing.paints]))


def _draw_chunk(chunk: int) -> int:
    """Render one chunk of views; number -1 stands for the backgrounds."""
    drawing, renderer, paints = _worker_state[0]
    if chunk < 0:
        earths = draw_earths(renderer, paints[0], N_BACKGROUNDS, drawing.seed)
        np.save(drawing.folder / "earths.npy", earths.astype(np.float16))
        return chunk
    out = {name: np.load(drawing.folder / f"{name}.npy", mmap_mode="r+") for name in ARRAYS}
    first, last = chunk * CHUNK_VIEWS, min((chunk + 1) * CHUNK_VIEWS, drawing.views)
    for k, view in enumerate(draw_views(renderer, paints, last, drawing.seed, first), first):
        out["lit"][k], out["scale"][k], out["cover"][k], out["label"][k] = (
            view.lit,
            view.scale,
            view.cover,
            view.label,
        )
        out["pose"][k] = [*view.q_wxyz, view.range_in_radii]
    for array in out.values():
        array.flush()
    return chunk
