"""The comparison's page: for each reference its picture, histogram, Sobel image and gradient histogram over ours."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from simulator.compare.comparison import summary
from simulator.compare.image_statistics import (
    FIGURES,
    GRADIENT_LARGEST_DN,
    binary_edges,
    edge_threshold,
    sobel,
)
from simulator.runtime.files import write_atomic, write_json

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from simulator.compare.comparison import Pair
    from simulator.compare.image_statistics import ImageStatistics
    from simulator.runtime.arrays import ByteArray, FloatArray

SOBEL_GAIN = 4.0  # of the gradient images: 64 DN per pixel is white
SHOWN_PX = 960
JPEG_QUALITY = 85
PLOT = (320, 200)
DECADES = 5  # of the histograms' axis, from 1 down
STYLE = """
body{font:15px/1.5 system-ui,sans-serif;color:#1f2933;background:#f5f7fa;margin:0}
main{max-width:1500px;margin:0 auto;padding:28px 24px 64px}
h1{font-size:25px;margin:0 0 4px}h2{font-size:18px;margin:36px 0 6px}p{max-width:90ch;margin:4px 0 10px}
.dim,figcaption{color:#627080;font-size:13px}
.row{display:grid;grid-template-columns:repeat(4,1fr);gap:10px;margin-bottom:10px;align-items:start}
figure{background:#fff;border:1px solid #e4e7eb;border-radius:6px;margin:0;overflow:hidden}
figure img,figure svg{width:100%;display:block}figcaption{padding:4px 10px 6px}
table{border-collapse:collapse;background:#fff;border:1px solid #e4e7eb;margin:8px 0}
td,th{padding:5px 12px;text-align:right;border-top:1px solid #e4e7eb;font-variant-numeric:tabular-nums}
th:first-child,td:first-child{text-align:left}th{color:#627080;font-weight:600;font-size:13px}
"""


def write_comparison(folder: Path, pairs: Sequence[Pair], title: str) -> dict[str, Any]:
    """Write ``index.html``, its pictures and ``comparison.json`` into an empty folder; returns what the JSON holds."""
    pictures = folder / "pictures"
    pictures.mkdir(exist_ok=True)
    document: dict[str, Any] = {
        "schema": "flyaround.comparison",
        "version": 1,
        "summary": summary(pairs),
        "pictures": [pair.document() for pair in pairs],
    }
    write_json(folder / "comparison.json", document)
    body = [
        "<!doctype html><html lang=en><meta charset=utf-8><title>Beside reference pictures</title>",
        f"<meta name=viewport content='width=device-width'><style>{STYLE}</style><main>",
        f"<h1>Ours beside {html.escape(title)}</h1>",
        (
            "<p class=dim>For each reference, our picture of the same view where its pose was known or found, else "
            "of the same kind of view: histogram, Sobel gradient (times four) and its histogram, unfiltered. "
            "Histograms are shares of the pixels on a logarithmic axis; grey is the reference, blue ours. Binary "
            "edges: gradient of the picture blurred by 1.5 pixels above twice its root mean square; before the "
            "Earth ours also under the thesis's 25 km of air and under none, with the threshold of the first.</p>"
        ),
        _summary_table(document["summary"]),
    ]
    for k, pair in enumerate(pairs):
        body += _section(pictures, k, pair)
    write_atomic(folder / "index.html", "\n".join(body).encode())
    return document


def _summary_table(medians: dict[str, Any]) -> str:
    if not medians:
        return ""
    head = "".join(f"<th>{name}: reference<th>ours" for name in medians)
    rows = [f"<tr><th>median over pictures{head}"]
    count = "".join(f"<td>{m['pictures']}<td>{m['same_view']} of the same view" for m in medians.values())
    rows.append(f"<tr><td>pictures{count}")
    for key, label in FIGURES.items():
        cells = "".join(f"<td>{m['reference'][key]:.4g}<td>{m['ours'][key]:.4g}" for m in medians.values())
        rows.append(f"<tr><td>{label}{cells}")
    return f"<table>{''.join(rows)}</table>"


def _section(folder: Path, k: int, pair: Pair) -> list[str]:
    """One reference over ours."""
    name = html.escape(pair.reference.path.name)
    note = "the same view" if pair.same_view else "the same kind of view"
    if pair.likeness is not None:
        note += f", correlation over the craft {pair.likeness:.2f}"
    note += (
        f"; histograms {pair.histogram_moved_dn:.1f} DN apart, gradients {pair.gradient_moved_dn:.2f} DN/px"
    )
    rows = [f"<h2>{name}</h2><p class=dim>{note}</p>"]
    looks = (
        ("reference", pair.reference.image, pair.theirs, "#52606d"),
        ("ours", pair.image, pair.ours, "#1971c2"),
    )
    for side, image, look, colour in looks:
        rows.append(
            "<div class=row>"
            + _figure(folder, f"{k:03d}_{side}", image, f"{side}, unfiltered")
            + _plot(
                look.histogram,
                256.0,
                colour,
                f"histogram: mean {look.mean_dn:.1f}, 99 % {look.bright_dn:.0f} DN",
            )
            + _figure(folder, f"{k:03d}_{side}_sobel", _shown_gradient(image), "Sobel, times four")
            + _plot(
                look.gradient_histogram,
                GRADIENT_LARGEST_DN,
                colour,
                f"gradients: median {look.gradient_p50:.2f}, 99 % {look.gradient_p99:.1f} DN/px",
            )
            + "</div>"
        )
    tiles = [
        _figure(
            folder,
            f"{k:03d}_edges_reference",
            _edges_of(pair.reference.image),
            _edge_note("reference", pair.theirs),
        )
    ]
    tiles += [
        _figure(
            folder,
            f"{k:03d}_edges_{air.replace(' ', '')}",
            _black_on_white(edges),
            f"{_under(air) if len(pair.edges) > 1 else 'ours'}: {100 * edges.mean():.2f} % edges",
        )
        for air, edges in pair.edges.items()
    ]
    rows.append(f"<div class=row>{''.join(tiles)}</div>")
    return rows


def _under(air: str) -> str:
    return "ours, no air" if air == "none" else f"ours, {air} of air"


def _edge_note(side: str, look: ImageStatistics) -> str:
    return f"{side}: {100 * look.edges:.2f} % edges"


def _edges_of(image: ByteArray) -> ByteArray:
    return _black_on_white(binary_edges(image, edge_threshold(image)))


def _black_on_white(edges: NDArray[np.bool_]) -> ByteArray:
    return np.asarray(np.where(edges, 0, 255), np.uint8)


def _shown_gradient(image: ByteArray) -> ByteArray:
    return np.asarray(np.clip(SOBEL_GAIN * sobel(image), 0, 255), np.uint8)


def _figure(folder: Path, stem: str, image: ByteArray, caption: str) -> str:
    shrink = min(SHOWN_PX / image.shape[1], 1.0)
    small = (
        image if shrink == 1 else cv2.resize(image, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
    )
    ok, data = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])
    if not ok:
        raise RuntimeError("OpenCV could not encode a JPEG")
    write_atomic(folder / f"{stem}.jpg", data.tobytes())
    return (
        f"<figure><img src='{folder.name}/{stem}.jpg' alt='{html.escape(caption)}' loading=lazy>"
        f"<figcaption>{html.escape(caption)}</figcaption></figure>"
    )


def _plot(shares: FloatArray, largest: float, colour: str, caption: str) -> str:
    """A histogram on a logarithmic axis as SVG."""
    width, height, left, bottom = *PLOT, 44, 22
    x = left + np.arange(len(shares)) / len(shares) * (width - left - 8)
    share = np.log10(np.clip(shares, 10.0**-DECADES, 1.0))
    y = 8 - share / DECADES * (height - bottom - 8)
    base = height - bottom
    area = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
    ticks = "".join(
        f"<line x1={left} x2={width - 8} y1={8 + at:.0f} y2={8 + at:.0f} stroke=#e4e7eb />"
        f"<text x={left - 4} y={12 + at:.0f} text-anchor=end>{10.0**-d:.{d}f}</text>"
        for d, at in enumerate(np.linspace(0, base - 8, DECADES + 1))
    )
    marks = "".join(
        # the last number ends where the axis does
        f"<text x={left + f * (width - left - 8):.0f} y={height - 6} "
        f"text-anchor={'end' if f == 1 else 'middle'}>{f * largest:.0f}</text>"
        for f in (0, 0.25, 0.5, 0.75, 1)
    )
    return (
        f"<figure><svg viewBox='0 0 {width} {height}' font-size=10 fill=#627080>{ticks}{marks}"
        f"<polygon points='{left},{base} {area} {x[-1]:.1f},{base}' fill='{colour}' fill-opacity=.35 "
        f"stroke='{colour}' />"
        f"</svg><figcaption>{html.escape(caption)}</figcaption></figure>"
    )
