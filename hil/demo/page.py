"""Demo page: images with their truth, the flight, errors and latency, in one folder without a server."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.hil.demo.method_comparison import comparison_section
from flyaround.hil.demo.plots import plot_errors, plot_latency, plot_trajectory
from flyaround.hil.host.ledger.summary import LedgerSummary
from flyaround.simulator.dataset.capture import CaptureSummary
from flyaround.simulator.dataset.card import read_card
from flyaround.simulator.dataset.check.verify import CheckReport
from flyaround.simulator.dataset.formats.native import frame_paths, read_png
from flyaround.simulator.labels.overlay import draw_pose, draw_truth, screen_rgb
from flyaround.simulator.labels.truth import Truth, read_truth
from flyaround.simulator.reports.markup import Content, Markup, element, markup
from flyaround.simulator.reports.page import Page, gallery, key_figures, link, note, plot
from flyaround.simulator.reports.pictures import write_jpeg
from flyaround.simulator.reports.plots import png

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence
    from pathlib import Path

    from matplotlib.figure import Figure

    from flyaround.hil.demo.method_comparison import MethodAnswer
    from flyaround.hil.host.frame_record import FrameRecord
    from flyaround.simulator.frame import Frame
    from flyaround.simulator.runtime.arrays import ByteArray
    from flyaround.simulator.scenario.plan import Plan

# Size of the images on the page, width and height.
THUMBNAIL_PX, ANSWER_PX = (480, 300), (960, 600)

# Number of answers shown.
N_ANSWERS = 6

# Side of the enlarged crop as a share of the image's height, and half of the part that it shows relative to the
# target's box, which leaves a margin of a tenth.
INSET_SHARE, BOX_FACTOR = 0.55, 0.55

# Half of that part as a share of the image's height above which the target is large enough without an inset.
LARGE_SHARE = 0.25

# Place of the target, as a share of the width, beyond which the inset is at the left.
RIGHT_SHARE = 0.6

# Frame of the inset: its width [px] and grey, RGB.
BORDER_PX, BORDER_RGB = 5, (110, 120, 130)


@dataclass(frozen=True, eq=False)
class LoopResults:
    """Result of the loop with the board."""

    summary: LedgerSummary
    rows: tuple[FrameRecord, ...]
    frames: dict[int, Frame]
    truth_records: int


@dataclass(frozen=True, eq=False, kw_only=True)
class DemoResults:
    """Results of the demo's stages."""

    folder: Path
    plan: Plan
    captured: CaptureSummary
    checked: CheckReport
    loop: LoopResults
    compared: tuple[MethodAnswer, ...]
    run_s: float


STYLE = """
.shot{position:relative;display:block;color:var(--dim);text-decoration:none;font-size:13px}
.shot img{width:100%;display:block;border-radius:4px}
.shot .plain{position:absolute;inset:0 0 auto;opacity:0}.shot:hover .plain{opacity:1}
.key i{font-style:normal}.plot{padding:0;border:0;background:none}
"""
TILE_FOLDER = "page"


