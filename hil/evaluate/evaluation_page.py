"""Report page of an evaluation: methods side by side, error plots, range bins, classes and failures by kind."""

from __future__ import annotations

from typing import TYPE_CHECKING

import msgspec

from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics
from flyaround.hil.evaluate.evaluation_plots import CAPTIONS, draw_plots
from flyaround.hil.evaluate.failure_stage import KINDS
from flyaround.hil.evaluate.failure_tiles import failure_tile
from flyaround.hil.evaluate.greyscale import grey
from flyaround.simulator.dataset.formats.native import frame_paths, read_png
from flyaround.simulator.labels.imported import read_label_record
from flyaround.simulator.reports.markup import Content, Markup, element, markup
from flyaround.simulator.reports.page import Page, gallery, note, picture, plot, table
from flyaround.simulator.reports.pictures import write_jpeg

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from flyaround.hil.evaluate.mean_predictor import MeanPredictor
    from flyaround.hil.evaluate.metrics import MethodMetrics, Metrics, Summary
    from flyaround.hil.evaluate.result_rows import EvaluatedFrame
    from flyaround.simulator.dataset.card import DatasetCard
    from flyaround.simulator.runtime.arrays import ByteArray

INDEX = "index.html"
TILE_FOLDER = "page"

# Largest number of failures shown per kind and method, worst first.
TILES_PER_KIND = 8

ABOUT = {
    "region": "no region contained the target",
    "edges": "too few model edges have an image edge at the true pose",
    "ambiguity": "the correct pose was among the alternatives, or the answer is a near-symmetry of it",
    "correspondence": "image edges were present, but no hypothesis led to them",
    "accepted": "accepted but not coarse: the harmful errors, infeasible frames included",
}

ABOUT_METHODS = (
    "Success: share of feasible frames whose best pose, accepted or not, is within 5 deg and 5 % (coarse), 0.5 deg "
    "and 0.5 % of range (fine). Errors: over accepted frames, including infeasible ones unless stated. Small figures: "
    "95 % intervals, Wilson's for shares, bootstrap for errors. Along the camera's axes: mean "
    "\N{PLUS-MINUS SIGN} standard deviation."
)

KEY = element(
    "p",
    element("b", "green"),
    ": true pose; ",
    element("i", "orange"),
    ": estimate, with an arrow towards it if it lies outside; grey: beyond the image.",
    class_="dim key",
)

# Placeholder for a missing number, and separator of an interval.
NONE = "\N{EN DASH}"

STYLE = ".key b{color:#009e73}.key i{color:#e69f00;font-style:normal;font-weight:700}"


def write_page(
    report: Path,
    folder: Path,
    card: DatasetCard,
    model: BoardModel,
    metrics: Metrics,
    rows: Sequence[EvaluatedFrame],
) -> Path:
    """Write ``index.html`` and its images into a report folder, and return the path of the page.

    Parameters
    ----------
    report : Path
        Existing report folder.
    folder : Path
        Data set, from which the images of failures are cropped.
    card : DatasetCard
        Card of the data set.
    model : BoardModel
        Target model that the methods used.
    metrics : Metrics
        Metrics of each method.
    rows : sequence of EvaluatedFrame
        One row per frame and method.
    """
    labels = list(metrics.by_method)
    page = Page("Pose estimation", "Pose estimation against the truth", style=STYLE)
    page.add(
        note(
            f"{card.scenario_name}, seed {card.seed}, target {card.target.name}, {metrics.n} frames, "
            f"{metrics.n_feasible} feasible; model {model.sha256[:12]}; kernels {metrics.kernels}; "
            f"pictures: {metrics.pictures}"
        )
    )
    page.section(
        "Methods",
        _methods_table(list(metrics.by_method.values())),
        note(ABOUT_METHODS),
        note(about_mean_predictor(metrics.mean_predictor)),
    )
    plots = draw_plots(rows, labels)
    if plots:
        page.section("Errors and time", [plot(png, CAPTIONS[name], alt=name) for name, png in plots.items()])
    for label, m in metrics.by_method.items():
        by_range = _groups_table([(_bin_name(b.from_m, b.to_m), b) for b in m.by_range])
        by_class = _groups_table(list(m.by_class.items()))
        page.section(label, element("h3", "By range"), by_range, element("h3", "By class"), by_class)
    page.section("Failures", KEY)
    tile_folder = report / TILE_FOLDER
    tile_folder.mkdir(exist_ok=True)
    camera = CameraIntrinsics.from_dict(msgspec.to_builtins(card.camera))
    for label in labels:
        page.add(_failures(tile_folder, folder, model, camera, label, [r for r in rows if r.method == label]))
    return page.write(report / INDEX)


