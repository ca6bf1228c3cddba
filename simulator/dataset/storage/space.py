"""Estimate of the disk space that a capture will need."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from flyaround.simulator.dataset.storage.store import Store
    from flyaround.simulator.scene.state import SceneState

# Typical sizes of files of eval-earth at 1920 x 1200.
_IMAGE_SIZE_FACTOR = 1.02  # file size over the size of the pixels: noise does not compress
_CLEAN_SIZE_FACTOR = 0.5  # size of an image without noise over that of the noisy one
_MASK_PER_PIXEL = 0.01  # bytes per pixel of a compressed mask
_RECORD_BYTES = 40_000  # bytes of a truth record
# bytes per pixel of a compressed layer; most layers are empty outside the craft
_LAYER_PER_PIXEL = {
    "depth": 1.0,
    "normals": 1.5,
    "flow": 2.0,
    "parts": 0.02,
    "amodal": 0.02,
    "wireframe": 0.0,
}
_EXPORT_SIZE_FACTOR = 1.0  # size of an exported image over that of the native one


def frame_bytes(scene: SceneState, labels: tuple[str, ...], n_exports: int) -> int:
    """Estimate the size of a frame's files [bytes].

    Parameters
    ----------
    scene : SceneState
        Scene of the frame.
    labels : tuple of str
        Names of the label layers.
    n_exports : int
        Number of exported formats, each with its own images.
    """
    camera, bands = scene.camera, 1 if scene.bands == "mono" else 3
    pixels = camera.width_px * camera.height_px
    image = pixels * bands * (1 if scene.sensor.bits <= 8 else 2) * _IMAGE_SIZE_FACTOR
    layers = sum(pixels * _LAYER_PER_PIXEL.get(name, 1.0) for name in labels if name != "clean")
    clean = image * _CLEAN_SIZE_FACTOR if "clean" in labels else 0.0
    return round(
        image * (1 + _EXPORT_SIZE_FACTOR * n_exports)
        + pixels * _MASK_PER_PIXEL
        + layers
        + clean
        + _RECORD_BYTES
    )


def require_disk_space(store: Store, n_frames: int, frame_size: int) -> None:
    """Check that the disk has room for a capture, before anything is written.

    Parameters
    ----------
    store : Store
        Destination; the check is skipped if its free space is unknown.
    n_frames : int
        Number of frames.
    frame_size : int
        Size of a frame [bytes], as from `frame_bytes`.

    Raises
    ------
    UserError
        If it has not; the message states the space needed and available.
    """
    free = store.free_bytes()
    required = n_frames * frame_size
    if free is not None and required > free:
        raise UserError(
            f"{n_frames:,} frames take about {_size(required)} and the disk of {store.title} has {_size(free)} left; "
            "choose fewer with -n, or name a folder on another disk with -o"
        )


def _size(n_bytes: int) -> str:
    return f"{n_bytes / 1e9:,.1f} GB" if n_bytes >= 1e8 else f"{n_bytes / 1e6:,.1f} MB"
