"""The contact sheet: every craft from three sides and six axes, with its labels, sizes and surfaces, as one page."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

import cv2
import numpy as np

from simulator.contact_sheets.target_views import OBLIQUE, SIDES, bounds_m, draw_labels, draw_view
from simulator.errors import write_error
from simulator.render.renderer import Renderer
from simulator.runtime.files import write_atomic

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from simulator.runtime.arrays import ByteArray
    from simulator.targets.model import Material, Target

LARGE, SMALL = (640, 480), (240, 240)
JPEG_QUALITY = 88


def write_contact_sheet(
    targets: Sequence[Target],
    folder: Path,
    *,
    page: str = "index.html",
    progress: Callable[[int, int], None] = lambda _done, _of: None,
) -> Path:
    """Draw the targets and write the page with its pictures; files of the same names are replaced.

    Raises
    ------
    UserError
        If the folder cannot be written or there is no OpenGL.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise write_error(folder, error, "name another folder") from error
    articles = []
    with Renderer() as renderer:
        for done, target in enumerate(targets):
            articles.append(_article(renderer, target, folder))
            progress(done + 1, len(targets))
    path = folder / page
    write_atomic(path, PAGE.replace("@ARTICLES@", "\n".join(articles)).encode())
    return path


def jpeg(image: ByteArray, quality: int = JPEG_QUALITY) -> bytes:
    """An RGB picture as JPEG bytes."""
    _, data = cv2.imencode(".jpg", image[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(data).tobytes()


def _article(renderer: Renderer, target: Target, folder: Path) -> str:
    plain: list[str] = []
    marked: list[str] = []
    sides = []
    for k, eye in enumerate(OBLIQUE):
        drawn = draw_view(renderer, target, eye, *LARGE)
        for kind, image, names in (
            ("view", drawn.image, plain),
            ("labels", draw_labels(drawn, target), marked),
        ):
            name = f"{target.name}-{kind}{k + 1}.jpg"
            write_atomic(folder / name, jpeg(image))
            names.append(name)
    for side, eye in SIDES.items():
        name = f"{target.name}-{side.replace('+', 'p').replace('-', 'n')}.jpg"
        write_atomic(folder / name, jpeg(draw_view(renderer, target, eye, *SMALL).image))
        sides.append((name, side))
    rows = "".join(f"<tr><th>{k}<td>{html.escape(v)}" for k, v in facts(target).items())
    swatches = "".join(_swatch(m) for m in target.materials)
    return ARTICLE.format(
        name=html.escape(target.name),
        title=html.escape(target.title),
        views="".join(f'<img src="{n}" alt="{html.escape(target.name)}">' for n in plain),
        labels="".join(f'<img src="{n}" alt="keypoints and wireframe">' for n in marked),
        sides="".join(
            f'<figure><img src="{n}" alt="{s}"><figcaption>from {s}</figcaption></figure>' for n, s in sides
        ),
        facts=rows,
        swatches=swatches,
        notes=html.escape(target.notes),
    )


def facts(target: Target) -> dict[str, str]:
    """What stands beside the pictures, in words."""
    low, high = bounds_m(target)
    moments = np.linalg.eigvalsh(np.asarray(target.mass.inertia_kg_m2))
    return {
        "size": " × ".join(f"{s:.3g}" for s in high - low) + " m",
        "mass": f"{target.mass.mass_kg:.4g} kg",
        "centre of mass": "(" + ", ".join(f"{c:.3f}" for c in target.mass.com_m) + ") m",
        "principal moments": ", ".join(f"{m:.3g}" for m in moments) + " kg m²",
        "triangles": f"{sum(len(p.triangles) for p in target.parts):,} in {len(target.parts)} parts",
        "keypoints": str(len(target.keypoints)),
        "edges": str(len(target.wireframe)),
        "hash": target.sha256[:12],
    }


def _swatch(m: Material) -> str:
    rgb = ",".join(str(round(255 * min(max(c, 0.0), 1.0) ** (1 / 2.2))) for c in m.base_color)
    kind = f"metallic {m.metallic:g}, roughness {m.roughness:g}"
    kind += f", coat {m.clearcoat:g}" if m.clearcoat else ""
    kind += f", crinkle {m.crinkle:g}" if m.crinkle else ""
    return f'<li title="{kind}"><i style="background:rgb({rgb})"></i>{html.escape(m.name)}</li>'


ARTICLE = """<article id="{name}">
<h2>{name}</h2><p>{title}</p>
<div class="row">{views}</div>
<div class="row">{labels}</div>
<div class="row small">{sides}</div>
<table>{facts}</table>
<ul>{swatches}</ul>
<p class="notes">{notes}</p>
</article>"""

PAGE = """<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>Targets</title>
<style>
body{font:15px/1.5 system-ui,sans-serif;margin:2rem auto;max-width:1300px;padding:0 1rem;background:#111;color:#ddd}
h2{margin:2.5rem 0 0}p{margin:.2rem 0 .8rem}.row{display:flex;gap:6px;margin-bottom:6px}
.row img{width:100%;min-width:0;display:block;background:#000}.row>img{width:33.3%}figure{margin:0;flex:1}
figcaption{font-size:12px;color:#999}table{border-collapse:collapse;margin:.5rem 0}th{text-align:left;font-weight:400;color:#999;padding-right:1rem}
ul{list-style:none;padding:0;display:flex;flex-wrap:wrap;gap:4px 14px;font-size:13px}
i{display:inline-block;width:14px;height:14px;margin-right:5px;vertical-align:-2px;border:1px solid #444}.notes{color:#999;font-size:13px}
</style>
<h1>Targets</h1>
<p>Drawn by the renderer that makes the images, the Sun behind the camera and a
little light from the other side. Blue: what can be seen of the wireframe.
Orange: keypoints, those that the craft hides as rings.</p>
@ARTICLES@
</html>
"""
