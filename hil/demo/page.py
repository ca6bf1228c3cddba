"""The demo's page: pictures with their truth, the flight, the errors, the latency; one folder, no server."""

from __future__ import annotations

import html
from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from hil.demo.plots import plot_errors, plot_latency, plot_trajectory
from hil.host.ledger.summary import LedgerSummary
from simulator.dataset.capture import CaptureSummary
from simulator.dataset.card import read_card
from simulator.dataset.check.verify import CheckReport
from simulator.dataset.formats.native import frame_paths, read_png
from simulator.labels.overlay import draw_pose, draw_truth
from simulator.labels.truth import Truth, read_truth
from simulator.runtime.files import write_atomic

if TYPE_CHECKING:
    from pathlib import Path

    from hil.host.ledger.frames_csv import LedgerRow
    from simulator.frame import Frame
    from simulator.runtime.arrays import ByteArray
    from simulator.scenario.plan import Plan

THUMB = (480, 300)
N_ANSWERS = 6
INSET_SHARE = 0.55
JPEG_QUALITY = 88


@dataclass(frozen=True, eq=False, kw_only=True)
class DemoResults:
    """What the demo's stages handed on."""

    folder: Path
    plan: Plan
    captured: CaptureSummary
    checked: CheckReport
    summary: LedgerSummary
    rows: tuple[LedgerRow, ...]
    loop_frames: dict[int, Frame]
    truth_records: int
    run_s: float


