"""Train the keypoint network's trunk together with the heads of all built-in craft.

    python -m tools.train.keypoint_trunk draw VIEWS --workers 2
    python -m tools.train.keypoint_trunk fit VIEWS STATE --minutes 180 --assistants 1 --captured SET ...
    python -m tools.train.keypoint_trunk write STATE
    python -m tools.train.keypoint_trunk calibrate FRAMES --workers 2

``draw``, ``fit`` and ``calibrate`` continue where they were interrupted. ``fit`` starts from the shipped weights, or
with ``--anew`` from random ones; ``write`` writes the running mean of the weights into the package; ``calibrate``
calibrates the shipped heads of all craft on which the confidence was not fitted.

One process trains on one thread, because two threads wait for each other (docs/lab/2026-11-keypoint-network.md).
Another process makes samples; assistants compute gradients of further batches at the lowest priority, at weights that
are at most one step old.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import multiprocessing
import os
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import torch
from torch import nn

from flyaround.hil.board.hybrid.decide.confidence import FITTED_CRAFT
from flyaround.hil.board.hybrid.propose.keypoints.head import KeypointHead
from flyaround.hil.board.hybrid.propose.keypoints.network import network_for, trunk_bytes
from flyaround.hil.board.hybrid.propose.keypoints.network_output import keypoints_m
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.hil.train.keypoints import fit
from flyaround.hil.train.keypoints.calibrate import fitted_calibration, held_out_answers
from flyaround.hil.train.keypoints.head_training import CALIBRATION_SEED, arrays_of, load_views, state_of
from flyaround.hil.train.keypoints.network import Head, Trunk
from flyaround.hil.train.keypoints.samples import EASY, HARD, Batch, image_pyramid, sample
from flyaround.hil.train.keypoints.trunk_file import fold, from_onnx, to_onnx, unfold
from flyaround.hil.train.keypoints.view_files import Drawing, earths_of, render_views
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.targets.library import load_target
from tools.train.captured import read_crops

if TYPE_CHECKING:
    from multiprocessing.queues import Queue

    from torch import Tensor

    # (craft name, number of samples) in the order of the batch, and the batch
    Samples = tuple[list[tuple[str, int]], Batch]

WEIGHTS = Path(__file__).parents[2] / "hil/board/hybrid/propose/keypoints/weights"

# Number of rendered views of each craft; Tango is rendered with both of its paints.
VIEWS = {
    "tango": 3200,
    "dragon": 1400,
    "soyuz-ms": 900,
    "tianzhou": 900,
    "change6-ascender": 900,
    "cubesat-3u": 900,
    "tango-thesis": 400,
}
PAINTS = {"tango": ("tango", "tango-mockup")}

# Samples of a batch; of other craft than Tango; of one other craft; share of a new training with easy samples.
BATCH, OTHERS, PER_CRAFT, EASY_SHARE = 64, 40, 8, 0.2

# Number of frames of the calibration of each head.
CALIBRATION_FRAMES = 160

# Share of a craft's samples that are taken from labelled images, where there are any.
CAPTURED_SHARE = 0.5

# Shares of samples of Tango, for which laboratory images exist, and of other craft.
LABORATORY = replace(HARD, earth_share=0.75)
ORBIT = replace(LABORATORY, orbit_share=0.65)

# Maximum learning rate of a training that starts from the shipped weights.
RATE_AGAIN = 7e-4

CHECKPOINT_S = 120.0


def drawing(folder: Path, name: str) -> Drawing:
    """Return the drawing of a craft's views."""
    return Drawing(folder / name, PAINTS.get(name, (name,)), VIEWS[name], 30118)


