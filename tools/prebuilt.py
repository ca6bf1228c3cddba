"""Make ``assets/prebuilt``: the cache entries that take longest to compute at the first start of the standard scenes.

`python -m tools.prebuilt` renames an entry if only the source of its maker has changed, and replaces it if its output
has changed.
"""

from __future__ import annotations

import dataclasses
import io
import os
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np
import zstandard

from flyaround.simulator.baking.baked_mesh import unpack_geometry
from flyaround.simulator.baking.mesh_edges import edge_gaps
from flyaround.simulator.baking.radiance_transfer import visibility_to_ship
from flyaround.simulator.celestial.air_tables import air_tables
from flyaround.simulator.render.craft.mesh import merge_parts
from flyaround.simulator.runtime.cache import read_checked
from flyaround.simulator.runtime.prebuilt import SUFFIX, without_prebuilt
from flyaround.simulator.targets.library import load_target

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

FOLDER = Path(__file__).parents[1] / "assets" / "prebuilt"
TARGET = "tango"
_LEVEL = 22  # zstd level of the smallest files


def made() -> Iterator[tuple[str, bytes]]:
    """Yield names and contents of the files; each is computed anew from the shipped versions of the others."""
    yield from _kept(lambda: [air_tables(bands, 100e3) for bands in ("mono", "rgb")], "*.npy").items()
    target = load_target(TARGET)
    yield from _kept(lambda: merge_parts(target), "*.npy").items()
    geometry = merge_parts(target)[0]
    yield from _kept(lambda: edge_gaps(geometry.edges), "*.npy").items()
    key, codes = visibility_to_ship(geometry)
    data = io.BytesIO()
    np.save(data, codes)
    yield f"{key}.npy", data.getvalue()


def _kept(make: Callable[[], object], pattern: str) -> dict[str, bytes]:
    """Return the files that a function writes into an empty cache."""
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


def agree(name: str, one: bytes, other: bytes) -> bool:
    """Return True if two files agree within the rounding errors of different processors."""
    a, b = (np.load(io.BytesIO(data)) for data in (one, other))
    if name.startswith("geometry"):
        pairs = zip(_arrays(unpack_geometry(a)), _arrays(unpack_geometry(b)), strict=True)
        # a micrometre, and 1e-6 of a unit normal
        return all(x.shape == y.shape and np.allclose(x, y, rtol=1e-5, atol=1e-6) for x, y in pairs)
    if a.shape != b.shape or a.dtype != b.dtype:
        return False
    if name.startswith("visibility"):
        # a ray through an edge may hit either side of it, and the patch that it hits there depends on the processor:
        # Embree and the exact grid differ in 2 of 1,000 directions being open and in 35 patches. The effect on the
        # picture is measured by tests/simulator/baking/test_prebuilt_pictures.py
        looked, is_open = ((a == 0) != (b == 0)).mean(), ((a == 1) != (b == 1)).mean()
        return bool(looked < 1e-3 and is_open < 0.01 and (a != b).mean() < 0.08)
    return np.allclose(a, b, rtol=1e-4, atol=1e-6)


def _arrays(node: object) -> Iterator[NDArray[np.generic]]:
    if isinstance(node, np.ndarray):
        yield node
    elif isinstance(node, tuple):
        yield from (array for one in node for array in _arrays(one))
    elif dataclasses.is_dataclass(node):
        yield from _arrays(tuple(getattr(node, field.name) for field in dataclasses.fields(node)))


def main() -> None:
    """Write new and changed files, and remove those that are no longer used."""
    FOLDER.mkdir(exist_ok=True)
    # the checksum detects a flipped bit
    compressor = zstandard.ZstdCompressor(level=_LEVEL, write_checksum=True)
    # file names are a kind and a hash of inputs and sources
    old = {file.name.rpartition("-")[0]: file for file in FOLDER.glob(f"*{SUFFIX}")}
    names = set()
    for name, data in made():
        file, former = FOLDER / (name + SUFFIX), old.get(name.rpartition("-")[0])
        names.add(file)
        if former is not None and agree(name, zstandard.decompress(former.read_bytes()), data):
            former.rename(file)
            continue
        file.write_bytes(compressor.compress(data))
    for file in set(FOLDER.glob(f"*{SUFFIX}")) - names:
        file.unlink()


if __name__ == "__main__":
    main()