def write_page(results: DemoResults) -> Path:
    """Make the pictures, the plots and ``index.html``; returns the page's path."""
    place = results.folder / "page"
    place.mkdir(exist_ok=True)
    plot_trajectory(results.plan, place / "trajectory.png")
    plot_errors(results.rows, place / "errors.png")
    plot_latency(results.rows, place / "latency.png")
    tiles = [_tile(results, place, k) for k in range(results.checked.n_frames)]
    shown = results.rows[:: max(len(results.rows) // N_ANSWERS, 1)][:N_ANSWERS]
    answers = [_answer(results, place, row) for row in shown]
    page = results.folder / "index.html"
    write_atomic(page, _html(results, tiles, answers).encode())
    return page


def _tile(results: DemoResults, place: Path, k: int) -> str:
    paths = frame_paths(results.folder / "dataset", k)
    truth, image = read_truth(paths.truth), np.asarray(read_png(paths.image), np.uint8)
    drawn = draw_truth(image, truth, results.plan.target)
    _jpeg(place / f"truth_{k:02d}.jpg", with_inset(drawn, truth), THUMB)
    plain = image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)
    _jpeg(place / f"plain_{k:02d}.jpg", with_inset(plain, truth), THUMB)
    seen = sum(p.state == "visible" for p in truth.keypoints)
    note = (
        f"{truth.t_s:.0f} s &middot; {_range(truth):.1f} m &middot; {seen}/{len(truth.keypoints)} keypoints"
    )
    if not truth.feasible:
        note += f" &middot; {truth.infeasible_reason}"
    return (
        f'<a class="tile" href="dataset/images/{k:06d}.png"><img src="page/truth_{k:02d}.jpg" alt="frame {k} with truth">'
        f'<img class="plain" src="page/plain_{k:02d}.jpg" alt="frame {k}"><span>{note}</span></a>'
    )


def with_inset(image: ByteArray, truth: Truth) -> ByteArray:
    """The whole image with the craft, cut out and enlarged, in the corner that is farther from it."""
    if truth.box_amodal_px is None:
        return image
    height, width = image.shape[:2]
    x0, y0, x1, y1 = truth.box_amodal_px
    half = 0.55 * max(x1 - x0, y1 - y0)
    if half > 0.25 * height:
        return image
    centre = np.array([x0 + x1, y0 + y1]) / 2
    low = np.clip(centre - half, 0, np.array([width, height]) - 2 * half).astype(int)
    side = round(INSET_SHARE * height)
    cut = image[low[1] : low[1] + int(2 * half), low[0] : low[0] + int(2 * half)]
    inset = cv2.resize(cut, (side, side), interpolation=cv2.INTER_CUBIC)
    cv2.rectangle(inset, (0, 0), (side - 1, side - 1), (110, 120, 130), 5)
    out = image.copy()
    left = slice(0, side) if centre[0] > 0.6 * width else slice(width - side, width)
    out[:side, left] = inset
    return out


def _answer(results: DemoResults, place: Path, row: LedgerRow) -> str:
    """A frame as the board got it, with the pose that came back drawn over it."""
    frame = results.loop_frames[row.frame_id]
    truth = frame.truth
    if truth is None:
        raise RuntimeError("the demo's frames have their truth")
    canvas = np.asarray(cv2.cvtColor(frame.image, cv2.COLOR_GRAY2RGB), np.uint8)
    if row.q_wxyz is not None and row.t_m is not None:
        canvas = draw_pose(canvas, truth, results.plan.target, row.q_wxyz, row.t_m)
    canvas = with_inset(canvas, truth)
    name = f"answer_{row.frame_id:02d}.jpg"
    _jpeg(place / name, canvas, (960, 600))
    error = "" if row.E_R_deg is None else f" &middot; {row.E_R_deg:.2f} deg, {1e3 * (row.E_T_m or 0):.0f} mm"
    latency = "" if row.e2e_ms is None else f" &middot; {row.e2e_ms:.0f} ms"
    return (
        f'<a class="tile" href="page/{name}"><img src="page/{name}" alt="answer to frame {row.frame_id}">'
        f"<span>frame {row.frame_id}: {html.escape(row.outcome)}{error}{latency}</span></a>"
    )


def _range(truth: Truth) -> float:
    return float(np.linalg.norm(truth.t_camera_from_target_m))


def _jpeg(path: Path, image: ByteArray, size: tuple[int, int]) -> None:
    small = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    bgr = small if small.ndim == 2 else small[..., ::-1]
    _, data = cv2.imencode(".jpg", np.ascontiguousarray(bgr), [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    write_atomic(path, data.tobytes())


CSS = """
:root { color-scheme: dark; --ink: #d7dde5; --dim: #8a97a6; --paper: #12171e; --card: #1a212b; --line: #2b3440; }
body { margin: 0 auto; padding: 2rem 2.5rem 4rem; max-width: 1500px; background: var(--paper); color: var(--ink);
  font: 16px/1.5 system-ui, sans-serif; }
h1 { font-size: 1.7rem; margin: 0 0 .2rem; } h2 { font-size: 1.15rem; margin: 2.4rem 0 .6rem; }
p { max-width: 75ch; } .dim, figcaption { color: var(--dim); } a { color: #7cc4ee; }
.numbers { display: grid; grid-template-columns: repeat(auto-fit, minmax(150px, 1fr)); gap: .8rem; margin-top: 1.2rem; }
.numbers div { background: var(--card); border: 1px solid var(--line); border-radius: 8px; padding: .7rem 1rem; }
.numbers b { display: block; font-size: 1.5rem; font-weight: 600; font-variant-numeric: tabular-nums; }
.grid { display: grid; grid-template-columns: repeat(4, 1fr); gap: 8px; } .grid.three { grid-template-columns: repeat(3, 1fr); }
.tile { position: relative; display: block; color: var(--dim); text-decoration: none; font-size: .8rem; }
.tile img { width: 100%; display: block; border-radius: 4px; } .tile .plain { position: absolute; inset: 0 0 auto; opacity: 0; }
.tile:hover .plain { opacity: 1; } img.wide { width: 100%; border-radius: 8px; border: 1px solid var(--line); }
.key i { font-style: normal; padding: 0 .35em; border-radius: 3px; }
@media (max-width: 900px) { .grid, .grid.three { grid-template-columns: repeat(2, 1fr); } }
"""


def _html(results: DemoResults, tiles: list[str], answers: list[str]) -> str:
    card, s = read_card(results.folder / "dataset"), results.summary
    scenario = results.plan.scenario
    numbers = "".join(
        f"<div><b>{value}</b><span class=dim>{label}</span></div>"
        for value, label in (
            (results.checked.n_frames, "labelled images"),
            (f"{results.checked.n_labels}", f"labels re-verified, {len(results.checked.faults)} wrong"),
            (f"{s.accepted} / {s.sent}", "poses accepted / frames sent"),
            (s.declined, "declined"),
            (s.dropped_total, "dropped"),
            (_number(s.median_E_R_deg, "{:.2f} deg"), "median rotation error, accepted"),
            (_number(s.median_E_T_m, "{:.3f} m"), "median translation error, accepted"),
            (_number(s.e2e_ms_p50, "{:.0f} ms"), "end-to-end p50"),
            (_number(s.e2e_ms_p99, "{:.0f} ms"), "end-to-end p99"),
        )
    )
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>Flyaround: {html.escape(scenario.title)}</title><style>{CSS}</style></head><body>
<h1>{html.escape(scenario.title)}</h1>
<p class="dim">{html.escape(scenario.description)}</p>
<p class="dim">{scenario.epoch_utc}, {scenario.duration_s:.0f} s of flight &middot; {html.escape(card.machine.gl_renderer)} &middot;
flyaround {card.machine.flyaround} &middot; made in {results.run_s:.0f} s</p>
<div class="numbers">{numbers}</div>
<p class="dim">The ledger adds up: {s.sent} sent = {s.accepted} accepted + {s.declined} declined + {s.dropped_total} dropped.
{results.truth_records} truth records arrived on their own endpoint; the board got none.</p>

<h2>Labelled images</h2>
<p class="dim key">Truth over the image: wireframe and box, <i style="color:#009e73">keypoint visible</i>
<i style="color:#e69f00">shadowed, eclipsed, saturated or below the noise</i> <i style="color:#969696">hidden by the craft</i>.
Point at a picture to see it plain; click for the full image.</p>
<div class="grid">{"".join(tiles)}</div>

<h2>The flight</h2>
<img class="wide" src="page/trajectory.png" alt="trajectory in LVLH and range">

<h2>What came back from the board</h2>
<p class="dim">The pose that the estimator returned, drawn in orange over the image it was given.</p>
<div class="grid three">{"".join(answers)}</div>

<h2>Pose errors</h2>
<img class="wide" src="page/errors.png" alt="rotation and translation errors">

<h2>Latency</h2>
<img class="wide" src="page/latency.png" alt="latency by stage and its distribution">
<p><a href="hil/report.html">Full report of the loop</a> &middot; <a href="hil/frames.csv">frames.csv</a> &middot;
<a href="hil/summary.json">summary.json</a> &middot; <a href="dataset/dataset.json">dataset.json</a></p>
</body></html>
"""


def _number(value: float | None, pattern: str) -> str:
    return "none" if value is None else pattern.format(value)
