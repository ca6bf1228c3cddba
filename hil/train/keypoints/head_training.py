"""Training of a target's keypoint head on the features of the shipped trunk, from rendered views."""

from __future__ import annotations

import io
import pickle
import shutil
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import cv2
import msgspec
import numpy as np
import torch

from flyaround.hil.board.hybrid.propose.keypoints.head import SHAPES, KeypointHead
from flyaround.hil.board.hybrid.propose.keypoints.network import trunk_bytes, trunk_sha256
from flyaround.hil.board.hybrid.propose.keypoints.network_input import INPUT_PX
from flyaround.hil.board.hybrid.propose.keypoints.network_output import (
    keypoints_m,
)
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.hil.train.fitting import Budget
from flyaround.hil.train.keypoints import fit
from flyaround.hil.train.keypoints.calibrate import fitted_calibration, held_out_answers
from flyaround.hil.train.keypoints.network import Head
from flyaround.hil.train.keypoints.samples import Batch, LitViews, image_pyramid, sample
from flyaround.hil.train.keypoints.trunk_file import from_onnx
from flyaround.hil.train.keypoints.view_files import Drawing, earths_of, render_views
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.targets.library import load_target

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray
    from torch import Tensor

    from flyaround.hil.train.keypoints.network import Trunk
    from flyaround.simulator.runtime.arrays import Float32Array, FloatArray
    from flyaround.simulator.targets.model import Target

    Report = Callable[[float, str], None]

# Batch size; number of held-out views; steps between checkpoints and reports.
BATCH, HELD_OUT_VIEWS, CHECKPOINT_STEPS = 64, 100, 200

# Added to the seed for the frames of the calibration.
CALIBRATION_SEED = 1_000_003

# Minimum distance between distinct keypoints [radii], and minimum number of distinct keypoints.
DISTINCT_RADII, MIN_DISTINCT = 0.05, 6


class HeadReport(msgspec.Struct, frozen=True, kw_only=True):
    """Errors of a keypoint head on held-out views.

    Parameters
    ----------
    network : str
        Name of the head's file.
    target : str
        Name of the target.
    views : int
        Number of rendered views.
    steps : int
        Number of training steps.
    median_px : float
        Median error of a keypoint, in pixels of the network's 128 x 128 input.
    within_10_px : float
        Share of keypoints with an error below 10 px.
    present : float
        Share of the views with a target in which the head detects it.
    symmetries : int
        Number of rotations under which the target looks nearly the same. Keypoints are determined only up to these.
    frames : int
        Number of answers that calibrated the estimator; 0 if it is not calibrated.
    right : int
        Number of these within 5 deg and 5 % of the range.
    accepted : int
        Number of these accepted with the calibration.
    wrong : int
        Number of accepted ones that are not right.
    """

    network: str
    target: str
    views: int
    steps: int
    median_px: float
    within_10_px: float
    present: float
    symmetries: int
    frames: int
    right: int
    accepted: int
    wrong: int


def train_head(
    name: str,
    output: Path,
    *,
    views: int,
    budget: Budget,
    seed: int = 0,
    workers: int = 1,
    calibration_frames: int = 0,
    report: Report = lambda _done, _text: None,
) -> HeadReport:
    """Train the keypoint head of a target, calibrate the estimator with it, and write its file.

    Rendered views and checkpoints are kept in a folder of the file's name plus ``.partial`` until the file is written.
    An interrupted training resumes from there if called again with the same arguments.

    Parameters
    ----------
    name : str
        Name of the target.
    output : Path
        File to write, ``.npz``.
    views : int
        Number of views to render.
    budget : Budget
        Limit on the time or steps of the training, excluding rendering.
    seed : int
        Seed of views, samples and initial weights.
    workers : int
        Number of render processes, and of threads that make samples.
    calibration_frames : int
        Number of frames to render for the calibration; 0 leaves the head uncalibrated.
    report : callable
        Called with the completed share and a line of text.

    Returns
    -------
    HeadReport
        Errors of the head on held-out views.

    Raises
    ------
    UserError
        If the target has too few distinct keypoints or too many triangles, the disk is full, or an interrupted training
        is damaged or has other views.
    """
    target = load_target(name)
    model = board_model(target)
    if model.faces is None:
        raise UserError(
            f"target {name!r} has too many triangles for a board to render, so hybrid would not use a network; add its "
            "mesh again with --decimate 9000"
        )
    points_m = keypoints_m(model)
    points = (points_m - model.centre_m) / model.radius_m
    _check_keypoints(target, points)
    partial = output.with_name(f"{output.name}.partial")
    drawing = Drawing(partial / "views", (name,), views, seed)
    render_views(
        drawing, workers, lambda done, of: report(0.25 * done / of, f"{done} of {of} views rendered")
    )
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    trunk = from_onnx(trunk_bytes()).requires_grad_(requires_grad=False)
    training = _HeadTraining(trunk, load_views(drawing, points), image_pyramid(earths_of(drawing)), seed)
    state = partial / "head.pt"
    steps = training.run(budget, workers, state, lambda d, text: report(0.25 + 0.65 * d, text))
    errors_held_out = training.judged()
    head = KeypointHead(name, trunk_sha256(), points_m, arrays_of(training.mean))
    given = held_out_answers(
        name,
        replace(model, network=head.to_bytes()),
        partial / "calibration",
        frames=calibration_frames,
        seed=(seed + CALIBRATION_SEED) % 2**63,
        workers=workers,
        progress=lambda done, of: report(0.9 + 0.1 * done / of, "calibrating on held-out frames"),
    )
    calibration = fitted_calibration(given)
    if given:
        head = replace(head, calibration=calibration)
    accepted = [answer for answer in given if answer.is_accepted(calibration)]
    write_atomic(output, head.to_bytes())
    shutil.rmtree(partial)
    return HeadReport(
        network=output.name,
        target=name,
        views=views,
        steps=steps,
        median_px=errors_held_out[0],
        within_10_px=errors_held_out[1],
        present=errors_held_out[2],
        symmetries=len(model.symmetry_wxyz),
        frames=len(given),
        right=sum(answer.score.coarse for answer in given),
        accepted=len(accepted),
        wrong=sum(not answer.score.coarse for answer in accepted),
    )


