"""The page of an evaluation: the methods side by side, error plots, ranges, classes, and the failures by kind."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

import cv2
import msgspec

from hil.board.svd import BoardModel, CameraIntrinsics
from hil.evaluate.failures import KINDS
from hil.evaluate.gallery import failure_tile
from hil.evaluate.grey import grey
from hil.evaluate.plots import CAPTIONS, draw_plots
from simulator.dataset.formats.native import frame_paths, read_png
from simulator.labels.truth import read_truth
from simulator.runtime.files import write_atomic

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from hil.evaluate.frames import EvaluatedFrame
    from hil.evaluate.metrics import MethodMetrics, Metrics, Summary
    from simulator.dataset.card import DatasetCard

INDEX = "index.html"
PLOT_FOLDER = "page"

# Failures shown of each kind and method, the worst first.
SHOWN = 8

ABOUT = {
    "region": "none of the regions held the target",
    "edges": "too little of the model has an edge under it where the target truly is",
    "ambiguity": "the right pose was among the alternatives, or the answer is a near-symmetry of it",
    "correspondence": "the edges were there, and no hypothesis led to them",
    "accepted": "accepted and not coarse: the ones that do harm, infeasible frames included",
}

STYLE = """
body{font:15px/1.5 system-ui,sans-serif;color:#1f2933;background:#f5f7fa;margin:0}
main{max-width:1180px;margin:0 auto;padding:32px 24px 64px}
h1{font-size:26px;margin:0 0 2px}h2{font-size:19px;margin:34px 0 8px}h3{font-size:15px;margin:18px 0 6px}
p.dim,figcaption{color:#627080;font-size:13px;margin:2px 0 8px}
figure{background:#fff;border:1px solid #e4e7eb;border-radius:8px;padding:14px;margin:0 0 16px}
figure img{width:100%;height:auto;display:block}
.scroll{overflow-x:auto}
table{border-collapse:collapse;background:#fff;border:1px solid #e4e7eb;width:100%}
td,th{padding:6px 12px;text-align:right;border-top:1px solid #e4e7eb;white-space:nowrap;
font-variant-numeric:tabular-nums}
th:first-child,td:first-child{text-align:left}th{border-top:0;color:#627080;font-weight:600;font-size:13px}
td small{color:#7b8794}
.tiles{display:grid;grid-template-columns:repeat(auto-fill,minmax(260px,1fr));gap:12px}
.tiles figure{padding:0;overflow:hidden;margin:0}.tiles figcaption{padding:6px 10px 8px;margin:0}
.key b{color:#009e73}.key i{color:#e69f00;font-style:normal;font-weight:700}
"""


def write_page(
    report: Path,
    folder: Path,
    card: DatasetCard,
    model: BoardModel,
    metrics: Metrics,
    rows: Sequence[EvaluatedFrame],
) -> Path:
    """Write ``index.html`` with its plots and tiles into a report folder; returns its path."""
    place = report / PLOT_FOLDER
    place.mkdir(exist_ok=True)
    labels = list(metrics.by_method)
    plots = draw_plots(rows, labels, place)
    camera = CameraIntrinsics.from_dict(msgspec.to_builtins(card.camera))
    parts = [
        "<!doctype html><html lang=en><meta charset=utf-8><title>Pose estimation</title>",
        f"<meta name=viewport content='width=device-width'><style>{STYLE}</style><main>",
        "<h1>Pose estimation beside the truth</h1>",
        (
            f"<p class=dim>{html.escape(card.scenario_name)}, seed {card.seed}, "
            f"target {html.escape(card.target.name)}, "
            f"{metrics.n} frames, {metrics.n_feasible} feasible; model {html.escape(model.sha256[:12])}; "
            f"kernels {html.escape(metrics.kernels)}; pictures: {html.escape(metrics.pictures)}</p>"
        ),
        "<h2>Methods</h2>",
        _methods_table(list(metrics.by_method.values())),
        (
            "<p class=dim>Success: share of feasible frames whose best pose, accepted or not, is within 5 deg and 5 % "
            "(coarse), 0.5 deg and 0.5 % of range (fine). Errors: over accepted frames, infeasible ones too, unless "
            "said. Small figures: 95 % intervals, Wilson's for shares, bootstrap for errors. Along the camera's axes: "
            "mean &plusmn; standard deviation.</p>"
        ),
    ]
    if plots:
        parts.append("<h2>Errors and time</h2>")
    parts += [
        f"<figure><img src='{PLOT_FOLDER}/{name}.png' alt='{name}'><figcaption>{html.escape(CAPTIONS[name])}"
        "</figcaption></figure>"
        for name in plots
    ]
    for label, m in metrics.by_method.items():
        parts.append(f"<h2>{html.escape(label)}</h2><h3>By range</h3>")
        parts.append(_groups_table([(_bin_name(b.from_m, b.to_m), b) for b in m.by_range]))
        parts.append("<h3>By class</h3>")
        parts.append(_groups_table(list(m.by_class.items())))
    parts.append("<h2>Failures</h2>")
    parts.append(
        "<p class='dim key'><b>green</b>: where the target is; <i>orange</i>: the estimate, an arrow towards it where "
        "it lies elsewhere; grey: beyond the picture.</p>"
    )
    for label in labels:
        parts += _gallery(place, folder, model, camera, label, [r for r in rows if r.method == label])
    parts.append("</main></html>")
    path = report / INDEX
    write_atomic(path, "\n".join(parts).encode())
    return path


def _share(value: float | None, interval: tuple[float, float] | None) -> str:
    if value is None or interval is None:
        return "&ndash;"
    return f"{100 * value:.1f} % <small>{100 * interval[0]:.1f}&ndash;{100 * interval[1]:.1f}</small>"


# Where a unit's numbers grow long, the next one and how many of the first it holds.
LARGER = {"mm": ("m", 1e3), "ms": ("s", 1e3)}


def _number(value: float | None, unit: str, factor: float = 1.0) -> str:
    if value is None:
        return "&ndash;"
    x = value * factor
    if unit in LARGER and abs(x) >= LARGER[unit][1]:
        unit, many = LARGER[unit]
        x /= many
    return f"{_digits(x)} {unit}".strip()


def _digits(x: float) -> str:
    """Three digits, never with an exponent."""
    return f"{x:.0f}" if abs(x) >= 100 else f"{x:.3g}"


def _ranged(value: float | None, interval: tuple[float, float] | None, unit: str, factor: float = 1.0) -> str:
    text = _number(value, unit, factor)
    if value is None or interval is None:
        return text
    # in the unit of the value itself
    if unit in LARGER and abs(value * factor) >= LARGER[unit][1]:
        factor /= LARGER[unit][1]
    return f"{text} <small>{_digits(interval[0] * factor)}&ndash;{_digits(interval[1] * factor)}</small>"


def _axes(
    middle: tuple[float, float, float] | None,
    spread: tuple[float, float, float] | None,
    unit: str,
    factor: float = 1.0,
) -> str:
    if middle is None or spread is None:
        return "&ndash;"
    if unit in LARGER and max(map(abs, (*middle, *spread))) * factor >= LARGER[unit][1]:
        unit, many = LARGER[unit]
        factor /= many
    both = zip(middle, spread, strict=True)
    return ", ".join(f"{_digits(m * factor)} &plusmn; {_digits(s * factor)}" for m, s in both) + f" {unit}"


def _wrong(m: MethodMetrics) -> str:
    if m.false_accept is None:
        return "none accepted"
    count = round(m.false_accept * m.n_accepted)
    return f"{count} of {m.n_accepted}: {_share(m.false_accept, m.false_accept_wilson)}"


def _methods_table(methods: Sequence[MethodMetrics]) -> str:
    lines: tuple[tuple[str, Callable[[MethodMetrics], str]], ...] = (
        ("frames, feasible", lambda m: f"{m.n}, {m.n_feasible}"),
        ("coarse success", lambda m: _share(m.coarse_success, m.coarse_success_wilson)),
        ("fine success", lambda m: _share(m.fine_success, m.fine_success_wilson)),
        ("availability", lambda m: _share(m.availability, m.availability_wilson)),
        ("accepted but not coarse", _wrong),
        ("median E_R", lambda m: _ranged(m.median_E_R_deg, m.median_E_R_deg_bootstrap, "deg")),
        ("median E_T", lambda m: _ranged(m.median_E_T_m, m.median_E_T_m_bootstrap, "mm", 1e3)),
        ("mean E_R", lambda m: _ranged(m.mean_E_R_deg, m.mean_E_R_deg_bootstrap, "deg")),
        ("mean E_T", lambda m: _ranged(m.mean_E_T_m, m.mean_E_T_m_bootstrap, "mm", 1e3)),
        ("p95 E_R, E_T", lambda m: f"{_number(m.p95_E_R_deg, 'deg')}, {_number(m.p95_E_T_m, 'mm', 1e3)}"),
        ("position error along x, y, z", lambda m: _axes(m.bias_m, m.spread_m, "mm", 1e3)),
        ("attitude error about x, y, z", lambda m: _axes(m.turn_bias_deg, m.turn_spread_deg, "deg")),
        (
            "median E_R, all feasible",
            lambda m: _ranged(m.median_E_R_deg_all, m.median_E_R_deg_all_bootstrap, "deg"),
        ),
        (
            "median E_T, all feasible",
            lambda m: _ranged(m.median_E_T_m_all, m.median_E_T_m_all_bootstrap, "mm", 1e3),
        ),
        (
            "mean E_T, all feasible",
            lambda m: _ranged(m.mean_E_T_m_all, m.mean_E_T_m_all_bootstrap, "mm", 1e3),
        ),
        ("SPEED score", lambda m: _number(m.speed_score, "")),
        ("time p50, p95", lambda m: f"{_number(m.time_ms_p50, 'ms')}, {_number(m.time_ms_p95, 'ms')}"),
        ("failures", lambda m: ", ".join(f"{n} {kind}" for kind, n in m.failures.items()) or "none"),
    )
    head = "".join(f"<th>{html.escape(m.method)}</th>" for m in methods)
    body = "".join(
        f"<tr><td>{name}</td>{''.join(f'<td>{value(m)}</td>' for m in methods)}</tr>" for name, value in lines
    )
    return f"<div class=scroll><table><tr><th></th>{head}</tr>{body}</table></div>"


def _groups_table(groups: Sequence[tuple[str, Summary]]) -> str:
    head = "".join(
        f"<th>{name}</th>"
        for name in (
            "",
            "frames",
            "feasible",
            "accepted",
            "coarse",
            "fine",
            "available",
            "median E_R",
            "median E_T",
            "mean E_T",
        )
    )
    body = "".join(
        f"<tr><td>{html.escape(name)}</td><td>{s.n}</td><td>{s.n_feasible}</td><td>{s.n_accepted}</td>"
        f"<td>{_share(s.coarse_success, s.coarse_success_wilson)}</td>"
        f"<td>{_share(s.fine_success, s.fine_success_wilson)}</td>"
        f"<td>{_share(s.availability, s.availability_wilson)}</td>"
        f"<td>{_number(s.median_E_R_deg, 'deg')}</td><td>{_number(s.median_E_T_m, 'mm', 1e3)}</td>"
        f"<td>{_number(s.mean_E_T_m, 'mm', 1e3)}</td></tr>"
        for name, s in groups
    )
    return f"<div class=scroll><table><tr>{head}</tr>{body}</table></div>"


def _bin_name(low: float, high: float | None) -> str:
    return f"from {low:g} m" if high is None else f"{low:g} to {high:g} m"


def _gallery(
    place: Path,
    folder: Path,
    model: BoardModel,
    camera: CameraIntrinsics,
    label: str,
    rows: Sequence[EvaluatedFrame],
) -> list[str]:
    parts = []
    wrong = [r for r in rows if r.record.accepted and not r.record.coarse]
    kinds = [("accepted", wrong), *((kind, [r for r in rows if r.failure == kind]) for kind in KINDS)]
    for kind, found in kinds:
        if not found:
            continue
        worst = sorted(found, key=lambda r: -(r.record.E_R_deg or 180.0))[:SHOWN]
        count = sum(r.failure == kind for r in rows) if kind != "accepted" else len(wrong)
        title = "falsely accepted" if kind == "accepted" else kind
        parts.append(
            f"<h3>{html.escape(label)}: {title} ({count})</h3><p class=dim>{ABOUT[kind]}</p><div class=tiles>"
        )
        for r in worst:
            paths = frame_paths(folder, r.frame)
            truth, image = read_truth(paths.truth), read_png(paths.image)
            estimate = None if r.q_wxyz is None else (r.q_wxyz, r.t_m)
            true = (truth.q_camera_from_target_wxyz, truth.t_camera_from_target_m)
            tile = failure_tile(grey(image), truth.box_px, model, camera, true, estimate)
            name = f"{label.replace(' ', '-')}-{kind}-{r.frame:06d}.jpg"
            _, data = cv2.imencode(".jpg", tile, [cv2.IMWRITE_JPEG_QUALITY, 88])
            write_atomic(place / name, data.tobytes())
            errors = (
                "no pose" if r.record.E_T_m is None else f"{r.record.E_R_deg:.1f} deg, {r.record.E_T_m:.2f} m"
            )
            why = f"; {html.escape(r.reason)}" if r.reason else ""
            parts.append(
                f"<figure><img src='{PLOT_FOLDER}/{name}' alt='frame {r.frame}'><figcaption>frame {r.frame}, "
                f"{r.record.range_m:.1f} m: {errors}{why}</figcaption></figure>"
            )
        parts.append("</div>")
    return parts or [f"<p class=dim>{html.escape(label)}: none.</p>"]
