"""Trains a target's learned proposal on views drawn by `proposal_views`; needs the extra `train`.

python -m tools.train.proposal_views tango -n 30000 -o VIEWS
python -m tools.train.learned_proposal tango VIEWS -o hil/board/hybrid/propose/learned/weights/tango.npz --minutes 50

A craft that is not the first may begin with what another's network sees (`--start tango`): a third of the time is
enough.
"""

from __future__ import annotations

import argparse
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch.nn import functional

from flyaround.hil.board.estimation import quaternion as quat
from flyaround.hil.board.hybrid.propose.learned.attitude_basis import ANCHORS, bumps, even_attitudes
from flyaround.hil.board.hybrid.propose.learned.learned_proposal import shipped_network
from flyaround.hil.board.hybrid.propose.learned.network import INPUT_PX, STRIDES, VERSION, ProposalNetwork
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.hil.train.attitude_loss import cross_entropy, robust, soft_classes
from flyaround.hil.train.fitting import RATE, Budget, fit
from flyaround.hil.train.layers import (
    EPSILON,
    folded_scale_and_bias,
    in_double,
    normalised,
    start_layer,
    trainable,
)
from flyaround.simulator.targets.library import load_target
from tools.train.lit_samples import LitViews, sample_lit
from tools.train.proposal_samples import Batch, Views, sample

if TYPE_CHECKING:
    from collections.abc import Callable

    from flyaround.hil.train.layers import Tree
    from flyaround.simulator.runtime.arrays import FloatArray

# Channels after each convolution, after the squeeze, and of the hidden layer.
CHANNELS, SQUEEZED, HIDDEN = (24, 48, 96, 112, 128), 64, 224

BATCH = 64

# Attitudes compared in one step, and how many random turns of them there are; width of the wanted bump [rad].
COMPARED, TURNS, WIDTH_RAD = 2048, 8, float(np.radians(6.0))

# Attitudes that a report inputs among.
GRID = 6000

# Looks by which another craft's network is taken over.
STATISTICS = 512

# Errors of place and size from which they count linearly [half sides, log]; what they weigh against attitude.
ROBUST, PLACE_WEIGHT = 0.05, 0.3

LAYERS = (*(f"kernel{k}" for k in range(len(STRIDES))), "squeeze", "hidden")


def start_weights(seed: int) -> Tree:
    """Random weights, and the scale and shift of each normalisation."""
    rng = np.random.default_rng(seed)
    out: dict[str, FloatArray] = {}
    last = 2
    for k, channels in enumerate(CHANNELS):
        side = 5 if k == 0 else 3
        start_layer(
            out, rng, f"kernel{k}", (side, side, last, channels), inputs=side * side * last, outputs=channels
        )
        last = channels
    start_layer(out, rng, "squeeze", (last, SQUEEZED), inputs=last, outputs=SQUEEZED)
    cells = INPUT_PX // int(np.prod(STRIDES))
    fan = cells * cells * SQUEEZED
    start_layer(out, rng, "hidden", (fan, HIDDEN), inputs=fan, outputs=HIDDEN)
    start_layer(out, rng, "heads", (HIDDEN, ANCHORS + 4), inputs=HIDDEN, outputs=ANCHORS + 4, gain=0.01)
    del out["heads_scale"]
    return trainable(out)


def weights_of(net: ProposalNetwork, inputs: torch.Tensor, seed: int, *, same: bool = False) -> Tree:
    """Weights that see what another craft's network sees, and know no attitude of this one yet.

    Parameters
    ----------
    same : whether it is this craft's own network, whose attitudes are kept.
    inputs : (B, 64, 64, 2) of which each normalisation takes the mean and spread that it undoes.
    """
    weights = start_weights(seed)
    layers = {f"kernel{k}": pair for k, pair in enumerate(zip(net.kernels, net.biases, strict=True))}
    for name, (kernel, bias) in (layers | {"squeeze": net.squeeze, "hidden": net.hidden}).items():
        with torch.no_grad():
            weights[name].copy_(torch.from_numpy(kernel))
            # the layers before this one are right by now
            _, seen = forward(weights, None, inputs)
            spread = torch.sqrt(seen[f"{name}_var"] + EPSILON)
            weights[f"{name}_scale"].copy_(spread)
            weights[f"{name}_bias"].copy_(torch.from_numpy(bias) + seen[f"{name}_mean"])
    with torch.no_grad():
        for key, there in zip(("heads", "heads_bias"), net.heads, strict=True):
            first = 0 if same else ANCHORS
            weights[key][..., first:] = torch.from_numpy(there[..., first:])
    return weights


