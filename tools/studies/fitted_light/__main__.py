"""Write a page and fit.json that compare a folder's images with renderings at their poses under fitted light."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.compare.references import read_references
from flyaround.simulator.errors import UserError
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.runtime.files import empty_folder
from flyaround.simulator.targets.library import load_target
from tools.studies.fitted_light.page import write_fitted
from tools.studies.fitted_light.pairs import check_pictures, fit_pictures

if TYPE_CHECKING:
    from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> int:
    """Fit the light of each image and write the page; return 2 after a one-sentence message if an image is unusable."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--poses", required=True, type=Path, help="poses of the images in SPEED's format")
    parser.add_argument("-o", "--output", required=True, type=Path, help="new or empty folder")
    parser.add_argument("-n", type=int, default=16, help="maximum number of images, evenly over the folder")
    parser.add_argument("--target", default="tango")
    parser.add_argument("--camera", default="speed")
    parser.add_argument(
        "--fit-materials", action="store_true", help="also fit the materials, on every second image"
    )
    options = parser.parse_args(arguments)
    try:
        camera, target = load_camera(options.camera), load_target(options.target)
        references = read_references(options.folder, camera, options.n, options.poses)
        check_pictures(references, camera)
        empty_folder(options.output)
    except UserError as error:
        print(error, file=sys.stderr)
        return 2
    with Renderer() as renderer:
        fitted, factors = fit_pictures(renderer, references, target, materials=options.fit_materials)
    write_fitted(
        options.output, fitted, factors, f"{len(fitted)} pictures of {options.folder.resolve().name}"
    )
    print(f"page: {options.output / 'index.html'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
