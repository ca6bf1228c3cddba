"""HTML page of a comparison: image, histogram, Sobel image and gradient histogram of each reference and our view."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from flyaround.simulator.compare.comparison import summary
from flyaround.simulator.compare.image_statistics import (
    EDGE_BLUR_PX,
    FIGURES,
    MAX_GRADIENT_DN,
    binary_edges,
    edge_threshold,
    sobel,
)
from flyaround.simulator.reports.markup import Markup, element
from flyaround.simulator.reports.page import Page, gallery, note, picture, table
from flyaround.simulator.reports.pictures import write_jpeg
from flyaround.simulator.runtime.files import write_json

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from flyaround.simulator.compare.comparison import Pair
    from flyaround.simulator.compare.image_statistics import ImageStatistics
    from flyaround.simulator.runtime.arrays import ByteArray, FloatArray

SOBEL_GAIN = 4.0  # scale of the gradient images, chosen by eye: 64 DN per pixel is white

# Maximum width of an image on the page [px], and quality of its JPEG: larger ones show more, and make the page slower
# to load.
DISPLAY_WIDTH_PX = 960
JPEG_QUALITY = 85
PLOT = (320, 200)  # width and height of a histogram [px], a third of an image's, chosen by eye
DECADES = 5  # range of the logarithmic axis, down from 1: ten pixels of a million
STYLE = "table{width:auto}"  # the summary is narrower than the page


def write_comparison(folder: Path, pairs: Sequence[Pair], title: str) -> dict[str, Any]:
    """Write ``index.html``, its images and ``comparison.json`` into an empty folder.

    Returns
    -------
    dict
        Document of ``comparison.json``, with the summary and the statistics of each pair in the order of ``pairs``.
    """
    pictures = folder / "pictures"
    pictures.mkdir(exist_ok=True)
    document: dict[str, Any] = {
        "schema": "flyaround.comparison",
        "version": 1,
        "summary": summary(pairs),
        "pictures": [pair.document() for pair in pairs],
    }
    write_json(folder / "comparison.json", document)
    page = Page("Beside reference pictures", f"Ours beside {title}", width_px=1500, style=STYLE)
    page.add(note(ABOUT), _summary_table(document["summary"]))
    for k, pair in enumerate(pairs):
        page.section(pair.reference.path.name, _pair(pictures, k, pair))
    page.write(folder / "index.html")
    return document


ABOUT = (
    "For each reference, our picture of the same view where its pose was known or found, else of the same kind of "
    f"view: histogram, Sobel gradient (times {SOBEL_GAIN:g}) and its histogram, unfiltered. Histograms are shares of "
    "the pixels on a logarithmic axis; grey is the reference, blue ours. Binary edges: gradient of the picture blurred "
    f"by {EDGE_BLUR_PX:g} pixels above twice its root mean square; before the Earth ours also under 25 km of air (as "
    "in the Milan thesis) and under none, with the threshold of the first."
)


def _summary_table(medians: dict[str, Any]) -> Markup | None:
    if not medians:
        return None
    head = ["median over pictures"]
    count = ["pictures"]
    for name, m in medians.items():
        head += [f"{name}: reference", "ours"]
        count += [m["pictures"], f"{m['same_view']} of the same view"]
    rows = [count]
    for key, label in FIGURES.items():
        both = [(m["reference"][key], m["ours"][key]) for m in medians.values()]
        rows.append([label, *(f"{value:.4g}" for pair in both for value in pair)])
    return table(head, rows)


def _pair(folder: Path, k: int, pair: Pair) -> list[Markup]:
    """Return the elements of one reference and our counterpart."""
    kind = "the same view" if pair.same_view else "the same kind of view"
    if pair.likeness is not None:
        kind += f", correlation over the craft {pair.likeness:.2f}"
    kind += (
        f"; histograms {pair.histogram_moved_dn:.1f} DN apart, gradients {pair.gradient_moved_dn:.2f} DN/px"
    )
    rows = [note(kind)]
    for side, image, look, colour in (
        ("reference", pair.reference.image, pair.theirs, "#52606d"),
        ("ours", pair.image, pair.ours, "#1971c2"),
    ):
        brightness = f"histogram: mean {look.mean_dn:.1f}, 99 % {look.bright_dn:.0f} DN"
        gradients = f"gradients: median {look.gradient_p50:.2f}, 99 % {look.gradient_p99:.1f} DN/px"
        pictures = (
            _figure(folder, f"{k:03d}_{side}", image, f"{side}, unfiltered"),
            _histogram(look.histogram, 256.0, colour, brightness),
            _figure(
                folder, f"{k:03d}_{side}_sobel", _gradient_picture(image), f"Sobel, times {SOBEL_GAIN:g}"
            ),
            _histogram(look.gradient_histogram, MAX_GRADIENT_DN, colour, gradients),
        )
        rows.append(gallery(pictures, columns=4))
    note_of_theirs = _edge_note("reference", pair.theirs)
    edges = [_figure(folder, f"{k:03d}_edges_reference", _edges_of(pair.reference.image), note_of_theirs)]
    for air, edge_image in pair.edges.items():
        label = _atmosphere_note(air) if len(pair.edges) > 1 else "ours"
        stem = f"{k:03d}_edges_{air.replace(' ', '')}"
        edges.append(
            _figure(
                folder, stem, _black_on_white(edge_image), f"{label}: {100 * edge_image.mean():.2f} % edges"
            )
        )
    rows.append(gallery(edges, columns=4))
    return rows


def _atmosphere_note(air: str) -> str:
    return "ours, no air" if air == "none" else f"ours, {air} of air"


def _edge_note(side: str, look: ImageStatistics) -> str:
    return f"{side}: {100 * look.edges:.2f} % edges"


def _edges_of(image: ByteArray) -> ByteArray:
    return _black_on_white(binary_edges(image, edge_threshold(image)))


def _black_on_white(edges: NDArray[np.bool_]) -> ByteArray:
    return np.asarray(np.where(edges, 0, 255), np.uint8)


def _gradient_picture(image: ByteArray) -> ByteArray:
    return np.asarray(np.clip(SOBEL_GAIN * sobel(image), 0, 255), np.uint8)


def _figure(folder: Path, stem: str, image: ByteArray, caption: str) -> Markup:
    shrink = min(DISPLAY_WIDTH_PX / image.shape[1], 1.0)
    small = (
        image if shrink == 1 else cv2.resize(image, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
    )
    write_jpeg(folder / f"{stem}.jpg", np.asarray(small, np.uint8), JPEG_QUALITY)
    return picture(f"{folder.name}/{stem}.jpg", caption, alt=caption)


def _histogram(shares: FloatArray, largest: float, colour: str, caption: str) -> Markup:
    """Return a histogram on a logarithmic axis as SVG."""
    width, height, margin, bottom = *PLOT, 44, 22
    right, base = width - 8, height - bottom
    x = margin + np.arange(len(shares)) / len(shares) * (right - margin)
    share = np.log10(np.clip(shares, 10.0**-DECADES, 1.0))
    y = 8 - share / DECADES * (base - 8)
    area = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
    ticks = []
    for d, row in enumerate(np.linspace(0, base - 8, DECADES + 1)):
        line = element(
            "line", x1=margin, x2=right, y1=f"{8 + row:.0f}", y2=f"{8 + row:.0f}", stroke="var(--line)"
        )
        ticks += [line, _svg_text(margin - 4, 12 + row, "end", f"{10.0**-d:.{d}f}")]
    marks = [
        # the last number is right-aligned with the axis
        _svg_text(
            margin + f * (right - margin), height - 6, "end" if f == 1 else "middle", f"{f * largest:.0f}"
        )
        for f in (0, 0.25, 0.5, 0.75, 1)
    ]
    points = f"{margin},{base} {area} {x[-1]:.1f},{base}"
    shape = element("polygon", points=points, fill=colour, stroke=colour, fill_opacity=0.35)
    drawing = element(
        "svg", ticks, marks, shape, viewBox=f"0 0 {width} {height}", font_size=10, fill="var(--dim)"
    )
    return element("figure", drawing, element("figcaption", caption))


def _svg_text(x: float, y: float, anchor: str, text: str) -> Markup:
    return element("text", text, x=f"{x:.0f}", y=f"{y:.0f}", text_anchor=anchor)