def load_views(drawing: Drawing, points: FloatArray) -> LitViews:
    """Load the rendered views of a target, whose keypoints are ``points`` (K, 3) [radii].

    Returns
    -------
    LitViews
        Views in the order of rendering; lit, scale, cover and label are mapped from their files, read-only.
    """

    def part(name: str) -> NDArray[Any]:
        return np.asarray(np.load(drawing.folder / f"{name}.npy", mmap_mode="r"))

    pose = np.array(part("pose"))
    return LitViews(part("lit"), part("scale"), part("cover"), part("label"), pose[:, :4], pose[:, 4], points)


def arrays_of(weights: dict[str, Tensor]) -> dict[str, Float32Array]:
    """Return the weights of a `Head` under the names of the head's file.

    Returns
    -------
    dict of str to array
        Float32 arrays in the shapes of ``SHAPES``, without the keypoints; they share the memory of float32 tensors on
        the processor.
    """
    return {key: weights[_parameter_name(key)].float().numpy() for key in SHAPES if key != "keypoints_m"}


def state_of(head: KeypointHead) -> dict[str, Tensor]:
    """Return the weights of a head's file under the names of a `Head`.

    Returns
    -------
    dict of str to Tensor
        Copies of the weights, as ``load_state_dict`` of a `Head` takes them.
    """
    return {_parameter_name(key): torch.from_numpy(array.copy()) for key, array in head.weights.items()}


def _parameter_name(key: str) -> str:
    """Return the PyTorch parameter name of an array in a head's file."""
    return key.replace("_bias", ".bias") if "bias" in key else f"{key}.weight"


def _check_keypoints(target: Target, points: FloatArray) -> None:
    """Raise unless the keypoints of a target determine its pose.

    Raises
    ------
    UserError
        If too few keypoints are distinct, or all are collinear.
    """
    distinct: list[FloatArray] = []
    for p in points:
        if all(np.linalg.norm(p - other) > DISTINCT_RADII for other in distinct):
            distinct.append(p)
    spread = np.linalg.svd(np.array(distinct) - np.mean(distinct, axis=0), compute_uv=False)
    if len(distinct) < MIN_DISTINCT or spread[1] < DISTINCT_RADII:
        raise UserError(
            f"target {target.name!r} has {len(distinct)} distinct keypoints; training needs {MIN_DISTINCT} that are "
            "not collinear: add keypoints or edges to its file"
        )


