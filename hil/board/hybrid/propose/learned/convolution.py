"""Convolutions of the pose proposal network, in whole numbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Sequence, Tuple

import numpy as np

from flyaround.hil.board.hybrid.native.interface import contiguous
from flyaround.hil.board.hybrid.native.library import library

Array = np.ndarray

# Channels whose sums are made together; largest whole number that weights are multiplied with, and of their sum.
CHANNELS, LARGEST, MOST = 16, 4095, 2.0e9


@dataclass(frozen=True, eq=False)
class Layers:
    """Convolutions one after another in whole numbers, as the library takes them.

    Parameters
    ----------
    shape : (L, 4) taps each way, stride, channels in and out. weights : int16 of all. worth, bias : float32 of all
        channels, one layer after another: what a weight of one is worth, and what is added.
    """

    shape: Array
    weights: Array
    worth: Array
    bias: Array

    @staticmethod
    def of(kernels: Sequence[Array], biases: Sequence[Array], strides: Sequence[int]) -> Layers:
        """Of kernels (k, k, C, D) with biases (D,).

        Raises
        ------
        ValueError
            If a row of taps has an odd number of weights.
        """
        if any(kernel.shape[1] * kernel.shape[2] % 2 for kernel in kernels):
            raise ValueError("a row of a convolution's taps has an odd number of weights")
        parts = [_whole(kernel) for kernel in kernels]
        shape = [(k.shape[0], s, *k.shape[2:]) for k, s in zip(kernels, strides)]  # noqa: B905 - Python 3.9
        return Layers(
            np.array(shape, np.int64),
            np.concatenate([weights.ravel() for weights, _ in parts]),
            np.concatenate([worth for _, worth in parts]).astype(np.float32),
            np.concatenate([np.ravel(b) for b in biases]).astype(np.float32),
        )


def whole_numbers(rows: Array) -> Tuple[Array, Array]:
    """Rows (..., N) in whole numbers, int16, and what one of each row is worth (...).

    As large as they may be: no sum of LARGEST times them is more than 32 bits hold.
    """
    size = np.abs(rows.astype(float))
    worth = np.maximum(size.sum(axis=-1) * LARGEST / MOST, size.max(axis=-1) / 32767.0)
    return np.rint(rows / np.maximum(worth, 1e-30)[..., None]).astype(np.int16), worth


def _whole(kernel: Array) -> Tuple[Array, Array]:
    """Whole weights (D / CHANNELS, k, k C / 2, CHANNELS, 2) of a kernel (k, k, C, D), and what one is worth (D,)."""
    k, _, c, d = kernel.shape
    whole, worth = whole_numbers(kernel.reshape(-1, d).T)
    padded = np.zeros((k * k * c, -(-d // CHANNELS) * CHANNELS), np.int16)
    padded[:, :d] = whole.T
    pairs = padded.reshape(k, k * c // 2, 2, -1, CHANNELS)
    return np.ascontiguousarray(pairs.transpose(3, 0, 1, 4, 2)), worth


def convolutions(looks: Array, layers: Layers) -> Array:
    """(B, h, w, D) float32 what is left of looks (B, side, side, C) after all layers, each no less than zero."""
    count, side, across, channels = looks.shape
    s = side
    for taps, stride, given, made in layers.shape.tolist():
        if s < 1 or s % stride or given != channels or taps < stride:
            raise ValueError(f"a layer takes {given} channels of whole sides, not {channels} of {s}")
        s, channels = s // stride, made
    if side != across:
        raise ValueError("the network takes square looks")
    shown, out = contiguous(looks, "float32"), np.empty((count, s, s, channels), np.float32)
    if library().fly_convolutions(
        shown, count, side, layers.shape, len(layers.shape), layers.weights, layers.worth, layers.bias, out
    ):
        raise MemoryError("no memory for the learned proposal's network")
    return out
