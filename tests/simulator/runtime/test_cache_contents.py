"""The cache's contents: kinds, size limit, removal."""

import os
import time

import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.cache import entry_name
from flyaround.simulator.runtime.cache_contents import RECENT_USE_S, cache_kinds, clear_cache, trim_cache


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("FLYAROUND_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv("FLYAROUND_CACHE_MB", "1")
    return tmp_path


def entry(folder, name, size, unused_s):
    path = folder / name
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(bytes(size))
    then = time.time() - unused_s
    os.utime(path, (then, then))
    return path


def test_the_least_recently_used_go_until_the_cache_is_under_its_size(folder):
    old = entry(folder, "maps-v1-a.npy", 600_000, 3 * RECENT_USE_S)
    newer = entry(folder, "board-models/faces.json", 600_000, 2 * RECENT_USE_S)
    trim_cache()
    assert not old.exists()
    assert newer.exists()


def test_entries_in_use_stay_whatever_their_size(folder):
    kept = [entry(folder, f"maps-v1-{k}.npy", 900_000, RECENT_USE_S / 2) for k in range(3)]
    trim_cache()
    assert all(path.exists() for path in kept)


def test_kinds_are_counted_largest_first(folder):
    entry(folder, f"{entry_name('maps', (), 1)}.npy", 10, 0)
    entry(folder, f"{entry_name('maps', (), 2)}.npy", 10, 0)
    entry(folder, f"{entry_name('edge-gaps', ())}.npy", 50, 0)
    entry(folder, "board-models/faces.json", 5, 0)
    found = [(kind.name, kind.files, kind.size_bytes) for kind in cache_kinds()]
    assert found == [("edge-gaps", 1, 50), ("maps", 2, 20), ("board-models", 1, 5)]


def test_clearing_removes_the_cache_s_own_files_alone(folder, tmp_path_factory):
    entry(folder, "maps-v1-a.npy", 10, 0)
    entry(folder, "board-models/faces.json", 5, 0)
    mine = [entry(folder, "thesis.pdf", 7, 0), entry(folder, "photos/a.npy", 7, 0)]
    outside = entry(tmp_path_factory.mktemp("outside"), "a.glb", 7, 0)
    (folder / "board-models" / "link.json").symlink_to(outside)
    assert clear_cache() == 15
    assert cache_kinds() == []
    assert all(path.exists() for path in (*mine, outside))


@pytest.mark.parametrize("text", ["many", "-1", "3.5", "1e3", "9" * 12])
def test_a_size_that_is_no_number_is_refused(folder, monkeypatch, text):
    monkeypatch.setenv("FLYAROUND_CACHE_MB", text)
    with pytest.raises(UserError, match="FLYAROUND_CACHE_MB"):
        trim_cache()
