"""The contact sheet: every craft from three oblique views and six sides, with labels, sizes and materials."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.contact_sheets.target_views import OBLIQUE, SIDES, bounds_m, draw_labels, draw_view
from flyaround.simulator.errors import write_error
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.reports.markup import Markup, element
from flyaround.simulator.reports.page import Page, gallery, note, picture
from flyaround.simulator.reports.pictures import write_jpeg

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from flyaround.simulator.targets.model import Material, Target

# Width and height of the first view of a target, and of its others [px].
LARGE, SMALL = (640, 480), (240, 240)


def write_contact_sheet(
    targets: Sequence[Target],
    folder: Path,
    *,
    page: str = "index.html",
    progress: Callable[[int, int], None] = lambda _done, _total: None,
) -> Path:
    """Draw the targets and write the page with its images; existing files are replaced.

    Returns
    -------
    Path
        Written page, ``page`` in ``folder``.

    Raises
    ------
    UserError
        If the folder cannot be written or there is no OpenGL.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise write_error(folder, error, "name another folder") from error
    sheet = Page("Targets", width_px=1300, dark=True, style=STYLE)
    sheet.add(element("p", ABOUT))
    with Renderer() as renderer:
        for n_done, target in enumerate(targets):
            sheet.add(_article(renderer, target, folder))
            progress(n_done + 1, len(targets))
    return sheet.write(folder / page)


def _article(renderer: Renderer, target: Target, folder: Path) -> Markup:
    plain: list[Markup] = []
    marked: list[Markup] = []
    sides: list[Markup] = []
    for k, eye in enumerate(OBLIQUE):
        view = draw_view(renderer, target, eye, *LARGE)
        for kind, image, alt, pictures in (
            ("view", view.image, target.name, plain),
            ("labels", draw_labels(view, target), "keypoints and wireframe", marked),
        ):
            source = f"{target.name}-{kind}{k + 1}.jpg"
            write_jpeg(folder / source, image)
            pictures.append(element("img", src=source, alt=alt, loading="lazy"))
    for side, eye in SIDES.items():
        source = f"{target.name}-{side.replace('+', 'p').replace('-', 'n')}.jpg"
        write_jpeg(folder / source, draw_view(renderer, target, eye, *SMALL).image)
        sides.append(picture(source, f"from {side}", alt=side))
    return element(
        "article",
        element("h2", target.name),
        element("p", target.title),
        gallery(plain, columns=3),
        gallery(marked, columns=3),
        gallery(sides, columns=6),
        element(
            "table", [element("tr", element("th", k), element("td", v)) for k, v in facts(target).items()]
        ),
        element("ul", [_swatch(m) for m in target.materials]),
        note(target.notes),
        id=target.name,
    )


def facts(target: Target) -> dict[str, str]:
    """Return the facts of a target that are listed next to its images.

    Returns
    -------
    dict of str to str
        Formatted values with their units, by title in the order of the list.
    """
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


def _swatch(m: Material) -> Markup:
    rgb = ",".join(str(round(255 * min(max(c, 0.0), 1.0) ** (1 / 2.2))) for c in m.base_color)
    kind = f"metallic {m.metallic:g}, roughness {m.roughness:g}"
    kind += f", coat {m.clearcoat:g}" if m.clearcoat else ""
    kind += f", crinkle {m.crinkle:g}" if m.crinkle else ""
    return element("li", element("i", style=f"background:rgb({rgb})"), m.name, title=kind)


ABOUT = (
    "Drawn by the renderer that makes the images, the Sun behind the camera and a little light from the other side. "
    "Blue: what can be seen of the wireframe. Orange: keypoints, those that the craft hides as rings."
)

STYLE = """
body{background:#111}h2{margin:2.5rem 0 0}
.gallery{gap:6px;margin-bottom:6px}.gallery>img{width:100%;min-width:0;display:block;background:#000}
.gallery figure{background:none;border:0;border-radius:0}.gallery figcaption{padding:2px 0}
table{width:auto;background:none;border:0;margin:.5rem 0}
td,th{border:0;padding:1px 1rem 1px 0;text-align:left;font-size:15px}
th{font-weight:400;color:var(--dim)}
ul{list-style:none;padding:0;display:flex;flex-wrap:wrap;gap:4px 14px;font-size:13px}
i{display:inline-block;width:14px;height:14px;margin-right:5px;vertical-align:-2px;border:1px solid #444}
"""
