"""Disk space of a capture, estimated before it begins."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from flyaround.simulator.dataset.storage.store import Store
    from flyaround.simulator.scene.state import SceneState

# Noise does not compress, so an image takes all of its bits; other sizes are typical of eval-earth at 1920x1200.
_IMAGE_SIZE_FACTOR = 1.02
_MASK_PER_PIXEL = 0.01  # bytes of a compressed mask

# Estimated size of a frame's truth record [bytes].
_RECORD_BYTES = 40_000
# bytes per pixel of a layer; most are empty off the craft, except clean and amodal
_LAYER_PER_PIXEL = {
    "depth": 1.0,
    "normals": 1.5,
    "flow": 2.0,
    "parts": 0.02,
    "amodal": 0.02,
    "wireframe": 0.0,
}

_EXPORT_SIZE_FACTOR = 1.0
"""Size of an export relative to the native images."""


def frame_bytes(scene: SceneState, labels: tuple[str, ...], n_exports: int) -> int:
    """Return the approximate size of a frame on the disk."""
    camera, colours = scene.camera, 1 if scene.bands == "mono" else 3
    pixels = camera.width_px * camera.height_px
    image = pixels * colours * (1 if scene.sensor.bits <= 8 else 2) * _IMAGE_SIZE_FACTOR
    layers = sum(pixels * _LAYER_PER_PIXEL.get(name, 1.0) for name in labels if name != "clean")
    clean = image * 0.5 if "clean" in labels else 0.0
    return round(
        image * (1 + _EXPORT_SIZE_FACTOR * n_exports)
        + pixels * _MASK_PER_PIXEL
        + layers
        + clean
        + _RECORD_BYTES
    )


def require_disk_space(store: Store, n_frames: int, each_bytes: int) -> None:
    """Raise if the disk has no room for a capture, before anything is written.

    Raises
    ------
    UserError
        With the space needed and available.
    """
    free = store.free_bytes()
    required = n_frames * each_bytes
    if free is not None and required > free:
        raise UserError(
            f"{n_frames:,} frames take about {_size(required)} and the disk of {store.title} has {_size(free)} left; "
            "choose fewer with -n, or name a folder on another disk with -o"
        )


def _size(n_bytes: int) -> str:
    return f"{n_bytes / 1e9:,.1f} GB" if n_bytes >= 1e8 else f"{n_bytes / 1e6:,.1f} MB"