def forward(weights: Tree, running: Tree | None, inputs: torch.Tensor) -> tuple[torch.Tensor, Tree]:
    """Outputs (B, J + 4), and mean and variance of each layer in this batch.

    Parameters
    ----------
    running : means and variances to use instead of the batch's own (Ioffe & Szegedy 2015), or None.
    """
    seen: Tree = {}

    x = inputs.permute(0, 3, 1, 2)
    for k, stride in enumerate(STRIDES):
        kernel = weights[f"kernel{k}"].permute(3, 2, 0, 1).contiguous(memory_format=torch.channels_last)
        side = kernel.shape[-1]
        before = (side - stride) // 2 if stride > 1 else side // 2
        after = side - before - stride
        x = functional.conv2d(functional.pad(x, (before, after, before, after)), kernel, stride=stride)
        x = normalised(weights, running, seen, f"kernel{k}", x)
    cells = x.permute(0, 2, 3, 1)
    flat = cells.reshape(-1, cells.shape[-1]) @ weights["squeeze"]
    flat = normalised(weights, running, seen, "squeeze", flat).reshape(len(inputs), -1)
    flat = normalised(weights, running, seen, "hidden", flat @ weights["hidden"])
    return flat @ weights["heads"] + weights["heads_bias"], seen


def loss(
    out: torch.Tensor, wanted: torch.Tensor, basis: torch.Tensor, box: torch.Tensor, craft: torch.Tensor
) -> tuple[torch.Tensor, FloatArray]:
    """Cross-entropy over attitudes, robust error of place and size, cross-entropy of there being a craft."""
    there = craft / torch.clamp(craft.sum(), min=1.0)
    attitude = cross_entropy(out[:, :ANCHORS] @ basis, wanted, there)
    place = (there[:, None] * robust(out[:, ANCHORS : ANCHORS + 3] - box, ROBUST)).sum()
    present = functional.binary_cross_entropy_with_logits(out[:, ANCHORS + 3], craft)
    parts = np.array([attitude.item(), place.item(), present.item()])
    return attitude + PLACE_WEIGHT * place + present, parts


def folded(means: Tree) -> dict[str, FloatArray]:
    """The layers with their normalisations multiplied in, as the board has them."""
    w = in_double(means)
    out = {"heads": w["heads"], "heads_bias": w["heads_bias"]}
    for name in LAYERS:
        scale, bias = folded_scale_and_bias(w, name)
        out[name] = w[name] * scale
        out[name.replace("kernel", "bias") if "kernel" in name else f"{name}_bias"] = bias
    return out


def write(path: Path, layers: dict[str, FloatArray], target: str) -> None:
    """Half-precision weights with the name and the sphere of the target."""
    model = board_model(load_target(target))
    half = {k: v.astype(np.float16) for k, v in layers.items()}
    with path.open("wb") as file:
        np.savez_compressed(
            file,
            allow_pickle=False,
            version=np.int64(VERSION),
            name=np.str_(model.name),
            centre_m=model.centre_m,
            radius_m=np.float64(model.radius_m),
            **half,
        )


def likeliest(coefficients: FloatArray, keep: int) -> FloatArray:
    """(K, 4) the likeliest of a grid of attitudes, none within 12 degrees of a better one."""
    grid = even_attitudes(GRID)
    chosen: list[int] = []
    for i in np.argsort(-(_basis() @ coefficients))[:400]:
        if not chosen or quat.angle_rad(grid[chosen], grid[i]).min() > np.radians(12.0):
            chosen.append(int(i))
        if len(chosen) >= keep:
            break
    return grid[chosen]


@cache
def _basis() -> FloatArray:
    return np.asarray(bumps(even_attitudes(GRID)), np.float32)