class _HeadTraining:
    """Training of one head on the features of a frozen trunk."""

    def __init__(self, trunk: Trunk, views: LitViews, earths: tuple[Float32Array, ...], seed: int) -> None:
        self._trunk = trunk.to(memory_format=torch.channels_last)
        self._views, self._earths, self._seed = views, earths, seed
        self._head = Head()
        self._n_held_out = min(HELD_OUT_VIEWS, len(views.lit) // 5)
        self._adam = torch.optim.AdamW(
            self._head.parameters(), lr=fit.LEARNING_RATE, weight_decay=fit.WEIGHT_DECAY
        )
        self.mean = {k: v.clone() for k, v in self._head.state_dict().items()}
        self._steps, self._elapsed_s = 0, 0.0

    def run(self, budget: Budget, workers: int, state: Path, report: Report) -> int:
        """Train, resuming from the checkpoint ``state`` if it exists; return the total number of steps."""
        self._restore(state)
        cv2.setNumThreads(1)
        began = time.monotonic() - self._elapsed_s
        with ThreadPoolExecutor(workers) as pool:
            ahead = [pool.submit(self._batch, self._steps + k) for k in range(2 * workers)]
            while (done := budget.done(began, self._steps)) < 1:
                batch = ahead.pop(0).result()
                ahead.append(pool.submit(self._batch, self._steps + 2 * workers))
                loss = self._step(batch, done)
                self._steps += 1
                if self._steps % CHECKPOINT_STEPS == 0:
                    self._elapsed_s = time.monotonic() - began
                    self._save(state)
                    left = (1 - done) / max(done, 1e-9) * self._elapsed_s / 60
                    report(done, f"{self._steps} steps, loss {loss:.2f}, {left:.0f} min left")
        return self._steps

    def judged(self) -> tuple[float, float, float]:
        """Return the median keypoint error [px], the share below 10 px, and the share of targets detected."""
        self._head.load_state_dict(self.mean)
        rng = np.random.default_rng([self._seed, 2])
        centres = fit.bin_centres().numpy()
        errors, noticed = [], []
        for first in range(0, self._n_held_out, BATCH):
            which = np.arange(first, min(first + BATCH, self._n_held_out))
            batch = sample(self._views, self._earths, which, rng)
            with torch.no_grad():
                logits, whole = self._head(self._trunk(torch.from_numpy(batch.inputs).float()))
            is_present = batch.present > 0
            peaks = centres[logits.argmax(-1).numpy()]
            error_px = np.linalg.norm(peaks - batch.points, axis=-1)[is_present] * INPUT_PX / 2
            errors.append(error_px.ravel())
            noticed.append(whole[:, 0].numpy()[is_present] > 0)
        error_px = np.concatenate(errors)
        return (
            float(np.median(error_px)),
            float((error_px < 10).mean()),  # pixels of the network's input
            float(np.concatenate(noticed).mean()),
        )

    def _batch(self, step: int) -> Batch:
        """Return the batch of a step, which depends only on the seed and the step."""
        rng = np.random.default_rng([self._seed, 1, step])
        which = rng.integers(self._n_held_out, len(self._views.lit), BATCH)
        return sample(self._views, self._earths, which, rng)

    def _step(self, batch: Batch, done: float) -> float:
        rate = (
            fit.LEARNING_RATE
            * min(1.0, (self._steps + 1) / fit.WARM_UP_STEPS)
            * (0.5 + 0.5 * np.cos(np.pi * done))
        )
        for group in self._adam.param_groups:
            group["lr"] = float(rate) + 1e-5
        inputs = torch.from_numpy(batch.inputs).float().contiguous(memory_format=torch.channels_last)
        with torch.autocast("cpu", torch.bfloat16):
            with torch.no_grad():
                features = self._trunk(inputs)
            outputs = self._head(features)
        keypoints, whole = fit.loss(outputs, batch)
        self._adam.zero_grad()
        whole.backward()
        torch.nn.utils.clip_grad_norm_(self._head.parameters(), fit.MAX_GRADIENT)
        self._adam.step()
        keep = min(fit.AVERAGE_DECAY, self._steps / (self._steps + 20))
        with torch.no_grad():
            for key, value in self._head.state_dict().items():
                self.mean[key].lerp_(value, 1 - keep)
        return keypoints.item()

    def _save(self, path: Path) -> None:
        data = io.BytesIO()
        state = {
            "head": self._head.state_dict(),
            "mean": self.mean,
            "adam": self._adam.state_dict(),
            "steps": self._steps,
            "spent_s": self._elapsed_s,
        }
        torch.save(state, data)
        write_atomic(path, data.getvalue())

    def _restore(self, path: Path) -> None:
        if not path.exists():
            return
        try:
            state = torch.load(path, weights_only=True)
            self._head.load_state_dict(state["head"])
            self._adam.load_state_dict(state["adam"])
            self.mean, self._steps, self._elapsed_s = state["mean"], state["steps"], state["spent_s"]
        except (
            RuntimeError,
            KeyError,
            TypeError,
            ValueError,
            OSError,
            EOFError,
            pickle.UnpicklingError,
        ) as error:
            raise UserError(f"{path} is not a checkpoint of a training: remove it to start again") from error
