"""What is shipped ready made: the same as its makers make now, used by an empty cache, done without where damaged."""

import io
from pathlib import Path

import numpy as np
import pytest
import zstandard

from flyaround.simulator.runtime import prebuilt as shipped
from flyaround.simulator.runtime.cached_arrays import cached_array, is_cached
from tools import prebuilt as ship


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty cache, and a folder of its own for what is shipped."""
    monkeypatch.setenv("FLYAROUND_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(shipped, "_file", lambda name: tmp_path / (name + shipped.SUFFIX))
    return tmp_path


def put(folder, name, data):
    (folder / (name + shipped.SUFFIX)).write_bytes(zstandard.ZstdCompressor().compress(data))


def array_bytes(array):
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def refuse():
    raise AssertionError


def test_what_is_shipped_is_what_is_made_now():
    made = dict(ship.made())
    files = {file.name.removesuffix(shipped.SUFFIX): file for file in ship.FOLDER.glob("*.zst")}
    advice = "name or make it again by `python -m tools.prebuilt`"
    assert files.keys() == made.keys(), advice
    for name, file in files.items():
        data = zstandard.ZstdDecompressor().decompress(file.read_bytes())
        assert ship.agree(name, data, made[name]), f"{name}: {advice}"


def test_all_that_is_shipped_is_small():
    assert sum(Path(file).stat().st_size for file in ship.FOLDER.iterdir()) < 3e6


def test_an_empty_cache_takes_what_is_shipped_and_keeps_it(folder):
    put(folder, "a.npy", array_bytes(np.arange(5)))
    assert is_cached("a")
    assert cached_array("a", refuse).tolist() == [0, 1, 2, 3, 4]
    (folder / "a.npy.zst").unlink()
    assert cached_array("a", refuse).tolist() == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("data", [b"half of a file", zstandard.ZstdCompressor().compress(b"no array")])
def test_what_is_damaged_is_made(data, folder, caplog):
    (folder / "a.npy.zst").write_bytes(data)
    assert cached_array("a", lambda: np.arange(2)).tolist() == [0, 1]
    assert "damaged" in caplog.text


def test_shipped_files_have_checksums():
    for file in ship.FOLDER.glob("*.zst"):
        assert zstandard.get_frame_parameters(file.read_bytes()).has_checksum, file.name


def test_nothing_is_shipped_for_who_makes_it(folder):
    put(folder, "a.npy", array_bytes(np.arange(5)))
    with shipped.without_prebuilt():
        assert not is_cached("a")
        assert cached_array("a", lambda: np.arange(2)).tolist() == [0, 1]
    assert shipped.is_prebuilt("a.npy")