def recall(net: ProposalNetwork, batch: Batch, most: int = 32) -> str:
    """How often an attitude within some degrees is among the best 1, 4, 8, 16, 32; errors of place and size."""
    coefficients, box = net(batch.inputs)
    rank = []
    for i in np.flatnonzero(batch.craft > 0):
        error = np.degrees(quat.angle_rad(likeliest(coefficients[i], most), batch.q_wxyz[i]))
        rank.append(np.pad(error, (0, most - len(error)), constant_values=180))
    best = np.minimum.accumulate(np.array(rank), axis=1)
    shares = [
        f"{limit} deg: " + " ".join(f"{(best[:, k - 1] < limit).mean():.3f}" for k in (1, 4, 8, 16, 32))
        for limit in (6, 10, 15)
    ]
    e = np.abs(box[:, :3] - batch.box)[batch.craft > 0]
    right = ((box[:, 3] > 0) == (batch.craft > 0)).mean()
    return "; ".join([*shares, f"box {np.round(np.median(e, axis=0), 3)}, craft {right:.3f}"])


def train(
    draw: Callable[[np.random.Generator, int], Batch],
    minutes: float,
    seed: int,
    report: Callable[[str, Tree], None],
    start: ProposalNetwork | None = None,
    *,
    same: bool = False,
    rate: float = RATE,
    short: bool = False,
    steps: int | None = None,
) -> Tree:
    """Running means of weights and statistics after ``minutes``, or after ``steps`` where these are given.

    Parameters
    ----------
    draw : a batch of random samples. start : network to begin with, or None for random weights.
    same : whether that is this craft's own. rate : the highest. short : products of short numbers (bfloat16).
    """
    # one thread: boards and desks alike have other work
    torch.set_num_threads(1)
    rng = np.random.default_rng(seed)
    if start is None:
        weights = start_weights(seed)
    else:
        weights = weights_of(start, torch.from_numpy(draw(rng, STATISTICS).inputs), seed, same=same)
    grids = []
    for _ in range(TURNS):
        p, r = quat.normalise(rng.normal(size=4)), quat.normalise(rng.normal(size=4))
        grid = quat.multiply(quat.multiply(p, even_attitudes(COMPARED)), r)
        grids.append((grid, torch.tensor(bumps(grid).T, dtype=torch.float32)))

    def step(batch: Batch, count: int) -> tuple[torch.Tensor, FloatArray, Tree]:
        grid, basis = grids[(count - 1) % TURNS]
        with torch.autocast("cpu", torch.bfloat16, enabled=short):
            out, seen = forward(weights, None, torch.from_numpy(batch.inputs))
        total, parts = loss(
            out.float(),
            soft_classes(batch.q_wxyz, grid, WIDTH_RAD),
            basis,
            torch.tensor(batch.box, dtype=torch.float32),
            torch.tensor(batch.craft, dtype=torch.float32),
        )
        return total, parts, seen

    return fit(
        weights,
        lambda: draw(rng, BATCH),
        step,
        Budget(minutes=minutes, steps=steps),
        lambda _done, text, means: report(text, means),
        rate,
    )


def _sampler(folder: Path, first: int, last: int) -> Callable[[np.random.Generator, int], Batch]:
    """What draws batches of a folder's views, of whichever module wrote them."""
    if (folder / "lit.npy").exists():
        return partial(sample_lit, LitViews.read(folder, first, last))
    return partial(sample, Views.read(folder, first, last))


def main() -> None:
    """Train, tell how it does on views that were kept back, write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("target")
    parser.add_argument("views", type=Path)
    parser.add_argument("-o", "--output", required=True, type=Path)
    parser.add_argument("--minutes", type=float, default=50.0)
    parser.add_argument("--steps", type=int, default=None, help="so many steps instead of minutes")
    parser.add_argument("--views-used", type=int, default=None)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--start", default=None, help="craft whose network to begin with")
    parser.add_argument("--rate", type=float, default=RATE, help="highest rate of learning")
    parser.add_argument(
        "--short", action="store_true", help="products of short numbers, where the processor has them"
    )
    options = parser.parse_args()
    start = None if options.start is None else shipped_network(options.start)
    if options.start is not None and start is None:
        parser.error(f"--start: no network is shipped for '{options.start}'")
    same = options.start == options.target
    n = options.views_used or len(np.load(options.views / "pose.npy", mmap_mode="r"))
    draw = _sampler(options.views, 0, n - n // 20)
    held = _sampler(options.views, n - n // 20, n)(np.random.default_rng(1), 300)

    def report(text: str, means: Tree) -> None:
        write(options.output, folded(means), options.target)
        print(text, "|", recall(ProposalNetwork.read(str(options.output)), held), flush=True)

    how = {"same": same, "rate": options.rate, "short": options.short, "steps": options.steps}
    train(draw, options.minutes, options.seed, report, start, **how)


if __name__ == "__main__":
    main()
