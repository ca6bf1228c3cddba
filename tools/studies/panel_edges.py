"""Which edges of a craft serve at which distance, and what the edges of its solar panel are worth.

    python -m tools.studies.panel_edges -o OUT        # tables and a figure: rows.json, which a later call goes on with
    python -m tools.studies.panel_edges -o OUT --page docs/svd_results.md

Frames of a recipe of evaluation, as many in each band of range. Of each the visible edges of the model at the true pose
are laid on the picture's: *found* is the share of their length with an edge of like direction under it, and *by chance*
the same of the pose turned by 15 deg. Then the pose is estimated with all edges of the model, without those inside the
panel, and without any of the panel's: by `svd`, which compares whole pictures, by `svd` with edges alone (a model
without faces), and by the thesis's version of SVD. The sphere that the learned proposal goes by stays the same.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import msgspec
import numpy as np
from matplotlib.figure import Figure

from flyaround.hil.board.svd import BoardModel, CameraIntrinsics, make_estimator
from flyaround.hil.board.svd.estimator import PREPARE, PoseEstimator
from flyaround.hil.board.svd.geometry import quaternion as quat
from flyaround.hil.board.svd.geometry.wireframe import project
from flyaround.hil.board.svd.image.edge_field import edge_field
from flyaround.hil.board.svd.image.observation import Observation
from flyaround.hil.board.svd.image.region import Region
from flyaround.hil.board.svd.model.image_patch import target_box
from flyaround.hil.board.svd.model.visibility import visible_samples
from flyaround.hil.board.svd.stages import run
from flyaround.hil.evaluate.method_choice import board_model
from flyaround.hil.evaluate.metrics import wilson_interval
from flyaround.hil.evaluate.pose_errors import COARSE_DEG, COARSE_SHARE, frame_errors
from flyaround.simulator.frame import take_frame
from flyaround.simulator.recipes.plan import RecipePlan, plan_recipe
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.scenario.load import load_recipe
from flyaround.simulator.scenario.recipe import UniformRange
from tools.studies.paired_tables import write_into_page

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.hil.board.svd.base import Estimator

Array = np.ndarray[Any, Any]

BANDS_M = ((2.5, 4.0), (4.0, 7.0), (7.0, 12.0), (12.0, 20.0), (20.0, 35.0), (35.0, 60.0))

# Kinds of edges, by how their names begin: the first that fits.
KINDS = {
    "inside the panel": ("panel_strip", "panel_frame"),
    "outline of the panel": ("panel",),
    "body": ("body",),
    "antennas and rods": ("antenna", "rod", "spike"),
    "instruments": ("",),
}
INSIDE, PANEL = ("inside the panel",), ("inside the panel", "outline of the panel")
LEFT_OUT: dict[str, tuple[str, ...]] = {"all edges": (), "none inside": INSIDE, "none of the panel": PANEL}
METHODS = ("svd", "svd, edges alone", "svd-thesis")

# An edge is found within this of the model's, and edges of a craft are looked for on so many pixels.
NEAR_PX, EDGES_PX = 1.5, 360

# Where edges are looked for by chance: the pose turned about the line of sight [rad].
TURNED_RAD = float(np.radians(15.0))


@dataclass(frozen=True)
class RangeRow:
    """One frame: what of each kind is seen and found, and the error of each estimate.

    Parameters
    ----------
    seen_px : length of each kind's visible edges. found, by_chance : share of it with an edge under it.
    error : (deg, share of the range, accepted) by method and edges; 180 deg where there is no pose.
    """

    band: int
    range_m: float
    seen_px: dict[str, float]
    found: dict[str, float]
    by_chance: float
    error: dict[str, tuple[float, float, bool]]


def kind_of(name: str) -> str:
    """The kind of an edge by its name."""
    return next(kind for kind, starts in KINDS.items() if name.startswith(starts))


def without(model: BoardModel, kinds: Sequence[str]) -> BoardModel:
    """A model without the edges of some kinds, its sphere as before."""
    if not kinds:
        return model
    left = replace(
        model,
        wireframe=tuple(e for e in model.wireframe if kind_of(e.name) not in kinds),
        sha256=f"{model.sha256}-{'-'.join(kinds)}",
    )
    # what the sphere is measured by
    left.__dict__["ends_m"] = model.ends_m
    return left


def edges_found(
    estimator: PoseEstimator, image: Array, q: Array, t: Array
) -> tuple[dict[str, float], dict[str, float]]:
    """Length [px] of each kind's visible edges at a pose, and the share of it with an edge of the picture under it."""
    target = estimator.target
    search = estimator.search(Observation(image))
    run(PREPARE, search)
    frame = search.frame
    x0, y0, x1, y1 = (float(v) for v in target_box(target, q, t))
    region = Region(x0, y0, x1, y1, "learned").grown(0.05, image.shape[1], image.shape[0])
    field = edge_field(image, region, frame.noise, EDGES_PX, background=frame.background, likely=frame.likely)
    seen, found = (dict.fromkeys(KINDS, 0.0) for _ in range(2))
    R = quat.matrix(q)
    visible, _ = visible_samples(target.samples, target.occ, -R.T @ t)
    idx = np.flatnonzero(visible)
    if not len(idx):
        return seen, found
    pr = project(target.samples, target.camera, R[None], t[None], idx[None])
    flat, inside = field.lookup(field.to_field(pr.pixels)[0], pr.angle[0])
    near = inside & (field.distance.reshape(-1)[flat] <= NEAR_PX)
    across = target.samples.tangents[idx] @ R.T
    P = pr.points_camera_m[0]
    slope = across[:, :2] - P[:, :2] / P[:, 2:] * across[:, 2:]
    length = np.hypot(*slope.T) * target.camera.fx_px * target.spacing_m / P[:, 2]
    kinds = np.array([kind_of(e.name) for e in target.model.wireframe])[target.samples.edge[idx]]
    for kind in KINDS:
        on = kinds == kind
        seen[kind] = float(length[on].sum())
        found[kind] = float((length * near)[on].sum() / max(seen[kind], 1e-9))
    return seen, found