def make_batches(
    folder: Path,
    captured: list[Path],
    seed: int,
    easy: Any,  # noqa: ANN401 - a shared flag
    queue: Queue[Samples],
) -> None:
    """Put batches into a queue until the process is killed."""
    cv2.setNumThreads(1)
    rng = np.random.default_rng(seed)
    views, earths = {}, {}
    for name in VIEWS:
        model = board_model(load_target(name))
        points = (keypoints_m(model) - model.centre_m) / model.radius_m
        views[name] = load_views(drawing(folder, name), points)
        earths[name] = image_pyramid(earths_of(drawing(folder, name)))
    crops = read_crops(captured)
    others = [name for name in VIEWS if name != "tango"]
    while True:
        few = rng.choice(others, OTHERS // PER_CRAFT, replace=False)
        sizes = {"tango": BATCH - OTHERS, **dict.fromkeys(few.tolist(), PER_CRAFT)}
        parts = []
        for name, size in sizes.items():
            mix = EASY if easy.value else LABORATORY if name.startswith("tango") else ORBIT
            n_captured = int(CAPTURED_SHARE * size) if name in crops and not easy.value else 0
            which = rng.integers(len(views[name].lit), size=size - n_captured)
            parts.append(sample(views[name], earths[name], which, rng, mix))
            if n_captured:
                parts.append(
                    crops[name].sample(rng.integers(len(crops[name].pictures), size=n_captured), rng)
                )
        keys = ("inputs", "points", "present", "log_size")
        queue.put(
            (list(sizes.items()), Batch(*(np.concatenate([getattr(p, k) for p in parts]) for k in keys)))
        )


@dataclass(frozen=True)
class Shared:
    """Weights that the worker processes read and gradients that they accumulate, in shared memory.

    Parameters
    ----------
    weights : list of tensor
        Weights of the network.
    gradients : list of tensor
        Sums of gradients, each weighted by its number of samples.
    samples : object
        Shared integer: number of samples in the sums.
    lock : object
        Lock that protects the sums.
    """

    weights: list[Tensor]
    gradients: list[Tensor]
    samples: Any
    lock: Any

    @staticmethod
    def of(weights: list[Tensor], context: Any) -> Shared:  # noqa: ANN401 - a multiprocessing context
        """Return shared memory initialised with the weights."""
        copies = [w.detach().clone(memory_format=torch.contiguous_format).share_memory_() for w in weights]
        sums = [torch.zeros_like(w).share_memory_() for w in copies]
        return Shared(copies, sums, context.Value("l", 0, lock=False), context.Lock())

    def add(self, weights: list[Tensor], samples: int) -> None:
        """Add the gradients of a batch of ``samples`` samples."""
        with self.lock, torch.no_grad():
            for w, total in zip(weights, self.gradients, strict=True):
                if w.grad is not None:
                    total.add_(w.grad, alpha=samples)
            self.samples.value += samples

    def take(self, weights: list[Tensor], samples: int) -> None:
        """Average the gradients of a batch with those that assistants added since the last step."""
        with self.lock, torch.no_grad():
            more = self.samples.value
            if not more:
                return
            for w, total in zip(weights, self.gradients, strict=True):
                own = torch.zeros_like(w) if w.grad is None else w.grad
                w.grad = (own * samples + total) / (samples + more)
                total.zero_()
            self.samples.value = 0


def assist(shared: Shared, queue: Queue[Samples]) -> None:
    """Compute and add gradients until the process is killed, at the lowest priority."""
    os.nice(19)
    torch.set_num_threads(1)
    network = KeypointNetworks()
    weights = list(network.parameters())
    while True:
        samples = queue.get()
        with torch.no_grad():
            for w, newest in zip(weights, shared.weights, strict=True):
                w.copy_(newest)
        network.zero_grad(set_to_none=True)
        _loss(network, samples)[1].backward()
        shared.add(weights, len(samples[1].inputs))


class KeypointNetworks(nn.Module):  # type: ignore[misc]
    """The trunk and the heads of all built-in craft."""

    def __init__(self) -> None:
        super().__init__()
        self.trunk = Trunk().to(memory_format=torch.channels_last)
        self.heads = nn.ModuleDict({name: Head() for name in VIEWS})

    def load_shipped(self, samples: Batch) -> None:
        """Load the package's weights; ``samples`` initialise the running statistics of the normalisation layers."""
        trunk = unfold(from_onnx(trunk_bytes()), torch.from_numpy(samples.inputs).float())
        self.trunk.load_state_dict(trunk.state_dict())
        for name, head in self.heads.items():
            shipped = network_for(board_model(load_target(name)))
            if shipped is None:
                raise RuntimeError(f"{name} has no shipped head; train with --anew")
            head.load_state_dict(state_of(shipped.head))


def train(
    folder: Path, captured: list[Path], state: Path, minutes: float, assistants: int, *, anew: bool
) -> None:
    """Train until the total training time reaches ``minutes``."""
    torch.set_num_threads(1)
    torch.manual_seed(0)
    context = multiprocessing.get_context("spawn")
    queue, easy = context.Queue(8), context.Value("b", anew)
    steps, spent = 0, 0.0
    kept = torch.load(state, weights_only=True) if state.exists() else None
    if kept is not None:
        steps, spent = kept["steps"], kept["spent_s"]
    context.Process(target=make_batches, args=(folder, captured, steps, easy, queue), daemon=True).start()
    both = KeypointNetworks()
    if kept is None and not anew:
        both.load_shipped(queue.get()[1])
    adam = torch.optim.AdamW(
        both.parameters(), fit.LEARNING_RATE if anew else RATE_AGAIN, weight_decay=fit.WEIGHT_DECAY
    )
    mean = {k: v.clone() for k, v in both.state_dict().items()}
    if kept is not None:
        both.load_state_dict(kept["weights"])
        adam.load_state_dict(kept["adam"])
        mean = kept["mean"]
    both.train()
    weights = list(both.parameters())
    shared = Shared.of(weights, context)
    for _ in range(assistants):
        context.Process(target=assist, args=(shared, queue), daemon=True).start()
    began, saved = time.monotonic() - spent, time.monotonic()
    while (share := (time.monotonic() - began) / (60 * minutes)) < 1:
        easy.value = anew and share < EASY_SHARE
        rate = (fit.LEARNING_RATE if anew else RATE_AGAIN) * min(1.0, (steps + 1) / fit.WARM_UP_STEPS)
        for group in adam.param_groups:
            group["lr"] = float(rate * (0.98 * (0.5 + 0.5 * np.cos(np.pi * share)) + 0.02))
        samples = queue.get()
        keypoints, loss = _loss(both, samples)
        adam.zero_grad()
        loss.backward()
        shared.take(weights, BATCH)
        nn.utils.clip_grad_norm_(weights, fit.MAX_GRADIENT)
        adam.step()
        steps += 1
        with torch.no_grad():
            for w, newest in zip(weights, shared.weights, strict=True):
                newest.copy_(w)
        _average(mean, both.state_dict(), steps)
        if time.monotonic() - saved > CHECKPOINT_S:
            saved = time.monotonic()
            _save(state, both, adam, mean, steps, saved - began)
            print(f"{(saved - began) / 60:.0f} min, {steps} steps, loss {keypoints.item():.3f}", flush=True)
    _save(state, both, adam, mean, steps, 60 * minutes)


def write(state: Path) -> None:
    """Write the running means of the weights into the package."""
    mean = torch.load(state, weights_only=True)["mean"]
    trunk = Trunk()
    trunk.load_state_dict({k[len("trunk.") :]: v for k, v in mean.items() if k.startswith("trunk.")})
    data = to_onnx(fold(trunk))
    WEIGHTS.mkdir(exist_ok=True)
    write_atomic(WEIGHTS / "trunk.onnx", data)
    for name in VIEWS:
        start = f"heads.{name}."
        weights = {k[len(start) :]: v for k, v in mean.items() if k.startswith(start)}
        points = keypoints_m(board_model(load_target(name)))
        head = KeypointHead(name, hashlib.sha256(data).hexdigest(), points, arrays_of(weights))
        write_atomic(WEIGHTS / f"{name}.npz", head.to_bytes())


def calibrate(frames: Path, workers: int) -> None:
    """Calibrate the shipped heads, on frames rendered into a folder for each craft."""
    for name in VIEWS:
        if name in FITTED_CRAFT:
            continue
        path = WEIGHTS / f"{name}.npz"
        head = replace(KeypointHead.read(path.read_bytes(), path.name), calibration=None)
        given = held_out_answers(
            name,
            replace(board_model(load_target(name)), network=head.to_bytes()),
            frames / name,
            frames=CALIBRATION_FRAMES,
            seed=CALIBRATION_SEED,
            workers=workers,
            progress=lambda _done, _of: None,
        )
        calibration = fitted_calibration(given)
        write_atomic(path, replace(head, calibration=calibration).to_bytes())
        print(f"{name}: {calibration}", flush=True)


def _loss(networks: KeypointNetworks, samples: Samples) -> tuple[Tensor, Tensor]:
    """Return the cross-entropy of the keypoints and the total loss of a batch."""
    sizes, batch = samples
    x = torch.from_numpy(batch.inputs).float().contiguous(memory_format=torch.channels_last)
    made, first = [], 0
    with torch.autocast("cpu", torch.bfloat16):
        features = networks.trunk(x)
        for name, size in sizes:
            made.append(networks.heads[name](features[first : first + size]))
            first += size
    return fit.loss((torch.cat([m[0] for m in made]), torch.cat([m[1] for m in made])), batch)


def _average(mean: dict[str, Tensor], weights: dict[str, Tensor], steps: int) -> None:
    keep = min(fit.AVERAGE_DECAY, steps / (steps + 50))
    with torch.no_grad():
        for key, value in weights.items():
            if value.dtype.is_floating_point:
                mean[key].lerp_(value, 1 - keep)


def _save(
    path: Path,
    both: nn.Module,
    adam: torch.optim.Optimizer,
    mean: dict[str, Tensor],
    steps: int,
    spent_s: float,
) -> None:
    data = io.BytesIO()
    state = {
        "weights": both.state_dict(),
        "adam": adam.state_dict(),
        "mean": mean,
        "steps": steps,
        "spent_s": spent_s,
    }
    torch.save(state, data)
    write_atomic(path, data.getvalue())


def main() -> None:
    """Run the chosen step."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    commands = parser.add_subparsers(dest="command", required=True)
    draw = commands.add_parser("draw", help="render the views of all craft")
    draw.add_argument("views", type=Path)
    draw.add_argument("--workers", type=int, default=2)
    fitted = commands.add_parser("fit", help="train")
    fitted.add_argument("views", type=Path)
    fitted.add_argument("state", type=Path)
    fitted.add_argument("--minutes", type=float, default=180.0)
    fitted.add_argument("--assistants", type=int, default=1)
    fitted.add_argument(
        "--captured", type=Path, nargs="*", default=[], help="packed data sets (tools.train.captured)"
    )
    fitted.add_argument("--anew", action="store_true", help="start from random weights")
    written = commands.add_parser("write", help="write the weights into the package")
    written.add_argument("state", type=Path)
    calibrated = commands.add_parser("calibrate", help="calibrate the shipped heads")
    calibrated.add_argument("frames", type=Path)
    calibrated.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    if given.command == "draw":
        for name in VIEWS:
            say = lambda done, of, name=name: print(f"{name}: {done} of {of}", flush=True)  # noqa: E731 - a line
            render_views(drawing(given.views, name), given.workers, say)
    elif given.command == "fit":
        train(given.views, given.captured, given.state, given.minutes, given.assistants, anew=given.anew)
    elif given.command == "calibrate":
        calibrate(given.frames, given.workers)
    else:
        write(given.state)


if __name__ == "__main__":
    main()