def write_page(results: DemoResults) -> Path:
    """Write images, plots and ``index.html``, and return the path of the page."""
    tile_folder = results.folder / TILE_FOLDER
    tile_folder.mkdir(exist_ok=True)
    images = [_image(results, tile_folder, k) for k in range(results.checked.n_frames)]
    shown_rows = results.loop.rows[:: max(len(results.loop.rows) // N_ANSWERS, 1)][:N_ANSWERS]
    answers = [_answer(results, tile_folder, row) for row in shown_rows]
    return _page(results, images, answers).write(results.folder / "index.html")


def _image(results: DemoResults, tile_folder: Path, k: int) -> Markup:
    """Return a labelled image with its truth overlaid, plain on hover."""
    paths = frame_paths(results.folder / "dataset", k)
    truth, image = read_truth(paths.truth), np.asarray(read_png(paths.image), np.uint8)
    truth_image = draw_truth(image, truth, results.plan.target)
    plain = screen_rgb(image, truth.scene.sensor, truth.camera.pixel_encoding)
    names = {"truth": f"truth_{k:02d}.jpg", "plain": f"plain_{k:02d}.jpg"}
    _write_small(tile_folder / names["truth"], with_inset(truth_image, truth), THUMBNAIL_PX)
    _write_small(tile_folder / names["plain"], with_inset(plain, truth), THUMBNAIL_PX)
    n_visible = sum(p.state == "visible" for p in truth.keypoints)
    notes = [f"{truth.t_s:.0f} s", f"{_range(truth):.1f} m", f"{n_visible}/{len(truth.keypoints)} keypoints"]
    if not truth.feasible:
        notes.append(str(truth.infeasible_reason))
    return element(
        "a",
        element("img", src=f"{TILE_FOLDER}/{names['truth']}", alt=f"frame {k} with truth"),
        element("img", src=f"{TILE_FOLDER}/{names['plain']}", alt=f"frame {k}", class_="plain"),
        element("span", _dotted(notes)),
        href=f"dataset/images/{k:06d}.png",
        class_="shot",
    )


def with_inset(image: ByteArray, truth: Truth) -> ByteArray:
    """Return the image with an enlarged crop of the target in an upper corner; unchanged if the target is large."""
    if truth.box_amodal_px is None:
        return image
    height, width = image.shape[:2]
    x0, y0, x1, y1 = truth.box_amodal_px
    half = max(BOX_FACTOR * max(x1 - x0, y1 - y0), 1.0)
    if half > LARGE_SHARE * height:
        return image
    centre = np.array([x0 + x1, y0 + y1]) / 2
    low = np.clip(centre - half, 0, np.array([width, height]) - 2 * half).astype(int)
    side = min(round(INSET_SHARE * height), width)
    cut = image[low[1] : low[1] + int(2 * half), low[0] : low[0] + int(2 * half)]
    inset = cv2.resize(cut, (side, side), interpolation=cv2.INTER_CUBIC)
    cv2.rectangle(inset, (0, 0), (side - 1, side - 1), BORDER_RGB, BORDER_PX)
    out = image.copy()
    # in the corner that the craft leaves free
    left = slice(0, side) if centre[0] > RIGHT_SHARE * width else slice(width - side, width)
    out[:side, left] = inset
    return out


def _answer(results: DemoResults, tile_folder: Path, row: FrameRecord) -> Markup:
    """Return a frame as the board received it, with the returned pose overlaid."""
    frame = results.loop.frames[row.frame_id]
    truth = frame.truth
    if truth is None:
        raise RuntimeError("a frame of the demo has no truth")
    canvas = screen_rgb(frame.image, truth.scene.sensor, truth.camera.pixel_encoding)
    if row.q_wxyz is not None and row.t_m is not None:
        canvas = draw_pose(canvas, truth, results.plan.target, row.q_wxyz, row.t_m)
    source = f"{TILE_FOLDER}/answer_{row.frame_id:02d}.jpg"
    _write_small(tile_folder.parent / source, with_inset(canvas, truth), ANSWER_PX)
    notes = [f"frame {row.frame_id}: {row.outcome}"]
    if row.E_R_deg is not None:
        notes.append(f"{row.E_R_deg:.2f} deg, {1e3 * (row.E_T_m or 0):.0f} mm")
    if row.e2e_ms is not None:
        notes.append(f"{row.e2e_ms:.0f} ms")
    shot = element("img", src=source, alt=f"answer to frame {row.frame_id}")
    return element("a", shot, element("span", _dotted(notes)), href=source, class_="shot")


def _range(truth: Truth) -> float:
    return float(np.linalg.norm(truth.t_camera_from_target_m))


def _dotted(parts: Iterable[Content]) -> Markup:
    first, *remaining = parts
    return markup(first, *((" \N{MIDDLE DOT} ", part) for part in remaining))


def _write_small(path: Path, image: ByteArray, size: tuple[int, int]) -> None:
    write_jpeg(path, np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8))


def _page(results: DemoResults, images: Sequence[Markup], answers: Sequence[Markup]) -> Page:
    card, s = read_card(results.folder / "dataset"), results.loop.summary
    scenario = results.plan.scenario
    page = Page(f"Flyaround: {scenario.title}", scenario.title, width_px=1500, dark=True, style=STYLE)
    page.add(note(scenario.description))
    version = f"flyaround {card.machine.flyaround}"
    description = (
        f"{scenario.epoch_utc}, {scenario.duration_s:.0f} s of flight",
        card.machine.gl_renderer,
        version,
    )
    page.add(note(_dotted((*description, f"generated in {results.run_s:.0f} s"))))
    page.add(
        key_figures(
            (
                (results.checked.n_frames, "labelled images"),
                (results.checked.n_labels, f"labels re-verified, {len(results.checked.faults)} wrong"),
                (f"{s.accepted} / {s.sent}", "poses accepted / frames sent"),
                (s.declined, "declined"),
                (s.dropped_total, "dropped"),
                (_number(s.median_E_R_deg, "{:.2f} deg"), "median rotation error, accepted"),
                (_number(s.median_E_T_m, "{:.3f} m"), "median translation error, accepted"),
                (_number(s.e2e_ms_p50, "{:.0f} ms"), "end-to-end p50"),
                (_number(s.e2e_ms_p99, "{:.0f} ms"), "end-to-end p99"),
            )
        )
    )
    page.add(
        note(
            f"The ledger accounts for every frame: {s.sent} sent = {s.accepted} accepted + {s.declined} declined + "
            f"{s.dropped_total} dropped. {results.loop.truth_records} truth records arrived on their own endpoint; "
            "the board received none."
        )
    )
    page.section("Labelled images", KEY, gallery(images, columns=4))
    page.section("The flight", _plot(plot_trajectory(results.plan), "trajectory in LVLH and range"))
    page.section(
        "Answers of the board",
        note("The estimated pose in orange, over the image that the board received."),
        gallery(answers, columns=3),
    )
    page.section("Three methods on the same frames", comparison_section(results.compared))
    page.section("Pose errors", _plot(plot_errors(results.loop.rows), "rotation and translation errors"))
    page.section("Latency", _plot(plot_latency(results.loop.rows), "latency by stage and its distribution"))
    files = (
        link("hil/report.html", "Full report of the loop"),
        link("hil/frames.csv", "frames.csv"),
        link("hil/summary.json", "summary.json"),
        link("dataset/dataset.json", "dataset.json"),
    )
    page.add(element("p", _dotted(files)))
    return page


KEY = element(
    "p",
    "Truth over the image: wireframe and box, ",
    element("i", "keypoint visible", style="color:#009e73"),
    ", ",
    element("i", "shadowed, eclipsed, saturated or below the noise", style="color:#e69f00"),
    ", ",
    element("i", "hidden by the craft", style="color:#969696"),
    ". Point at a picture to see it plain; click for the full image.",
    class_="dim key",
)


def _plot(figure: Figure, alt: str) -> Markup:
    return plot(png(figure), None, alt=alt)


def _number(value: float | None, pattern: str) -> str:
    return "none" if value is None else pattern.format(value)
