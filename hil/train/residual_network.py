"""A small residual network: one picture in, place and classes of attitude out.

The place is read from all of the picture's cells, which say where; the attitude, which is against the line of sight and
alike wherever the craft is, from the largest value of each channel. So a view is learned at one place for all.

References
----------
He et al. (2016), Deep residual learning for image recognition, CVPR; Proenca & Gao (2020), Deep learning for spacecraft
pose estimation from photorealistic rendering, ICRA.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from flyaround.simulator.runtime.arrays import FloatArray


@dataclass(frozen=True)
class Convolution:
    """One convolution with its normalisation; padded so that a stride of one keeps the size."""

    name: str
    inputs: int
    outputs: int
    side: int
    stride: int

    @property
    def padding(self) -> int:
        """Pixels added on each side."""
        return self.side // 2

    def size(self, width: int, height: int) -> tuple[int, int]:
        """Of what comes out."""
        a = 2 * self.padding - self.side
        return (width + a) // self.stride + 1, (height + a) // self.stride + 1


@dataclass(frozen=True)
class ResidualBlock:
    """Two convolutions whose result is added to what came in, itself or, where sizes differ, convolved."""

    first: Convolution
    second: Convolution
    shortcut: Convolution | None


@dataclass(frozen=True)
class Architecture:
    """Sizes of a network.

    Parameters
    ----------
    stem : channels after the first convolution. stages : channels of each stage, of which all but the first halve the
        picture. blocks : of each stage. squeezed : channels for the place. hidden : numbers before a head.
    """

    stem: int
    stages: tuple[int, ...]
    blocks: int
    squeezed: int
    hidden: int

    @property
    def first(self) -> Convolution:
        """The first convolution, after which the largest of three by three pixels is taken at every other one."""
        return Convolution("stem", 1, self.stem, 7, 2)

    def residual_blocks(self) -> Iterator[ResidualBlock]:
        """In order."""
        last = self.stem
        for s, channels in enumerate(self.stages):
            for b in range(self.blocks):
                stride = 2 if b == 0 and s > 0 else 1
                name = f"stage{s}.{b}"
                same = stride == 1 and last == channels
                yield ResidualBlock(
                    Convolution(f"{name}.first", last, channels, 3, stride),
                    Convolution(f"{name}.second", channels, channels, 3, 1),
                    None if same else Convolution(f"{name}.shortcut", last, channels, 1, stride),
                )
                last = channels

    @property
    def squeeze(self) -> Convolution:
        """The last convolution, to fewer channels."""
        return Convolution("squeeze", self.stages[-1], self.squeezed, 1, 1)

    def convolutions(self) -> Iterator[Convolution]:
        """All of them, in order."""
        yield self.first
        for block in self.residual_blocks():
            yield from (c for c in (block.first, block.second, block.shortcut) if c is not None)
        yield self.squeeze

    def features(self, width: int, height: int) -> int:
        """Numbers that the place is read from."""
        size = self.first.size(width, height)
        size = ((size[0] - 1) // 2 + 1, (size[1] - 1) // 2 + 1)
        for block in self.residual_blocks():
            size = block.first.size(*size)
        return self.squeezed * size[0] * size[1]

    def start(self, width: int, height: int, classes: int, seed: int) -> dict[str, FloatArray]:
        """Random weights for pictures of a size."""
        from flyaround.hil.train.layers import start_layer  # noqa: PLC0415 - sizes are asked for without PyTorch, too

        rng = np.random.default_rng(seed)
        weights: dict[str, FloatArray] = {}
        for c in self.convolutions():
            fan = c.inputs * c.side**2
            start_layer(
                weights, rng, c.name, (c.outputs, c.inputs, c.side, c.side), inputs=fan, outputs=c.outputs
            )
        for block in self.residual_blocks():
            # each block begins as what it is added to (Goyal et al. 2017)
            weights[f"{block.second.name}_scale"][:] = 0.0
        for head, fan, outputs in (
            ("place", self.features(width, height), 3),
            ("attitude", self.stages[-1], classes),
        ):
            hidden = f"{head}.hidden"
            start_layer(weights, rng, hidden, (fan, self.hidden), inputs=fan, outputs=self.hidden)
            weights[head] = rng.normal(0, np.sqrt(0.01 / self.hidden), (self.hidden, outputs))
            weights[f"{head}_bias"] = np.zeros(outputs)
        return weights


ARCHITECTURES = {
    "small": Architecture(stem=16, stages=(24, 48, 128), blocks=1, squeezed=16, hidden=256),
    # He et al.'s of 18 layers
    "resnet18": Architecture(stem=64, stages=(64, 128, 256, 512), blocks=2, squeezed=32, hidden=512),
}
