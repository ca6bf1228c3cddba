"""Training samples of the keypoint network from labelled images: a data set that ``capture`` wrote, or an imported one.

    python -m tools.train.captured SET [SET ...]

packs the crop around the target of each feasible frame into ``SET/crops``, with the noise and black level that the
estimator measures. `CapturedCrops.sample` turns, shifts and scales these crops at random, as the views' samples are.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import msgspec
import numpy as np

from flyaround.hil.board.estimation.camera import CameraIntrinsics
from flyaround.hil.board.hybrid.estimator import PoseEstimator
from flyaround.hil.board.hybrid.image.observation import Observation
from flyaround.hil.board.hybrid.prepare import prepare
from flyaround.hil.board.hybrid.propose.keypoints.image_crop import ImageCrop, crop_image
from flyaround.hil.board.hybrid.propose.keypoints.network_input import INPUT_FILL, INPUT_PX, channels
from flyaround.hil.board.hybrid.propose.keypoints.network_output import keypoints_m
from flyaround.hil.evaluate.greyscale import grey
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.hil.train.keypoints.samples import Batch
from flyaround.simulator.dataset.card import read_card
from flyaround.simulator.dataset.formats.native import frame_paths, is_frame_complete, read_png
from flyaround.simulator.labels.imported import read_label_record
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.frames.rotation import matrix_from_quat

Array = np.ndarray[Any, Any]

# Side of a crop [px], and diameter of the target's bounding sphere in it: 1.3 times that in the network's input.
CROP_PX, SPHERE_PX = 384, 120.0

# Largest value of a stored crop.
FULL_SCALE = 65535.0

# Standard deviations of shift [half sides] and log size, and shares of samples, as of the later passes of `SampleMix`.
CROP_SIGMAS, PASS_SHARES = ((0.28, 0.42), (0.12, 0.2), (0.04, 0.08)), (0.15, 0.35, 0.5)
LOG_SIZES = (-0.8, 0.6)

# Shares of samples that are exposed longer, noisier, compressed; spread of the logarithm of the exponent of a changed
# transfer function. Chosen by hand.
OVEREXPOSED_SHARE, NOISY_SHARE, JPEG_SHARE, GAMMA_SIGMA = 0.25, 0.5, 0.15, 0.1


@dataclass(frozen=True, eq=False)
class CapturedCrops:
    """Crops of one target from labelled images.

    Parameters
    ----------
    pictures : (N, CROP_PX, CROP_PX) array
        Crops without the black level, uint16.
    noise : (N,) array
        Standard deviation of the noise in an image pixel [crop's scale].
    image_px : (N,) array
        Image pixels per pixel of the crop.
    points : (N, K, 2) array
        Keypoints relative to the centre of the crop [px].
    """

    pictures: Array
    noise: Array
    image_px: Array
    points: Array

    def sample(self, which: Array, rng: np.random.Generator) -> Batch:
        """Return a batch with one sample of each of the given crops."""
        size = len(which)
        sigmas = np.array(CROP_SIGMAS)[rng.choice(len(CROP_SIGMAS), size, p=PASS_SHARES)]
        crop = rng.normal(0, 1, (size, 3)) * sigmas[:, [0, 0, 1]]
        crop[:, 2] = np.clip(crop[:, 2], *LOG_SIZES)
        turn = rng.uniform(0, 2 * np.pi, size)
        out = np.empty((size, INPUT_PX, INPUT_PX), np.float32)
        noise = np.empty(size)
        points = np.empty((size, *self.points.shape[1:]), np.float32)
        for i, k in enumerate(which):
            picture, noise[i], points[i] = self.input_of(int(k), crop[i], turn[i])
            out[i], noise[i] = _changed(picture, noise[i], rng)
        return Batch(
            channels(out, noise).astype(np.float16),
            points,
            np.ones(size, np.float32),
            crop[:, 2].astype(np.float32),
        )

    def input_of(self, k: int, crop: Array, turn: float) -> tuple[Array, float, Array]:
        """Return a crop resampled to the network's input, its noise, and its keypoints (K, 2) [half sides].

        Parameters
        ----------
        k : int
            Index of the crop.
        crop : (3,) array
            Shift of the target [half sides], and logarithm of its size.
        turn : float
            Turn about the line of sight [rad].
        """
        scale = INPUT_FILL * INPUT_PX * float(np.exp(crop[2])) / SPHERE_PX
        c, s = scale * np.cos(turn), scale * np.sin(turn)
        A = np.array([[c, -s], [s, c]])
        centre = 0.5 * (INPUT_PX - 1) + 0.5 * INPUT_PX * crop[:2]
        M = np.column_stack([A, centre - A @ np.full(2, 0.5 * (CROP_PX - 1))])
        picture = self.pictures[k].astype(np.float32)
        # the mean of the area of each pixel of the input, as the board takes
        soft = cv2.GaussianBlur(picture, (0, 0), 0.5 * float(np.sqrt(max(1 / scale**2 - 0.5, 0.05))))
        size, border = (INPUT_PX, INPUT_PX), cv2.BORDER_REPLICATE
        picture = cv2.warpAffine(soft, M, size, flags=cv2.INTER_LINEAR, borderMode=border)
        points = (self.points[k] @ A.T + centre - 0.5 * (INPUT_PX - 1)) / (0.5 * INPUT_PX)
        return picture, self.noise[k] / max(float(self.image_px[k]) / scale, 1.0), points


def _changed(picture: Array, noise: float, rng: np.random.Generator) -> tuple[Array, float]:
    """Return a picture with another exposure, transfer function, compression and noise, and its noise."""
    top = max(float(picture.max()), 1.0)
    if rng.random() < OVEREXPOSED_SHARE:
        top *= float(rng.uniform(0.3, 1.0))
        picture = np.minimum(picture, np.float32(top))
    picture = np.float32(top) * np.clip(picture / np.float32(top), 0, 1) ** np.float32(
        np.exp(rng.normal(0, GAMMA_SIGMA))
    )
    if rng.random() < JPEG_SHARE:
        pixels = np.rint(np.float32(255 / top) * picture).astype(np.uint8)
        _, coded = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(40, 96))])
        picture = np.asarray(cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE)).astype(np.float32) * np.float32(
            top / 255
        )
    if rng.random() < NOISY_SHARE:
        more = float(rng.uniform(0, 2)) * noise
        picture = picture + np.float32(more) * rng.standard_normal(picture.shape, np.float32)
        noise = float(np.hypot(noise, more))
    return picture, noise * float(np.exp(rng.uniform(-0.1, 0.2)))


def pack(folder: Path) -> int:
    """Write the crops of a data set's feasible frames into ``folder/crops``; return their number."""
    card = read_card(folder)
    camera = CameraIntrinsics.from_dict(msgspec.to_builtins(card.camera))
    model = board_model(load_target(card.target.name))
    estimator = PoseEstimator(model, camera)
    f = 0.5 * (camera.fx_px + camera.fy_px)
    pictures, noise, image_px, points = [], [], [], []
    for k in range(card.n_frames):
        if not is_frame_complete(folder, k):
            continue
        paths = frame_paths(folder, k)
        truth = read_label_record(paths.truth)
        if not truth.feasible:
            continue
        image = grey(read_png(paths.image), camera.encoding)
        frame = Observation(image)
        prepare(estimator.setup, frame)
        R = matrix_from_quat(np.asarray(truth.q_camera_from_target_wxyz, float))
        t = np.asarray(truth.t_camera_from_target_m, float)
        centre = R @ model.centre_m + t
        distance = float(np.linalg.norm(centre))
        diameter = 2 * f * float(np.tan(np.arcsin(model.radius_m / distance)))
        crop = ImageCrop(centre / distance, diameter)
        full = FULL_SCALE / (255.0 if image.dtype == np.uint8 else float(image.max()))
        picture = crop_image(image, camera, crop, CROP_PX, SPHERE_PX) - np.float32(frame.black)
        pictures.append(np.clip(np.rint(full * picture), 0, FULL_SCALE).astype(np.uint16))
        noise.append(full * frame.noise)
        image_px.append(diameter / SPHERE_PX)
        p = (keypoints_m(model) @ R.T + t) @ crop.swing()
        points.append(f / image_px[-1] * p[:, :2] / p[:, 2:])
    out = folder / "crops"
    out.mkdir(exist_ok=True)
    np.save(out / "pictures.npy", np.stack(pictures))
    np.savez(out / "labels.npz", noise=noise, image_px=image_px, points=points)
    return len(pictures)


def read_crops(folders: list[Path]) -> dict[str, CapturedCrops]:
    """Return the packed crops of data sets by the name of their target; the mock-up counts as Tango."""
    found: dict[str, list[CapturedCrops]] = {}
    for folder in folders:
        labels = np.load(folder / "crops/labels.npz")
        crops = CapturedCrops(
            np.load(folder / "crops/pictures.npy"), labels["noise"], labels["image_px"], labels["points"]
        )
        found.setdefault(read_card(folder).target.name.removesuffix("-mockup"), []).append(crops)
    keys = ("pictures", "noise", "image_px", "points")
    return {
        name: CapturedCrops(*(np.concatenate([getattr(c, k) for c in parts]) for k in keys))
        for name, parts in found.items()
    }


def main() -> None:
    """Pack the data sets."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("sets", type=Path, nargs="+")
    for folder in parser.parse_args().sets:
        print(f"{folder}: {pack(folder)} crops", flush=True)


if __name__ == "__main__":
    main()
