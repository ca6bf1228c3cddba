"""The files of assets/targets are those that tools/craft builds now, and each matches its own hash."""

import numpy as np
import pytest
import zstandard
from numpy._core._multiarray_umath import __cpu_features__

from flyaround.simulator.targets.glb.read import target_from
from flyaround.simulator.targets.library import SUFFIX
from tools.craft.__main__ import BUILDERS, FOLDER, built_files

# NumPy's sines, by which the files were made; other processors round the last bit of some otherwise
MADE_WITH = "AVX512_SKX"
CHEAP = ("chessboard", "cubesat-1u")


def shipped(level):
    return zstandard.decompress((FOLDER / (level + SUFFIX)).read_bytes())


def close(a, b):
    """Whether two targets have the same parts, and corners a micrometre apart at most."""
    return [(p.name, p.material) for p in a.parts] == [(p.name, p.material) for p in b.parts] and all(
        np.array_equal(p.triangles, q.triangles)
        and np.allclose(p.positions_m, q.positions_m, rtol=0, atol=1e-6)
        for p, q in zip(a.parts, b.parts, strict=True)
    )


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[] if n in CHEAP else pytest.mark.slow) for n in BUILDERS]
)
def test_what_is_built_is_what_is_shipped(name, tmp_path):
    for level, data in built_files(name):
        if data == shipped(level):
            continue
        assert not __cpu_features__.get(MADE_WITH), f"{level} has changed: run python -m tools.craft {name}"
        assert close(*(target_from(d, tmp_path / level, checked=True) for d in (data, shipped(level))))


def test_every_file_is_of_a_builder_and_sound():
    levels = {path.name.removesuffix(SUFFIX) for path in FOLDER.iterdir()}
    assert levels == {name + level for name in BUILDERS for level in ("", "@medium", "@low")}
    for level in levels:
        assert target_from(shipped(level), FOLDER / level).name == level
        assert zstandard.get_frame_parameters((FOLDER / (level + SUFFIX)).read_bytes()).has_checksum
    assert sum(path.stat().st_size for path in FOLDER.iterdir()) < 6e6
