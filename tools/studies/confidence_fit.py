"""Fit the weights of the confidence on data sets: the probability that an answer of ``hybrid`` is right.

    python -m tools.studies.confidence_fit collect SET... -o EVIDENCE.json
    python -m tools.studies.confidence_fit fit EVIDENCE.json...
    python -m tools.studies.confidence_fit profile EVIDENCE.json... --term 8

``collect`` runs the estimator on every feasible frame. ``fit`` prints the weights of a ridge logistic regression for
``decide/confidence.py``, the acceptance at each threshold by ten-fold cross-validation over frames, and the covariance
factor with which 95 % of the right answers lie inside their bound. ``profile`` prints the log-likelihood over one
weight, with the others as they are. Test the result on other data sets.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from scipy.optimize import minimize

from flyaround.hil.board.estimation import CameraIntrinsics
from flyaround.hil.board.hybrid.decide.confidence import ACCEPT_AT, BIAS, WEIGHTS, Evidence, terms
from flyaround.hil.board.hybrid.estimator import PoseEstimator
from flyaround.hil.evaluate.greyscale import grey
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.hil.evaluate.pose_errors import COARSE_DEG, COARSE_SHARE, frame_errors, frame_record
from flyaround.simulator.dataset.card import read_card
from flyaround.simulator.dataset.formats.native import frame_paths, is_frame_complete, read_png
from flyaround.simulator.labels.imported import read_label_record
from flyaround.simulator.targets.library import load_target

Array = np.ndarray[Any, Any]

# Penalty on squared standardised weights, and number of cross-validation folds.
RIDGE, FOLDS = 0.5, 10

# Upper 5 % point of the chi-square distribution with six degrees of freedom.
CHI2_95 = 12.592


def collected(folder: Path, target: str | None) -> list[dict[str, Any]]:
    """Return one row for each feasible frame: the terms of its evidence, and whether its answer is right."""
    card = read_card(folder)
    camera = CameraIntrinsics.from_dict(msgspec.to_builtins(card.camera))
    estimator = PoseEstimator(board_model(load_target(target or card.target.name)), camera)
    rows = []
    for k in range(card.n_frames):
        paths = frame_paths(folder, k)
        if not is_frame_complete(folder, k):
            continue
        truth = read_label_record(paths.truth)
        if not truth.feasible:
            continue
        result = estimator.estimate(grey(read_png(paths.image), camera.encoding))
        evidence = result.evidence
        q, t = result.q_camera_from_target_wxyz, result.t_camera_from_target_m
        if not isinstance(evidence, Evidence) or evidence.score is None or q is None or t is None:
            continue
        off_m, share, turn_deg = frame_errors(
            truth.q_camera_from_target_wxyz, truth.t_camera_from_target_m, q, t
        )
        row = {
            "set": folder.name,
            "terms": [float(x) for x in terms(evidence, evidence.score)],
            "right": bool(turn_deg <= COARSE_DEG and share <= COARSE_SHARE),
            "turn_deg": float(turn_deg),
            "off_m": float(off_m),
            "size_px": float(evidence.size_px),
            "saturated": float(evidence.saturated),
            "accepted": bool(result.accepted),
            "range_m": float(np.linalg.norm(truth.t_camera_from_target_m)),
            "error": _error(truth, result),
            "covariance": None if result.covariance is None else np.asarray(result.covariance).tolist(),
        }
        rows.append(row)
    return rows


def _error(truth: Any, result: Any) -> list[float]:  # noqa: ANN401 - a record and an answer
    """Return the error of a pose: rotation vector [rad] and translation [m], camera axes."""
    scored = frame_record(
        np.asarray(truth.q_camera_from_target_wxyz, float),
        np.asarray(truth.t_camera_from_target_m, float),
        result.q_camera_from_target_wxyz,
        result.t_camera_from_target_m,
        accepted=result.accepted,
    )
    turn_deg, shift_m = np.array(scored.turn_camera_deg, float), np.array(scored.shift_camera_m, float)
    return [*np.radians(turn_deg).tolist(), *shift_m.tolist()]


def fitted(X: Array, y: Array) -> Array:
    """Return (1 + M,) bias and weights of a ridge logistic regression on (N, M) rows."""
    mean, spread = X.mean(axis=0), np.maximum(X.std(axis=0), 1e-6)
    Z = (X - mean) / spread

    def cost(w: Array) -> float:
        z = w[0] + Z @ w[1:]
        return float(np.logaddexp(0, np.where(y, -z, z)).sum() + RIDGE * w[1:] @ w[1:])

    w = minimize(cost, np.zeros(X.shape[1] + 1), method="L-BFGS-B").x
    weights = w[1:] / spread
    return np.concatenate([[w[0] - weights @ mean], weights])


def profiled(X: Array, y: Array, term: int) -> list[tuple[float, float, int, int]]:
    """Return rows of a weight, the log-likelihood with it, and the numbers of accepted and of wrong accepted frames.

    Parameters
    ----------
    X : (N, M) array
        Terms of the frames.
    y : (N,) array
        True if a frame's pose is right.
    term : int
        Index of the weight.
    """
    rows = []
    for weight in np.linspace(1.5, 0.0, 16) * WEIGHTS[term]:
        z = BIAS + X @ np.array(WEIGHTS) + (weight - WEIGHTS[term]) * X[:, term]
        accepted = z >= np.log(ACCEPT_AT / (1 - ACCEPT_AT))
        log_likelihood = -float(np.logaddexp(0, np.where(y, -z, z)).sum())
        rows.append((float(weight), log_likelihood, int(accepted.sum()), int((accepted & ~y).sum())))
    return rows


def main() -> None:
    """Collect evidence, or fit weights to it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    commands = parser.add_subparsers(dest="command", required=True)
    collect = commands.add_parser("collect", help="run the estimator on data sets")
    collect.add_argument("sets", nargs="+", type=Path)
    collect.add_argument("--target", help="model of the estimator (default: the data set's target)")
    collect.add_argument("-o", "--output", required=True, type=Path)
    fit = commands.add_parser("fit", help="fit the weights")
    fit.add_argument("evidence", nargs="+", type=Path)
    profile = commands.add_parser("profile", help="vary one weight")
    profile.add_argument("evidence", nargs="+", type=Path)
    profile.add_argument("--term", type=int, required=True, help="index of the weight")
    options = parser.parse_args()
    if options.command == "collect":
        rows = [row for folder in options.sets for row in collected(folder, options.target)]
        options.output.write_bytes(msgspec.json.encode(rows))
        print(f"{len(rows)} frames, {np.mean([r['right'] for r in rows]):.3f} right")
        return
    rows = [row for path in options.evidence for row in msgspec.json.decode(path.read_bytes())]
    X, y = np.array([r["terms"] for r in rows]), np.array([r["right"] for r in rows])
    if options.command == "profile":
        for weight, log_likelihood, accepted_count, wrong in profiled(X, y, options.term):
            print(
                f"{weight:.3g}: log-likelihood {log_likelihood:.2f}, accepted {accepted_count}, wrong {wrong}"
            )
        return
    names = [r["set"] for r in rows]
    print("bias and weights:", np.round(fitted(X, y), 3).tolist())
    fold = np.random.default_rng(0).integers(FOLDS, size=len(rows))
    p = np.empty(len(rows))
    for k in range(FOLDS):
        w = fitted(X[fold != k], y[fold != k])
        p[fold == k] = 1 / (1 + np.exp(-(w[0] + X[fold == k] @ w[1:])))
    for bar in (0.8, 0.85, 0.9, 0.93, 0.95, 0.97):
        accepted = p >= bar
        by_set = ", ".join(
            f"{s} {accepted[[n == s for n in names]].mean():.2f}" for s in dict.fromkeys(names)
        )
        print(
            f"threshold {bar}: accepted {accepted.sum()} of {len(rows)}, wrong {(accepted & ~y).sum()}; {by_set}"
        )
    for s in dict.fromkeys(names):
        own = [r for r in rows if r["set"] == s and r["right"] and r.get("covariance") is not None]
        squared = np.array([np.array(r["error"]) @ np.linalg.solve(r["covariance"], r["error"]) for r in own])
        if own:
            factor = float(np.quantile(squared, 0.95)) / CHI2_95
            print(
                f"{s}: covariance factor {factor:.2f}, inside {np.mean(squared < CHI2_95):.2f} of {len(own)}"
            )


if __name__ == "__main__":
    main()
