"""The wanted likelihood of attitudes, and how far what a network says is from it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch

if TYPE_CHECKING:
    from flyaround.simulator.runtime.arrays import FloatArray


def soft_classes(q_wxyz: FloatArray, grid: FloatArray, width_rad: float) -> torch.Tensor:
    """(B, N) likelihood of each attitude of a grid (N, 4): a bump about the true one of each sample (B, 4).

    Parameters
    ----------
    width_rad : its standard deviation, as an angle of rotation.
    """
    angle = 2 * np.arccos(np.minimum(np.abs(q_wxyz.astype(np.float32) @ grid.T.astype(np.float32)), 1.0))
    wanted = np.exp(-0.5 * (angle / np.float32(width_rad)) ** 2) + np.float32(1e-9)
    return torch.from_numpy(wanted / wanted.sum(axis=1, keepdims=True))


def cross_entropy(
    logits: torch.Tensor, wanted: torch.Tensor, weight: torch.Tensor | None = None
) -> torch.Tensor:
    """Mean over samples of the cross-entropy between a softmax and a likelihood (B, N).

    Parameters
    ----------
    weight : (B,) of each sample, which add up to one; None: all alike.
    """
    each = -(wanted * torch.log_softmax(logits, dim=1)).sum(dim=1)
    return each.mean() if weight is None else (weight * each).sum()


def robust(errors: torch.Tensor, linear_from: float) -> torch.Tensor:
    """Errors squared while small, and linear from ``linear_from`` on (Huber 1964)."""
    e = errors.abs() / linear_from
    return torch.where(e < 1, 0.5 * e * e, e - 0.5)