def about_mean_predictor(m: MeanPredictor | None) -> str:
    """Describe the mean predictor in a sentence.

    Returns
    -------
    str
        Sentence with the number of frames and the mean errors; empty if there is no predictor.
    """
    if m is None:
        return ""
    return (
        f"Mean predictor, the mean true pose as the answer to all {m.n} feasible frames: mean errors "
        f"{m.mean_E_T_m:.3g} m and {m.mean_E_R_deg:.3g}\N{DEGREE SIGN}."
    )


def _share(value: float | None, interval: tuple[float, float] | None) -> Content:
    if value is None or interval is None:
        return NONE
    return f"{100 * value:.1f} % ", _small(f"{100 * interval[0]:.1f}", f"{100 * interval[1]:.1f}")


def _small(low: str, high: str) -> Markup:
    return element("small", f"{low}{NONE}{high}")


# Larger unit for long numbers, and the factor between both.
LARGER_UNITS = {"mm": ("m", 1e3), "ms": ("s", 1e3)}


def _number(value: float | None, unit: str, factor: float = 1.0) -> str:
    if value is None:
        return NONE
    x = value * factor
    if unit in LARGER_UNITS and abs(x) >= LARGER_UNITS[unit][1]:
        unit, divisor = LARGER_UNITS[unit]
        x /= divisor
    return f"{_digits(x)} {unit}".strip()


def _digits(x: float) -> str:
    """Format a number with three digits and no exponent."""
    return f"{x:.0f}" if abs(x) >= 100 else f"{x:.3g}"


def _with_interval(
    value: float | None, interval: tuple[float, float] | None, unit: str, factor: float = 1.0
) -> Content:
    text = _number(value, unit, factor)
    if value is None or interval is None:
        return text
    # scale to the larger unit
    if unit in LARGER_UNITS and abs(value * factor) >= LARGER_UNITS[unit][1]:
        factor /= LARGER_UNITS[unit][1]
    return f"{text} ", _small(_digits(interval[0] * factor), _digits(interval[1] * factor))


def _axes(
    middle: tuple[float, float, float] | None,
    spread: tuple[float, float, float] | None,
    unit: str,
    factor: float = 1.0,
) -> str:
    if middle is None or spread is None:
        return NONE
    if unit in LARGER_UNITS and max(map(abs, (*middle, *spread))) * factor >= LARGER_UNITS[unit][1]:
        unit, many = LARGER_UNITS[unit]
        factor /= many
    both = zip(middle, spread, strict=True)
    return (
        ", ".join(f"{_digits(m * factor)} \N{PLUS-MINUS SIGN} {_digits(s * factor)}" for m, s in both)
        + f" {unit}"
    )


def _wrong_share(m: MethodMetrics) -> Content:
    if m.false_accept is None:
        return "none accepted"
    count = round(m.false_accept * m.n_accepted)
    return f"{count} of {m.n_accepted}: ", _share(m.false_accept, m.false_accept_wilson)


def _methods_table(methods: Sequence[MethodMetrics]) -> Markup:
    lines: tuple[tuple[str, Callable[[MethodMetrics], Content]], ...] = (
        ("frames, feasible", lambda m: f"{m.n}, {m.n_feasible}"),
        ("coarse success", lambda m: _share(m.coarse_success, m.coarse_success_wilson)),
        ("fine success", lambda m: _share(m.fine_success, m.fine_success_wilson)),
        ("availability", lambda m: _share(m.availability, m.availability_wilson)),
        ("accepted but not coarse", _wrong_share),
        ("median E_R", lambda m: _with_interval(m.median_E_R_deg, m.median_E_R_deg_bootstrap, "deg")),
        ("median E_T", lambda m: _with_interval(m.median_E_T_m, m.median_E_T_m_bootstrap, "mm", 1e3)),
        ("mean E_R", lambda m: _with_interval(m.mean_E_R_deg, m.mean_E_R_deg_bootstrap, "deg")),
        ("mean E_T", lambda m: _with_interval(m.mean_E_T_m, m.mean_E_T_m_bootstrap, "mm", 1e3)),
        ("p95 E_R, E_T", lambda m: f"{_number(m.p95_E_R_deg, 'deg')}, {_number(m.p95_E_T_m, 'mm', 1e3)}"),
        ("position error along x, y, z", lambda m: _axes(m.bias_m, m.spread_m, "mm", 1e3)),
        ("attitude error about x, y, z", lambda m: _axes(m.turn_bias_deg, m.turn_spread_deg, "deg")),
        (
            "median E_R, all feasible",
            lambda m: _with_interval(m.median_E_R_deg_all, m.median_E_R_deg_all_bootstrap, "deg"),
        ),
        (
            "median E_T, all feasible",
            lambda m: _with_interval(m.median_E_T_m_all, m.median_E_T_m_all_bootstrap, "mm", 1e3),
        ),
        (
            "mean E_T, all feasible",
            lambda m: _with_interval(m.mean_E_T_m_all, m.mean_E_T_m_all_bootstrap, "mm", 1e3),
        ),
        ("SPEED score", lambda m: _number(m.speed_score, "")),
        ("time p50, p95", lambda m: f"{_number(m.time_ms_p50, 'ms')}, {_number(m.time_ms_p95, 'ms')}"),
        ("failures", lambda m: ", ".join(f"{n} {kind}" for kind, n in m.failures.items()) or "none"),
    )
    head = ("", *(m.method for m in methods))
    return table(head, [(name, *(value(m) for m in methods)) for name, value in lines])


