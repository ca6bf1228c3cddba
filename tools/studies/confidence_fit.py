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

from flyaround.hil.board.hybrid.decide.confidence import ACCEPT_AT, BIAS, WEIGHTS, terms
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.hil.train.keypoints.calibrate import CHI2_95, answers, ridge_weights
from flyaround.simulator.dataset.card import read_card
from flyaround.simulator.targets.library import load_target

Array = np.ndarray[Any, Any]

# Number of cross-validation folds.
FOLDS = 10


def collected(folder: Path, target: str | None) -> list[dict[str, Any]]:
    """Return one row for each feasible frame: the terms of its evidence, and whether its answer is right."""
    model = board_model(load_target(target or read_card(folder).target.name))
    rows = []
    for score, evidence, result in answers(folder, model):
        if not score.feasible:
            continue
        shift_m, turn_deg = score.shift_camera_m or (), score.turn_camera_deg or ()
        row = {
            "set": folder.name,
            "terms": [float(x) for x in terms(evidence, evidence.score or 0.0)],
            "right": score.coarse,
            "turn_deg": score.E_R_deg,
            "off_m": score.E_T_m,
            "size_px": float(evidence.size_px),
            "saturated": float(evidence.saturated),
            "accepted": score.accepted,
            "range_m": score.range_m,
            "error": [*np.radians(turn_deg).tolist(), *shift_m],
            "covariance": None if result.covariance is None else np.asarray(result.covariance).tolist(),
        }
        rows.append(row)
    return rows


def fitted(X: Array, y: Array) -> Array:
    """Return (1 + M,) bias and weights of a ridge logistic regression on (N, M) rows, about zero."""
    return ridge_weights(X, y, np.zeros(1 + X.shape[1]), 0.0)


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
