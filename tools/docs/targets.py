"""Make docs/targets.md and its images, one of each built-in craft: `python -m tools.docs.targets`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.contact_sheets.target_views import OBLIQUE, draw_labels, draw_view
from flyaround.simulator.contact_sheets.targets_page import facts
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.reports.pictures import write_jpeg
from flyaround.simulator.runtime.files import write_atomic
from flyaround.simulator.targets.library import built_in_targets, load_target

if TYPE_CHECKING:
    from collections.abc import Sequence

    from flyaround.simulator.targets.model import Target

TILE = (400, 300)  # size of an image [px]
QUALITY = 80  # of the JPEG files
PICTURES = "images/targets"


def write_docs(targets: Sequence[Target], folder: Path) -> None:
    """Write ``targets.md`` and its images below ``folder``."""
    picture_folder = folder / PICTURES
    picture_folder.mkdir(parents=True, exist_ok=True)
    lines = [INTRODUCTION]
    with Renderer() as renderer:
        for target in targets:
            views = [draw_view(renderer, target, eye, *TILE) for eye in OBLIQUE]
            row = np.concatenate([views[0].image, views[2].image, draw_labels(views[1], target)], axis=1)
            write_jpeg(picture_folder / f"{target.name}.jpg", row, QUALITY)
            lines.append(_section(target))
    write_atomic(folder / "targets.md", "\n".join(lines).encode())


def _section(target: Target) -> str:
    known = facts(target)
    figures = "; ".join(f"{key} {known[key]}" for key in ("size", "mass", "triangles"))
    frames = ", ".join(target.frames) or "none"
    return (
        f"\n## {target.name}\n\n{target.title}.\n\n![{target.name}]({PICTURES}/{target.name}.jpg)\n\n"
        f"{figures}; keypoints {known['keypoints']}; edges {known['edges']}; frames: {frames}.\n\n{target.notes}\n"
    )


INTRODUCTION = """# Targets

Made by `python -m tools.docs.targets`. Left and middle: the craft with the Sun behind the camera and a little light
from the other side. Right: its visible wireframe (blue) and its keypoints (orange; rings where the craft hides them).
`flyaround targets --contact-sheet DIR` makes a larger page, your own targets included.

The format is described in [formats/target.md](formats/target.md); `flyaround targets add FILE` adds a mesh. The pose
estimator knows Tango best: it has a [network](hybrid.md#the-keypoint-network) for seven of these targets, and its
confidence was fitted on Tango. For an added craft [train one](hybrid.md#a-craft-of-your-own), and check the exposure:
`capture` says how much of the craft is burnt out, and proposes an exposure.

Surfaces beside the metal, paint and glass of glTF (`draft` has one scale of creases, no tape and no contacts on
cells):

- Foil (a material with `crinkle` and metalness): curved facets of 2 mm to 13 cm (`high`: from 0.5 mm) with sharp
  creases between them (Andresen et al. 2007), and tape along seams. Three tenths of the light go into the wide lobe of
  creases below a millimetre. Facets below a pixel widen the lobe by the variance of their slopes (Olano & Baker 2010).
- Its colour is that of the metal seen through its film: gold absorbs 0.37 of visible sunlight (aluminised Kapton,
  film outside: 0.40 of all sunlight), silver 0.26 (aluminised FEP 0.16 when new; both Fortescue et al. 2011, table
  11.3).
- Cells and lenses (dark under polished glass): Fresnel reflection of cover glass with a quarter wave of magnesium
  fluoride, and of the cell with one of titanium oxide (Macleod 2010, section 2.6; indices are ours): blue, violet at a
  slant, white at grazing.
- Cells in a lattice: no two alike in tilt (0.2 deg) and film; two busbars, and fingers, to their share of a pixel.
- Backs of panels: reflectance that differs by some hundredths over decimetres, joints every 0.4 m. `high` also wears
  paint and metal of the built-in craft, by name: uneven gloss, fasteners beside joints, tape around rods (ours).

`python -m tools.validation.outline PICTURE --side=+y [--target NAME] [--outline FILE.json] [-o OUT.png]` compares a
target with a picture of the real craft: it fits pose and focal length to the outline and prints the overlap of the
filled outlines, intersection over union. Tango beside six public pictures 1200 pixels wide: panel 0.985, bottom
0.981, -y 0.984, +y 0.975, +x 0.971, -x 0.963; outlines lie 1 px apart in the median (1.5 mm)."""

if __name__ == "__main__":
    write_docs([load_target(name) for name in built_in_targets()], Path(__file__).parents[2] / "docs")