GROUP_COLUMNS: tuple[tuple[str, Callable[[Summary], Content]], ...] = (
    ("frames", lambda s: str(s.n)),
    ("feasible", lambda s: str(s.n_feasible)),
    ("accepted", lambda s: str(s.n_accepted)),
    ("coarse", lambda s: _share(s.coarse_success, s.coarse_success_wilson)),
    ("fine", lambda s: _share(s.fine_success, s.fine_success_wilson)),
    ("available", lambda s: _share(s.availability, s.availability_wilson)),
    ("median E_R", lambda s: _number(s.median_E_R_deg, "deg")),
    ("median E_T", lambda s: _number(s.median_E_T_m, "mm", 1e3)),
    ("mean E_T", lambda s: _number(s.mean_E_T_m, "mm", 1e3)),
)


def _groups_table(groups: Sequence[tuple[str, Summary]]) -> Markup:
    head = ("", *(column for column, _ in GROUP_COLUMNS))
    return table(head, [(name, *(value(s) for _, value in GROUP_COLUMNS)) for name, s in groups])


def _bin_name(low: float, high: float | None) -> str:
    return f"from {low:g} m" if high is None else f"{low:g} to {high:g} m"


def _rotation_error_deg(frame: EvaluatedFrame) -> float:
    """Return the error, the largest one of all if there is no pose."""
    return 180.0 if frame.record.E_R_deg is None else frame.record.E_R_deg


def _failures(
    tile_folder: Path,
    folder: Path,
    model: BoardModel,
    camera: CameraIntrinsics,
    label: str,
    rows: Sequence[EvaluatedFrame],
) -> Markup:
    """Return the HTML of one method's failures by kind, each with its worst frames."""
    wrong = [r for r in rows if r.record.accepted and not r.record.coarse]
    kinds = {"accepted": wrong, **{kind: [r for r in rows if r.failure == kind] for kind in KINDS}}
    parts = []
    for kind, frames in kinds.items():
        if not frames:
            continue
        worst = sorted(frames, key=_rotation_error_deg, reverse=True)[:TILES_PER_KIND]
        title = "falsely accepted" if kind == "accepted" else kind
        tiles = []
        for r in worst:
            source = f"{TILE_FOLDER}/{label.replace(' ', '-')}-{kind}-{r.frame:06d}.jpg"
            write_jpeg(tile_folder.parent / source, _tile(folder, model, camera, r))
            tiles.append(picture(source, _caption(r), alt=f"frame {r.frame}"))
        parts.append(
            markup(element("h3", f"{label}: {title} ({len(frames)})"), note(ABOUT[kind]), gallery(tiles))
        )
    return markup(parts) if parts else note(f"{label}: none.")


def _tile(folder: Path, model: BoardModel, camera: CameraIntrinsics, r: EvaluatedFrame) -> ByteArray:
    paths = frame_paths(folder, r.frame)
    truth, image = read_label_record(paths.truth), read_png(paths.image)
    estimate = None if r.q_wxyz is None else (r.q_wxyz, r.t_m)
    true = (truth.q_camera_from_target_wxyz, truth.t_camera_from_target_m)
    return failure_tile(grey(image, camera.encoding), truth.box_px, model, camera, true, estimate)[..., ::-1]


def _caption(r: EvaluatedFrame) -> str:
    errors = "no pose" if r.record.E_T_m is None else f"{r.record.E_R_deg:.1f} deg, {r.record.E_T_m:.2f} m"
    return f"frame {r.frame}, {r.record.range_m:.1f} m: {errors}" + (f"; {r.reason}" if r.reason else "")
