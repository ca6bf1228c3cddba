"""Page of images next to renderings under fitted light: the craft in both, and the measurements."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from flyaround.simulator.reports.page import Page, gallery, note, picture, table
from flyaround.simulator.reports.pictures import write_jpeg
from flyaround.simulator.runtime.files import write_json

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from flyaround.simulator.reports.markup import Markup
    from flyaround.simulator.runtime.arrays import ByteArray
    from tools.studies.fitted_light.pairs import FittedPair

MARGIN_PX, SHOWN_PX = 24, 720  # margin around the craft, and width of the images
HEAD = (
    "picture", "boxes", "NCC", "SSIM", "dark [DN]", "ours", "noise [DN]", "ours", "clipped in the hull", "ours",
    "gradients apart [DN/px]", "outline off [px]",
)  # fmt: skip
ABOUT = (
    "Each picture beside ours at the same pose, under boxes of light fitted to it by least squares. "
    "NCC, SSIM and gradients are of the silhouette's pixels; clipped is the share at 250 DN or more inside its convex "
    "hull; the outline's distance is the median from ours to the nearest edge of theirs."
)


def write_fitted(
    folder: Path, pairs: Sequence[FittedPair], materials: Mapping[str, float], title: str
) -> dict[str, Any]:
    """Write ``index.html``, its images and ``fit.json`` into an empty folder; return the content of ``fit.json``."""
    document: dict[str, Any] = {
        "schema": "flyaround.light_fit",
        "version": 1,
        "summary": _medians(pairs),
        "materials": dict(materials),
        "pictures": [pair.document() for pair in pairs],
    }
    write_json(folder / "fit.json", document)
    pictures = folder / "pictures"
    pictures.mkdir(exist_ok=True)
    page = Page("Under fitted light", f"Ours beside {title}", width_px=1500, style="table{width:auto}")
    page.add(note(ABOUT), table(list(HEAD), [fit_row(d) for d in document["pictures"]]))
    if materials:
        rows = [[name, f"{factor:.2f}"] for name, factor in materials.items()]
        page.add(note("Materials, brighter than the target's by, fitted on every second picture:"))
        page.add(table(["material", "factor"], rows))
    for k, pair in enumerate(pairs):
        page.section(pair.reference.path.name, _shown(pictures, k, pair))
    page.write(folder / "index.html")
    return document


def fit_row(d: Mapping[str, Any]) -> list[str]:
    """Return the cells of an image under `HEAD`, from its document."""
    r, o = d["reference"], d["ours"]
    distance = "no edge" if d["outline_px"] is None else f"{d['outline_px']:.1f}"
    name = d["picture"] + (" (materials fitted on it)" if d["materials_fitted_on_it"] else "")
    return [
        name, str(d["lights"]), f"{d['ncc']:.2f}", f"{d['ssim']:.2f}", f"{r['dark_dn']:.0f}", f"{o['dark_dn']:.0f}",
        f"{r['noise_dn']:.1f}", f"{o['noise_dn']:.1f}", f"{100 * r['clipped']:.1f} %", f"{100 * o['clipped']:.1f} %",
        f"{d['gradient_moved_dn']:.2f}", distance,
    ]  # fmt: skip


def _medians(pairs: Sequence[FittedPair]) -> dict[str, Any]:
    """Return the medians over all images, and over those on which no material was fitted."""
    tested = [p for p in pairs if not p.fitted_on]
    return {
        f"{name}_{key}": round(float(np.median([getattr(p, key) for p in chosen])), 3)
        for name, chosen in (("all", pairs), ("tested", tested))
        for key in ("ncc", "ssim", "gradient_moved_dn")
        if chosen
    }


def _shown(folder: Path, k: int, pair: FittedPair) -> Markup:
    x0, y0, x1, y1 = pair.window
    rows = slice(max(y0 - MARGIN_PX, 0), y1 + MARGIN_PX)
    columns = slice(max(x0 - MARGIN_PX, 0), x1 + MARGIN_PX)
    figures = []
    for side, image in (("reference", pair.reference.image), ("ours", pair.image)):
        path = folder / f"{k:03d}_{side}.jpg"
        write_jpeg(path, _fitting(np.asarray(image[rows, columns], np.uint8)), 85)
        figures.append(picture(f"{folder.name}/{path.name}", side, alt=side))
    return gallery(figures, columns=2)


def _fitting(image: ByteArray) -> ByteArray:
    zoom = min(SHOWN_PX / max(image.shape), 3.0)
    how = cv2.INTER_AREA if zoom < 1 else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(image, None, fx=zoom, fy=zoom, interpolation=how), np.uint8)
