"""Training samples from a data set: downscaled images, augmented by random rotation, exposure and noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import msgspec
import numpy as np

from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.estimation.vectors import swing
from flyaround.hil.board.net.network_camera import NetworkCamera, PictureReducer, standardise
from flyaround.hil.evaluate.greyscale import grey
from flyaround.simulator.dataset.card import read_card
from flyaround.simulator.dataset.formats.native import frame_paths, is_frame_complete, read_png
from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.truth import read_truth
from flyaround.simulator.world.frames.rotation import (
    matrix_from_quat,
    quat_from_matrix,
    quat_from_rotvec,
    quat_multiply,
)

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from flyaround.simulator.runtime.arrays import ByteArray, Float32Array, FloatArray

# Resolution of stored images relative to the network's input, for antialiasing when they are rotated.
OVERSAMPLING = 2

# One of this many frames is held out.
HELD_OUT_EVERY = 10

# Minimum number of training images.
MIN_PICTURES = 20

# Largest tilt of the camera [half fields of view], and number of attempts to keep the target in view.
MAX_TILT, TILT_ATTEMPTS = 0.35, 8

# Standard deviation of a sample's log exposure; largest standard deviation of its noise [full scale].
EXPOSURE_SIGMA, MAX_NOISE = 0.3, 0.03


@dataclass(frozen=True, eq=False)
class LabelledPictures:
    """Images with the poses that they show.

    Parameters
    ----------
    camera : NetworkCamera
        Camera of the network.
    signal : (N, OVERSAMPLING h, OVERSAMPLING w) array
        Square root of the signal relative to full scale, uint8, 255 at full scale.
    q_wxyz : (N, 4) array
        Attitudes of the target relative to the camera.
    t_m : (N, 3) array
        Positions of the target in the camera frame.
    """

    camera: NetworkCamera
    signal: ByteArray
    q_wxyz: FloatArray
    t_m: FloatArray

    def __len__(self) -> int:
        return len(self.signal)

    def subset(self, mask: FloatArray) -> LabelledPictures:
        """Return the pictures for which a mask (N,) is True."""
        return LabelledPictures(self.camera, self.signal[mask], self.q_wxyz[mask], self.t_m[mask])


@dataclass(frozen=True, eq=False)
class Samples:
    """A batch of training samples.

    Parameters
    ----------
    pictures : (B, h, w) array
        Standardised pictures.
    q_wxyz : (B, 4) array
        Attitudes relative to the line of sight.
    place : (B, 2) array
        Normalised coordinates x / z and y / z, in half fields of view.
    log_range : (B,) array
        Logarithms of the range [m].
    """

    pictures: Float32Array
    q_wxyz: FloatArray
    place: FloatArray
    log_range: FloatArray


@dataclass(frozen=True)
class TrainingSet:
    """A data set split into a training set and a held-out set.

    Parameters
    ----------
    target : tuple of str
        Name and hash of the target.
    camera : CameraIntrinsics
        Camera of the data set.
    learned : LabelledPictures
        Images for training.
    held_out : LabelledPictures
        Held-out images.
    held_out_frames : tuple of int
        Numbers of the held-out frames.
    """

    target: tuple[str, str]
    camera: CameraIntrinsics
    learned: LabelledPictures
    held_out: LabelledPictures
    held_out_frames: tuple[int, ...]


def read_training_set(
    folder: Path, width_px: int, progress: Callable[[int, int], None] = lambda _done, _total: None
) -> TrainingSet:
    """Read a data set's feasible frames, and hold out every tenth frame.

    Parameters
    ----------
    folder : Path
        Data set.
    width_px : int
        Width of the network's input images.
    progress : callable
        Called with the number of frames read, and the total.

    Raises
    ------
    UserError
        If the folder is not a data set, or too few frames show the target.
    """
    card = read_card(folder)
    camera = CameraIntrinsics.from_dict(msgspec.to_builtins(card.camera))
    small = NetworkCamera.like(camera, width_px)
    reduce = PictureReducer.prepare(small.enlarged(OVERSAMPLING), camera)
    frames, signals, q, t = [], [], [], []
    for k in range(card.n_frames):
        progress(k + 1, card.n_frames)
        if not is_frame_complete(folder, k):
            continue
        truth = read_truth(frame_paths(folder, k).truth)
        if not truth.feasible:
            continue
        image = grey(read_png(frame_paths(folder, k).image), camera.encoding)
        frames.append(k)
        signals.append(np.rint(255 * np.clip(reduce(image), 0, 1)).astype(np.uint8))
        q.append(truth.q_camera_from_target_wxyz)
        t.append(truth.t_camera_from_target_m)
    is_held_out = np.array([k % HELD_OUT_EVERY == HELD_OUT_EVERY - 1 for k in frames], bool)
    if is_held_out.sum() < 2 or len(frames) - is_held_out.sum() < MIN_PICTURES:
        raise UserError(
            f"data set {folder} has {len(frames)} feasible frames, but training needs {MIN_PICTURES} and two of "
            f"every {HELD_OUT_EVERY}th frame, which are held out: capture more"
        )
    pictures = LabelledPictures(small, np.stack(signals), np.array(q, float), np.array(t, float))
    return TrainingSet(
        (card.target.name, card.target.sha256),
        camera,
        pictures.subset(~is_held_out),
        pictures.subset(is_held_out),
        tuple(k for k, out in zip(frames, is_held_out, strict=True) if out),
    )


def sample(pictures: LabelledPictures, rng: np.random.Generator, size: int) -> Samples:
    """Return a random batch: each image is warped to a random camera attitude, with random exposure and noise."""
    which = rng.integers(len(pictures), size=size)
    small = pictures.camera
    out = np.empty((size, small.height_px, small.width_px), np.float32)
    q, t = np.empty((size, 4)), np.empty((size, 3))
    gain = np.exp(rng.normal(0, 0.5 * EXPOSURE_SIGMA, size)).astype(np.float32)
    noise = (MAX_NOISE * rng.random(size) ** 2).astype(np.float32)
    for i, k in enumerate(which):
        R = _random_rotation(small, pictures.t_m[k], rng)
        out[i] = _warp(pictures.signal[k], small, R)
        q[i] = quat_multiply(quat_from_matrix(R), pictures.q_wxyz[k])
        t[i] = R @ pictures.t_m[k]
    out = np.minimum(out * gain[:, None, None], 1.0)
    out += noise[:, None, None] * rng.standard_normal(out.shape, np.float32)
    return with_labels(out, small, q, t)


def with_labels(signal: Float32Array, camera: NetworkCamera, q_wxyz: FloatArray, t_m: FloatArray) -> Samples:
    """Return images (B, h, w) as samples, with the network's labels computed from their poses."""
    range_m = np.linalg.norm(t_m, axis=1)
    back = np.stack([quat_from_matrix(swing(d).T) for d in t_m / range_m[:, None]])
    relative = quat_multiply(back, q_wxyz)
    return Samples(standardise(signal), relative, t_m[:, :2] / t_m[:, 2:] / camera.half_view, np.log(range_m))


