"""Make the maps of assets/earth that are derived from other maps: `python -m tools.cook`.

Run it after a change of the day map, of the clouds or of the coast (`tools.cook.coast`).
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np

from flyaround.simulator.celestial.earth_albedo import ALBEDO
from flyaround.simulator.celestial.earth_maps import TERRAIN, packed_maps
from flyaround.simulator.celestial.ocean_colour import MAPS, MASK
from flyaround.simulator.celestial.seasons import LAND
from tools.cook.ocean_colour import day_and_coast, make_mask, make_ocean_colour
from tools.cook.reduced_maps import land_of_months, make_albedo
from tools.cook.terrain import make_terrain_detail

if TYPE_CHECKING:
    from collections.abc import Iterator

    from flyaround.simulator.runtime.arrays import ByteArray, Float32Array

FOLDER = Path(__file__).parents[2] / "assets" / "earth"


def cooked() -> Iterator[tuple[str, ByteArray | Float32Array]]:
    """Yield names and contents of the files: images as arrays of pixels for OpenCV, arrays unchanged."""
    sources = day_and_coast()
    mask = make_mask(sources)
    yield MASK, mask
    for bands, name in MAPS.items():
        image = make_ocean_colour(bands, mask > 0, sources)
        yield name, image if bands == 1 else image[..., ::-1]
    texture = packed_maps(1)[0]
    yield LAND, land_of_months(texture)
    yield ALBEDO, np.stack([make_albedo(texture, clouds=clouds) for clouds in (False, True)])
    yield TERRAIN, make_terrain_detail()


def file_bytes(name: str, content: ByteArray | Float32Array) -> bytes:
    """Return the bytes of a file."""
    if name.endswith(".npy"):
        data = io.BytesIO()
        np.save(data, content)
        return data.getvalue()
    flag = cv2.IMWRITE_PNG_BILEVEL if name in {MASK, LAND} else cv2.IMWRITE_PNG_COMPRESSION
    return cv2.imencode(".png", content, [flag, 1 if flag == cv2.IMWRITE_PNG_BILEVEL else 9])[1].tobytes()


if __name__ == "__main__":
    for name, content in cooked():
        (FOLDER / name).write_bytes(file_bytes(name, content))
        print(name)
