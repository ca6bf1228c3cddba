"""Train the keypoint network's trunk and the heads of the built-in craft together.

    python -m tools.train.keypoint_trunk draw VIEWS --workers 2
    python -m tools.train.keypoint_trunk fit VIEWS STATE --minutes 180 --threads 2
    python -m tools.train.keypoint_trunk write STATE

``draw`` and ``fit`` continue where they were interrupted; ``write`` puts the running mean of the weights into the
package. Two processes make samples during training.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import multiprocessing
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import torch
from torch import nn

from flyaround.hil.board.hybrid.propose.keypoints.head import KeypointHead
from flyaround.hil.board.hybrid.propose.keypoints.network_output import keypoints_m
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.hil.train.keypoints import fit
from flyaround.hil.train.keypoints.head_training import arrays_of, load_views
from flyaround.hil.train.keypoints.network import Head, Trunk
from flyaround.hil.train.keypoints.samples import EASY, HARD, Batch, halved, sample
from flyaround.hil.train.keypoints.trunk_file import folded, to_onnx
from flyaround.hil.train.keypoints.view_files import Drawing, draw_all, earths_of
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.targets.library import load_target

if TYPE_CHECKING:
    from multiprocessing.queues import Queue

    from torch import Tensor

WEIGHTS = Path(__file__).parents[2] / "hil/board/hybrid/propose/keypoints/weights"

# views of each craft; Tango is drawn in both of its paints
VIEWS = {
    "tango": 6000,
    "dragon": 1500,
    "soyuz-ms": 1500,
    "tianzhou": 1500,
    "change6-ascender": 1500,
    "cubesat-3u": 1500,
    "tango-thesis": 1000,
}
PAINTS = {"tango": ("tango", "tango-mockup")}

# samples per step, and of these of craft other than Tango; share of the training on easy samples
BATCH, OTHERS, EASY_SHARE = 64, 24, 0.2
PER_CRAFT = 8

CHECKPOINT_S = 120.0


def drawing(folder: Path, name: str) -> Drawing:
    """Return the drawing instructions of a craft."""
    return Drawing(folder / name, PAINTS.get(name, (name,)), VIEWS[name], 18801)


def make_batches(folder: Path, seed: int, easy: Any, queue: Queue[Any]) -> None:  # noqa: ANN401 - a shared flag
    """Put batches into a queue forever: names and sizes of their parts, and samples."""
    cv2.setNumThreads(1)
    rng = np.random.default_rng(seed)
    views, earths = {}, {}
    for name in VIEWS:
        model = board_model(load_target(name))
        points = (keypoints_m(model) - model.centre_m) / model.radius_m
        views[name] = load_views(drawing(folder, name), points)
        earths[name] = halved(earths_of(drawing(folder, name)))
    others = [name for name in VIEWS if name != "tango"]
    while True:
        few = rng.choice(others, OTHERS // PER_CRAFT, replace=False)
        sizes = {"tango": BATCH - OTHERS, **dict.fromkeys(few.tolist(), PER_CRAFT)}
        mix = EASY if easy.value else HARD
        parts = [
            sample(views[n], earths[n], rng.integers(len(views[n].lit), size=size), rng, mix)
            for n, size in sizes.items()
        ]
        keys = ("inputs", "points", "present", "log_size")
        queue.put(
            (list(sizes.items()), Batch(*(np.concatenate([getattr(p, k) for p in parts]) for k in keys)))
        )


def train(folder: Path, state: Path, minutes: float, threads: int) -> None:
    """Train until ``minutes`` in total have passed."""
    torch.set_num_threads(threads)
    torch.manual_seed(0)
    trunk, heads = Trunk(), nn.ModuleDict({name: Head() for name in VIEWS})
    both = nn.ModuleDict({"trunk": trunk.to(memory_format=torch.channels_last), "heads": heads})
    adam = torch.optim.AdamW(both.parameters(), fit.RATE, weight_decay=fit.DECAY)
    mean = {k: v.clone() for k, v in both.state_dict().items()}
    steps, spent = 0, 0.0
    if state.exists():
        kept = torch.load(state, weights_only=True)
        both.load_state_dict(kept["weights"])
        adam.load_state_dict(kept["adam"])
        mean, steps, spent = kept["mean"], kept["steps"], kept["spent_s"]
    context = multiprocessing.get_context("spawn")
    queue, easy = context.Queue(6), context.Value("b", True)
    for k in range(2):
        context.Process(target=make_batches, args=(folder, steps + k, easy, queue), daemon=True).start()
    began, saved = time.monotonic() - spent, time.monotonic()
    while (share := (time.monotonic() - began) / (60 * minutes)) < 1:
        easy.value = share < EASY_SHARE
        loss = _step(both, adam, queue.get(), steps, share)
        steps += 1
        _average(mean, both.state_dict(), steps)
        if time.monotonic() - saved > CHECKPOINT_S:
            saved = time.monotonic()
            _save(state, both, adam, mean, steps, saved - began)
            print(f"{(saved - began) / 60:.0f} min, {steps} steps, loss {loss:.3f}", flush=True)
    _save(state, both, adam, mean, steps, 60 * minutes)


def write(state: Path) -> None:
    """Write the running means into the package."""
    mean = torch.load(state, weights_only=True)["mean"]
    trunk = Trunk()
    trunk.load_state_dict({k[len("trunk.") :]: v for k, v in mean.items() if k.startswith("trunk.")})
    data = to_onnx(folded(trunk))
    WEIGHTS.mkdir(exist_ok=True)
    write_atomic(WEIGHTS / "trunk.onnx", data)
    for name in VIEWS:
        start = f"heads.{name}."
        weights = {k[len(start) :]: v for k, v in mean.items() if k.startswith(start)}
        points = keypoints_m(board_model(load_target(name)))
        head = KeypointHead(name, hashlib.sha256(data).hexdigest(), points, arrays_of(weights))
        write_atomic(WEIGHTS / f"{name}.npz", head.to_bytes())


def _step(both: nn.ModuleDict, adam: torch.optim.Optimizer, batch: Any, steps: int, share: float) -> float:  # noqa: ANN401 - of a queue
    rate = (
        fit.RATE * min(1.0, (steps + 1) / fit.WARM_UP) * (0.98 * (0.5 + 0.5 * np.cos(np.pi * share)) + 0.02)
    )
    for group in adam.param_groups:
        group["lr"] = float(rate)
    sizes, samples = batch
    x = torch.from_numpy(samples.inputs).float().contiguous(memory_format=torch.channels_last)
    made, first = [], 0
    with torch.autocast("cpu", torch.bfloat16):
        features = both["trunk"](x)
        for name, size in sizes:
            made.append(both["heads"][name](features[first : first + size]))
            first += size
    logits, whole = (torch.cat([m[k] for m in made]) for k in range(2))
    keypoints, loss = fit.loss((logits, whole), samples)
    adam.zero_grad()
    loss.backward()
    nn.utils.clip_grad_norm_(both.parameters(), fit.LARGEST_GRADIENT)
    adam.step()
    return keypoints.item()


def _average(mean: dict[str, Tensor], weights: dict[str, Tensor], steps: int) -> None:
    keep = min(fit.KEEP, steps / (steps + 50))
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
    """Run one of the three steps."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    commands = parser.add_subparsers(dest="command", required=True)
    draw = commands.add_parser("draw", help="draw the views of all craft")
    draw.add_argument("views", type=Path)
    draw.add_argument("--workers", type=int, default=2)
    fitted = commands.add_parser("fit", help="train")
    fitted.add_argument("views", type=Path)
    fitted.add_argument("state", type=Path)
    fitted.add_argument("--minutes", type=float, default=180.0)
    fitted.add_argument("--threads", type=int, default=2)
    written = commands.add_parser("write", help="write the weights into the package")
    written.add_argument("state", type=Path)
    given = parser.parse_args()
    if given.command == "draw":
        for name in VIEWS:
            say = lambda done, of, name=name: print(f"{name}: {done} of {of}", flush=True)  # noqa: E731 - a line
            draw_all(drawing(given.views, name), given.workers, say)
    elif given.command == "fit":
        train(given.views, given.state, given.minutes, given.threads)
    else:
        write(given.state)


if __name__ == "__main__":
    main()