def _random_rotation(camera: NetworkCamera, t_m: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return a random rotation (3, 3) of the camera that keeps the target in view."""
    for _ in range(TILT_ATTEMPTS):
        x, y = MAX_TILT * rng.uniform(-1, 1, 2) * camera.half_view
        roll = rng.uniform(0, 2 * np.pi)
        R = matrix_from_quat(quat_from_rotvec(np.array([0.0, 0.0, roll]))) @ matrix_from_quat(
            quat_from_rotvec(np.array([np.arctan(y), -np.arctan(x), 0.0]))
        )
        rotated = R @ t_m
        # the centre stays in the image with a margin, so that most of the craft does
        if rotated[2] > 0 and np.all(np.abs(rotated[:2] / rotated[2]) < 0.85 * camera.half_view):
            return R
    return np.eye(3)


def _warp(signal: ByteArray, camera: NetworkCamera, R: FloatArray) -> Float32Array:
    """Warp a stored image to a camera rotated by R, (h, w) float32; its border is replicated."""
    fine = camera.enlarged(OVERSAMPLING)
    K, L = _matrix(camera), _matrix(fine)
    # M maps pixels of the rotated image to the stored one, which is averaged over the size of an output pixel
    light = (signal.astype(np.float32) / np.float32(255)) ** 2
    soft = cv2.blur(light, (OVERSAMPLING, OVERSAMPLING), anchor=(0, 0))
    shift = np.eye(3)
    shift[:2, 2] = -0.5 * (OVERSAMPLING - 1)
    M = shift @ L @ R.T @ np.linalg.inv(K)
    picture = cv2.warpPerspective(
        soft,
        M,
        (camera.width_px, camera.height_px),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.sqrt(picture)


def _matrix(camera: NetworkCamera) -> FloatArray:
    """Return the intrinsic matrix (3, 3)."""
    return np.array(
        [
            [camera.f_px, 0.0, 0.5 * (camera.width_px - 1)],
            [0.0, camera.f_px, 0.5 * (camera.height_px - 1)],
            [0.0, 0.0, 1.0],
        ]
    )
