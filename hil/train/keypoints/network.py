"""Keypoint network in PyTorch: a trunk shared by all targets, and a head for each target.

For every keypoint, a head returns a distribution over the columns and one over the rows of the input. It also returns
the logit of the target's presence, and the logarithm of its size.

References
----------
Li et al. (2022), SimCC: a simple coordinate classification perspective for human pose estimation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch import nn

from flyaround.hil.board.hybrid.propose.keypoints.head import CELLS, HIDDEN, MAPS
from flyaround.hil.board.hybrid.propose.keypoints.network_output import BINS, KEYPOINTS

if TYPE_CHECKING:
    from torch import Tensor

# Channels of the stages at 1/4, 1/8 and 1/16 of the input resolution, and residual blocks in each.
CHANNELS, BLOCKS = (64, 128, 192), (2, 2, 3)


class _Residual(nn.Module):  # type: ignore[misc]
    """Residual block of two convolutions (He et al. 2016)."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.body = nn.Sequential(
            nn.Conv2d(channels, channels, 3, padding=1, bias=False),
            nn.BatchNorm2d(channels),
            nn.ReLU(),
            nn.Conv2d(channels, channels, 3, padding=1, bias=False),
            nn.BatchNorm2d(channels),
        )

    def forward(self, x: Tensor) -> Tensor:
        return torch.relu(x + self.body(x))


class Trunk(nn.Module):  # type: ignore[misc]
    """Feature extractor shared by all targets: crops (B, 2, H, W) to features (B, C, `CELLS`, `CELLS`).

    The channels of a crop are brightness and local contrast, as `network_input.channels` makes them.
    """

    def __init__(self) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        in_channels = 2
        for k, (channels, blocks) in enumerate(zip(CHANNELS, BLOCKS, strict=True)):
            size, stride = (7, 4) if k == 0 else (3, 2)
            layers += [
                nn.Conv2d(in_channels, channels, size, stride, size // 2, bias=False),
                nn.BatchNorm2d(channels),
                nn.ReLU(),
            ]
            layers += [_Residual(channels) for _ in range(blocks)]
            in_channels = channels
        self.body = nn.Sequential(*layers)

    def forward(self, x: Tensor) -> Tensor:
        """Compute the features of crops (B, 2, H, W).

        Returns
        -------
        Tensor
            Features (B, C, `CELLS`, `CELLS`), not negative.
        """
        return self.body(x)


class Head(nn.Module):  # type: ignore[misc]
    """Output layers of one target: keypoint logits (B, K, 2, BINS), and presence logit and log size (B, 2)."""

    def __init__(self) -> None:
        super().__init__()
        width = CHANNELS[-1]
        self.maps = nn.Conv2d(width, KEYPOINTS * MAPS, 3, padding=1)
        self.hidden = nn.Linear(MAPS * CELLS * CELLS, HIDDEN)
        self.bins = nn.Linear(HIDDEN, 2 * BINS)
        # named as in the head's file
        self.whole = nn.Linear(width, 2)

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """Compute the outputs from features (B, C, `CELLS`, `CELLS`).

        Returns
        -------
        keypoint_logits : Tensor
            Logits (B, K, 2, BINS) along columns and rows of the crop.
        presence_and_size : Tensor
            Logit of the target's presence, and logarithm of its size over the assumed size (B, 2).
        """
        maps = torch.relu(self.maps(features)).reshape(-1, KEYPOINTS, MAPS * CELLS * CELLS)
        logits = self.bins(torch.relu(self.hidden(maps))).reshape(-1, KEYPOINTS, 2, BINS)
        return logits, self.whole(features.mean(dim=(2, 3)))