def estimators(model: BoardModel, camera: CameraIntrinsics) -> dict[str, Estimator]:
    """Each method with each choice of edges."""
    made: dict[str, Estimator] = {}
    for name, kinds in LEFT_OUT.items():
        left = without(model, kinds)
        bare = replace(left, faces=None, sha256=f"{left.sha256}-bare")
        bare.__dict__["ends_m"] = model.ends_m
        made[f"svd; {name}"] = PoseEstimator(left, camera)
        made[f"svd, edges alone; {name}"] = PoseEstimator(bare, camera)
        made[f"svd-thesis; {name}"] = make_estimator(left, camera, "svd-thesis")
    return made


def measured(recipe: str, count: int, seed: int, kept: Path) -> list[RangeRow]:
    """``count`` feasible frames of each band of range; bands that ``kept`` holds are not measured again."""
    rows: list[RangeRow] = []
    if kept.is_file():
        rows = msgspec.json.decode(kept.read_bytes(), type=list[RangeRow])
    there = {row.band for row in rows}
    plan = plan_recipe(recipe, 1, seed=seed)
    model = board_model(plan.target)
    camera = CameraIntrinsics.from_dict(msgspec.to_builtins(plan.camera))
    made = estimators(model, camera)
    whole = made["svd; all edges"]
    if not isinstance(whole, PoseEstimator):
        raise TypeError("svd is a PoseEstimator")
    with Renderer() as renderer:
        for band, (near_m, far_m) in enumerate(BANDS_M):
            if band in there:
                continue
            drawn = RecipePlan(
                recipe=msgspec.structs.replace(
                    load_recipe(recipe),
                    target=plan.target.name,
                    range=UniformRange(near_m=near_m, far_m=far_m),
                ),
                target=plan.target,
                camera=plan.camera,
                n_frames=10 * count,
                seed=seed + band,
            )
            taken = 0
            for k in range(10 * count):
                frame = take_frame(renderer, drawn.scene(k), plan.target)
                truth = frame.truth
                if truth is None or not truth.feasible:
                    continue
                q, t = np.asarray(truth.q_camera_from_target_wxyz), np.asarray(truth.t_camera_from_target_m)
                seen, found = edges_found(whole, frame.image, q, t)
                about = np.array([np.cos(TURNED_RAD / 2), 0.0, 0.0, np.sin(TURNED_RAD / 2)])
                chance_seen, chance = edges_found(whole, frame.image, quat.multiply(about, q), t)
                by_chance = sum(chance_seen[k] * chance[k] for k in KINDS) / max(
                    sum(chance_seen.values()), 1e-9
                )
                errors = {name: _error(e, frame.image, q, t) for name, e in made.items()}
                rows.append(RangeRow(band, float(np.linalg.norm(t)), seen, found, by_chance, errors))
                taken += 1
                if taken == count:
                    break
            kept.write_bytes(msgspec.json.format(msgspec.json.encode([asdict(r) for r in rows]), indent=1))
            print(f"{near_m:g} to {far_m:g} m: {taken} frames", flush=True)
    return rows


def _error(estimator: Estimator, image: Array, q: Array, t: Array) -> tuple[float, float, bool]:
    result = estimator.estimate(image)
    got_q, got_t = result.q_camera_from_target_wxyz, result.t_camera_from_target_m
    if got_q is None or got_t is None:
        return 180.0, 9.0, False
    _, share, deg = frame_errors(q, t, got_q, got_t)
    return float(deg), float(share), bool(result.accepted)


def right(error: tuple[float, float, bool]) -> bool:
    """Whether a pose is within 5 deg and 5 % of the range."""
    return error[0] <= COARSE_DEG and error[1] <= COARSE_SHARE


