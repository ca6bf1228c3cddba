"""Training loop components of the keypoint network: loss, AdamW, learning-rate schedule, weight averaging.

References
----------
Li et al. (2022), SimCC: a simple coordinate classification perspective for human pose estimation; Loshchilov & Hutter
(2019), Decoupled weight decay regularization; Polyak & Juditsky (1992), Acceleration of stochastic approximation by
averaging.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch.nn import functional

from flyaround.hil.board.hybrid.propose.keypoints.network_output import BIN_WIDTH, BINS, HALF_RANGE

if TYPE_CHECKING:
    from torch import Tensor

    from flyaround.hil.train.keypoints.samples import Batch

# Standard deviation of a keypoint's target distribution [bins], and the weights of the presence and size losses.
TARGET_SIGMA_BINS, PRESENCE_WEIGHT, SIZE_WEIGHT = 1.6, 0.3, 1.0

# Peak learning rate, weight decay, warm-up steps, and largest gradient norm.
LEARNING_RATE, WEIGHT_DECAY, WARM_UP_STEPS, MAX_GRADIENT = 2e-3, 0.02, 300, 5.0

# Decay of the exponential moving average of the weights, per step.
AVERAGE_DECAY = 0.998


def bin_centres() -> Tensor:
    """Return the centres (BINS,) of the bins [half sides]."""
    return (torch.arange(BINS) + 0.5) * BIN_WIDTH - HALF_RANGE


def target_distributions(points: Tensor) -> tuple[Tensor, Tensor]:
    """Return the target distributions (B, K, 2, BINS), and a mask (B, K, 2) that is 1 for keypoints within the bins.

    Parameters
    ----------
    points : (B, K, 2) tensor
        Keypoints relative to the centre of the input [half sides].
    """
    offset = (points[..., None] - bin_centres()) / (TARGET_SIGMA_BINS * BIN_WIDTH)
    shape = torch.exp(-0.5 * offset * offset)
    return shape / shape.sum(-1, keepdim=True).clamp_min(1e-6), (points.abs() < HALF_RANGE).float()


def loss(outputs: tuple[Tensor, Tensor], batch: Batch) -> tuple[Tensor, Tensor]:
    """Return the cross-entropy of the keypoints of visible targets, and the total loss.

    Parameters
    ----------
    outputs : tuple of Tensor
        Outputs of a `Head`.
    batch : Batch
        Ground truth.
    """
    logits, whole = (x.float() for x in outputs)
    present, size = torch.from_numpy(batch.present), torch.from_numpy(batch.log_size)
    shape, within = target_distributions(torch.from_numpy(batch.points))
    weight = within * present[:, None, None]
    entropy = -(shape * functional.log_softmax(logits, -1)).sum(-1)
    keypoints = (entropy * weight).sum() / weight.sum().clamp_min(1.0)
    presence = functional.binary_cross_entropy_with_logits(whole[:, 0], present)
    off = functional.smooth_l1_loss(whole[:, 1], size, reduction="none", beta=0.1)
    return keypoints, keypoints + PRESENCE_WEIGHT * presence + SIZE_WEIGHT * (off * present).mean()
