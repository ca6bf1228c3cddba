"""The pose proposal network in numpy: input channels, layers, weights file."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import BinaryIO, Tuple, Union

import numpy as np

from flyaround.hil.board.hybrid.native.interface import contiguous
from flyaround.hil.board.hybrid.native.library import library
from flyaround.hil.board.hybrid.propose.learned.convolution import Layers, convolutions

Array = np.ndarray

# Side of the network's input [px], and share of it that the target's sphere fills when the crop is right.
INPUT_PX, INPUT_FILL = 64, 0.72

# Side of the neighbourhood of the contrast channel [px].
CONTRAST_PX = 13

# Stride of each convolution; the first has 5 x 5 taps, the others 3 x 3.
STRIDES = (2, 2, 2, 1, 2)

VERSION = 1


@dataclass(frozen=True, eq=False)
class ProposalNetwork:
    """Weights of one target's pose proposal network.

    Parameters
    ----------
    name : of the target. centre_m (3,), radius_m : of the sphere it was trained with.
    kernels : (k, k, C, D) per convolution; biases (D,). squeeze (D, E), (E,) : one-by-one convolution after the last.
    hidden : (n, H), (H,). heads : (H, J + 4), (J + 4,): attitude coefficients, shift x y, log size, craft or not.
    """

    name: str
    centre_m: Array
    radius_m: float
    kernels: Tuple[Array, ...]
    biases: Tuple[Array, ...]
    squeeze: Tuple[Array, Array]
    hidden: Tuple[Array, Array]
    heads: Tuple[Array, Array]

    @staticmethod
    def read(file: Union[str, BinaryIO]) -> ProposalNetwork:
        """From an ``.npz`` file of half-precision weights.

        Raises
        ------
        ValueError
            If it was written for another version of the layers.
        """
        with np.load(file) as f:
            if int(f["version"]) != VERSION:
                raise ValueError(f"learned proposal: version {int(f['version'])}, expected {VERSION}")
            n = len(STRIDES)

            def wide(key: str) -> Array:
                return np.asarray(f[key], np.float32)

            return ProposalNetwork(
                str(f["name"]),
                np.asarray(f["centre_m"], float),
                float(f["radius_m"]),
                tuple(wide(f"kernel{k}") for k in range(n)),
                tuple(wide(f"bias{k}") for k in range(n)),
                (wide("squeeze"), wide("squeeze_bias")),
                (wide("hidden"), wide("hidden_bias")),
                (wide("heads"), wide("heads_bias")),
            )

    def __call__(self, inputs: Array) -> Tuple[Array, Array]:
        """Attitude coefficients (B, J), and (B, 4) shift x y, log size, logit of a target being there.

        Parameters
        ----------
        inputs : (B, 64, 64, 2) float32, see ``contrast``.
        """
        x = convolutions(inputs, self.layers)
        x = np.maximum(x @ self.squeeze[0] + self.squeeze[1], 0.0).reshape(len(x), -1)
        x = np.maximum(x @ self.hidden[0] + self.hidden[1], 0.0)
        out = x @ self.heads[0] + self.heads[1]
        return out[:, :-4], out[:, -4:]

    @cached_property
    def layers(self) -> Layers:
        """The convolutions as the library takes them."""
        return Layers.of(self.kernels, self.biases, STRIDES)


def contrast(pictures: Array, noise: Array) -> Array:
    """(B, 64, 64, 2) input channels of crops: their level, and their local contrast.

    Parameters
    ----------
    pictures : (B, 64, 64) float32, any scale. noise : (B,) standard deviation of each one's noise.

    Notes
    -----
    Neither channel depends on exposure: the level is measured by the brightest half percent, the contrast by its
    own neighbourhood's, but noise is left small.
    """
    shown, sigma = contiguous(pictures, "float32"), contiguous(np.asarray(noise), "float32", (len(pictures),))
    count, n, across = shown.shape
    if n < CONTRAST_PX or n != across:
        raise ValueError(
            f"an input of the network is a square of {CONTRAST_PX} rows at least, not {n} x {across}"
        )
    out = np.empty((count, n, n, 2), np.float32)
    if library().fly_contrast(shown, sigma, count, n, out):
        raise MemoryError("no memory for the network's input")
    return out