def edges_table(rows: Sequence[RangeRow]) -> str:
    """What of each kind of edge is seen and found in each band of range, in Markdown."""
    lines = [
        "| range [m] | frames | " + " | ".join(KINDS) + " | by chance |",
        "|---|---|" + "---|" * (len(KINDS) + 1),
    ]
    for band, name in _bands(rows):
        cells = []
        for kind in KINDS:
            px = np.array([r.seen_px[kind] for r in band])
            share = float(sum(r.found[kind] * r.seen_px[kind] for r in band) / max(px.sum(), 1e-9))
            cells.append(f"{np.median(px):.0f} px, {100 * share:.0f} %")
        chance = float(np.mean([r.by_chance for r in band]))
        lines.append(f"| {name} | {len(band)} | {' | '.join(cells)} | {100 * chance:.0f} % |")
    return "\n".join(lines)


def success_table(rows: Sequence[RangeRow]) -> str:
    """Share of right poses and the median error of these, by range, method and edges, in Markdown."""
    names = [f"{method}; {edges}" for method in METHODS for edges in LEFT_OUT]
    lines = ["| method; edges | " + " | ".join(name + " m" for _, name in _bands(rows)) + " |"]
    lines.append("|---|" + "---|" * len(_bands(rows)))
    for name in names:
        cells = []
        for band, _ in _bands(rows):
            good = [r.error[name][0] for r in band if right(r.error[name])]
            accepted = [r.error[name] for r in band if r.error[name][2]]
            wrong = sum(not right(e) for e in accepted)
            error = f"{np.median(good):.2f} deg" if good else "-"
            cells.append(f"{100 * len(good) / len(band):.0f} %, {error}, {len(accepted)} ({wrong})")
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _bands(rows: Sequence[RangeRow]) -> list[tuple[list[RangeRow], str]]:
    out = []
    for k, (near_m, far_m) in enumerate(BANDS_M):
        band = [r for r in rows if r.band == k]
        if band:
            out.append((band, f"{near_m:g}-{far_m:g}"))
    return out


def draw_figure(rows: Sequence[RangeRow], path: Path) -> None:
    """Shares of edges found, and of right poses, over range."""
    mpl.rcParams["font.size"] = 9
    figure = Figure(figsize=(12.0, 4.2), layout="constrained")
    axes = figure.subplots(1, 1 + len(METHODS), sharey=True)
    bands = _bands(rows)
    x = [float(np.sqrt(np.prod(BANDS_M[band[0].band]))) for band, _ in bands]
    for kind in KINDS:
        total = [max(sum(r.seen_px[kind] for r in band), 1e-9) for band, _ in bands]
        y = [
            sum(r.found[kind] * r.seen_px[kind] for r in band) / n
            for (band, _), n in zip(bands, total, strict=True)
        ]
        axes[0].plot(x, y, marker="o", label=kind)
    axes[0].plot(x, [np.mean([r.by_chance for r in b]) for b, _ in bands], "k--", label="by chance")
    axes[0].set_title("edges found at the true pose")
    for ax, method in zip(axes[1:], METHODS, strict=True):
        for edges in LEFT_OUT:
            counts = [sum(right(r.error[f"{method}; {edges}"]) for r in band) for band, _ in bands]
            sizes = [len(band) for band, _ in bands]
            share = [n / of for n, of in zip(counts, sizes, strict=True)]
            around = [wilson_interval(n, of) or (0.0, 1.0) for n, of in zip(counts, sizes, strict=True)]
            ax.errorbar(
                x,
                share,
                yerr=[
                    [max(s - lo, 0) for s, (lo, _) in zip(share, around, strict=True)],
                    [max(hi - s, 0) for s, (_, hi) in zip(share, around, strict=True)],
                ],
                marker="o",
                capsize=2,
                label=edges,
            )
        ax.set_title(f"right poses: {method}")
    for ax in axes:
        ax.set_xscale("log")
        ax.set_xticks(x, [name for _, name in bands], rotation=45)
        ax.minorticks_off()
        ax.set_xlabel("range [m]")
        ax.set_ylim(-0.02, 1.04)
        ax.grid(alpha=0.3)
        ax.legend(fontsize=7)
    figure.savefig(path, dpi=110)


def main() -> None:
    """Measure, and write the tables and the figure."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("-o", "--output", required=True, type=Path)
    parser.add_argument("--recipe", default="eval-black")
    parser.add_argument("-n", type=int, default=30, help="feasible frames of each band of range")
    parser.add_argument("--seed", type=int, default=29501)
    parser.add_argument("--page", type=Path, default=None, help="page with places for the tables")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    rows = measured(options.recipe, options.n, options.seed, options.output / "rows.json")
    tables = {"edges": edges_table(rows), "success": success_table(rows)}
    for name, text in tables.items():
        print(f"\n{text}")
        if options.page is not None:
            write_into_page(options.page, f"range-{name}", options.recipe, text)
    draw_figure(rows, options.output / "ranges.jpg")


if __name__ == "__main__":
    main()
