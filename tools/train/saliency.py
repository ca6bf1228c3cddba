"""Train the saliency of the target on labelled data sets: features of image cells inside and outside its mask.

    python -m tools.train.saliency DIR... -o hil/board/hybrid/propose/saliency.npz

The shipped weights were trained on frames of ``eval-earth`` (seed 4201, and frames 40 to 149 of seed 4102) and a few of
``eval-black``, each once unchanged and once mirrored, with changed exposure and more noise.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.hil.board.hybrid.image.edge_field import shrink
from flyaround.hil.board.hybrid.image.noise import noise_sigma
from flyaround.hil.board.hybrid.propose.regions import REDUCTION
from flyaround.hil.board.hybrid.propose.saliency import CELL_PX, measures
from flyaround.simulator.dataset.card import read_card
from flyaround.simulator.dataset.formats.native import frame_paths, is_frame_complete, read_png

if TYPE_CHECKING:
    from collections.abc import Iterator

    from flyaround.simulator.runtime.arrays import FloatArray

HIDDEN, EPOCHS, BATCH = 24, 30, 512  # hidden units, and settings of the optimiser

# cells sampled from one frame: on the craft, anywhere else, and adjacent to the craft
ON, OFF, BESIDE = 150, 450, 100


def cells(folder: Path, rng: np.random.Generator, *, varied: bool) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield features (N, F) and labels (N,) of cells of every frame of a data set.

    Parameters
    ----------
    folder : Path
        Data set.
    rng : Generator
        Random numbers of the sampled cells and variations.
    varied : bool
        True to mirror each frame and change its exposure and noise at random.
    """
    for k in range(read_card(folder).n_frames):
        if not is_frame_complete(folder, k):
            continue
        paths = frame_paths(folder, k)
        image, mask = read_png(paths.image).astype(np.float32), read_png(paths.mask) > 0
        if not mask.any():
            continue
        if varied:
            extra = rng.normal(0, rng.uniform(0, 8), image.shape)
            image = np.rint(np.clip(image * rng.uniform(0.5, 1.5) + extra, 0, 255)).astype(np.float32)
            if rng.random() < 0.5:
                image, mask = image[:, ::-1].copy(), mask[:, ::-1].copy()
        small, _ = shrink(image, 0, 0, image.shape[1], image.shape[0], max(image.shape) // REDUCTION)
        m = measures(small, max(noise_sigma(image, 255.0), 0.15) / REDUCTION)
        size = (small.shape[1] // CELL_PX, small.shape[0] // CELL_PX)
        share = cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_AREA)
        ring = (cv2.dilate(share, np.ones((25, 25), np.uint8)) > 0.5) & (share < 0.01)
        for region, count, value in ((share > 0.5, ON, 1.0), (share < 0.01, OFF, 0.0), (ring, BESIDE, 0.0)):
            pixels = np.argwhere(region)
            pixels = (
                pixels[rng.choice(len(pixels), min(len(pixels), count), replace=False)]
                if len(pixels)
                else pixels
            )
            yield m[pixels[:, 0], pixels[:, 1]], np.full(len(pixels), value)


def train(x: FloatArray, y: FloatArray, seed: int = 0) -> dict[str, FloatArray]:
    """Train two layers by Adam (Kingma & Ba 2015) on the cross-entropy, with dropout of features."""
    rng = np.random.default_rng(seed)
    mean, scale = x.mean(axis=0), x.std(axis=0) + 1e-6
    z = (x - mean) / scale
    first = rng.normal(0, np.sqrt(2 / x.shape[1]), (x.shape[1], HIDDEN))
    weights = [first, np.zeros(HIDDEN), rng.normal(0, 0.3, HIDDEN), np.zeros(1)]
    moment, square = [np.zeros_like(w) for w in weights], [np.zeros_like(w) for w in weights]
    step = 0
    for epoch in range(EPOCHS):
        rate = 3e-3 * (1 - epoch / EPOCHS) + 1e-4
        for rows in np.array_split(rng.permutation(len(z)), max(1, len(z) // BATCH)):
            part = z[rows] * (rng.random((len(rows), z.shape[1])) > 0.05)
            hidden = np.maximum(part @ weights[0] + weights[1], 0.0)
            p = 1 / (1 + np.exp(-np.clip(hidden @ weights[2] + weights[3], -30, 30)))
            error = (p - y[rows]) / len(rows)
            hidden_error = np.outer(error, weights[2]) * (hidden > 0)
            slopes = [
                part.T @ hidden_error + 1e-4 * weights[0],
                hidden_error.sum(axis=0),
                hidden.T @ error,
                error.sum(keepdims=True),
            ]
            step += 1
            for k, slope in enumerate(slopes):
                moment[k] = 0.9 * moment[k] + 0.1 * slope
                square[k] = 0.99 * square[k] + 0.01 * slope**2
                size = np.sqrt(square[k] / (1 - 0.99**step)) + 1e-8
                weights[k] = weights[k] - rate * moment[k] / (1 - 0.9**step) / size
    return {
        "mean": mean.astype(np.float32),
        "scale": scale.astype(np.float32),
        "first": weights[0].astype(np.float16),
        "first_bias": weights[1].astype(np.float32),
        "second": weights[2].astype(np.float32),
        "second_bias": weights[3][0].astype(np.float32),
    }


def main() -> None:
    """Read data sets, train and write the weights."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("-o", "--output", required=True, type=Path)
    options = parser.parse_args()
    rng = np.random.default_rng(0)
    rows = [r for f in options.folders for varied in (False, True) for r in cells(f, rng, varied=varied)]
    weights = train(np.concatenate([r[0] for r in rows]), np.concatenate([r[1] for r in rows]))
    with options.output.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **weights)


if __name__ == "__main__":
    main()
