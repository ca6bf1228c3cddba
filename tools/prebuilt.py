"""Makes ``assets/prebuilt``: the cache entries that a first start of the standard scenes would take longest for.

`python -m tools.prebuilt` makes it again, where the output of a maker has changed and its version was raised.
"""

from __future__ import annotations

import io
import os
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from flyaround.simulator.baking.mesh_edges import edge_gaps
from flyaround.simulator.baking.radiance_transfer import visibility_to_ship
from flyaround.simulator.celestial.air_tables import air_tables
from flyaround.simulator.render.craft.mesh import prepared
from flyaround.simulator.runtime.cache import read_checked
from flyaround.simulator.runtime.prebuilt import SUFFIX, without_prebuilt
from flyaround.simulator.targets.library import load_target

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

FOLDER = Path(__file__).parents[1] / "assets" / "prebuilt"
TARGET = "tango"
_LEVEL = 22  # of zstd: the smallest


def made() -> Iterator[tuple[str, bytes]]:
    """Names and contents of the files; each is made anew, from what is shipped of the others."""
    yield from _kept(lambda: [air_tables(bands, 100e3) for bands in ("mono", "rgb")], "*.npy").items()
    target = load_target(TARGET)
    yield from _kept(lambda: prepared(target), "*.npy").items()
    geometry = prepared(target)[0]
    yield from _kept(lambda: edge_gaps(geometry.edges), "*.npy").items()
    key, codes = visibility_to_ship(geometry)
    data = io.BytesIO()
    np.save(data, codes)
    yield f"{key}.npy", data.getvalue()


def _kept(make: Callable[[], object], pattern: str) -> dict[str, bytes]:
    """Files that an empty cache holds when something has been made."""
    chosen = os.environ.get("FLYAROUND_CACHE_DIR")
    with TemporaryDirectory() as folder:
        os.environ["FLYAROUND_CACHE_DIR"] = folder
        try:
            with without_prebuilt():
                make()
            files = ((path.name, read_checked(path)) for path in sorted(Path(folder).glob(pattern)))
            return {name: data for name, data in files if data is not None}
        finally:
            if chosen is None:
                del os.environ["FLYAROUND_CACHE_DIR"]
            else:
                os.environ["FLYAROUND_CACHE_DIR"] = chosen


def main() -> None:
    """Write what is missing, and remove what is no longer asked for."""
    import zstandard  # noqa: PLC0415 - the rest of the module is for tests too

    FOLDER.mkdir(exist_ok=True)
    current = set()
    # the checksum tells who reads it of a flipped bit
    compressor = zstandard.ZstdCompressor(level=_LEVEL, write_checksum=True)
    for name, data in made():
        current.add(name + SUFFIX)
        file, packed = FOLDER / (name + SUFFIX), compressor.compress(data)
        if not file.is_file() or file.read_bytes() != packed:
            file.write_bytes(packed)
    for file in FOLDER.glob(f"*{SUFFIX}"):
        if file.name not in current:
            file.unlink()


if __name__ == "__main__":
    main()
