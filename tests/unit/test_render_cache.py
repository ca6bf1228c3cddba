"""The cache folder: what is kept, made again, forgotten."""

import os
import time

import numpy as np
import pytest

from simulator.render.cache import KEPT_DAYS, cache_bytes, cached_array


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("FLYAROUND_CACHE_DIR", str(tmp_path))
    return tmp_path


def refuse():
    raise AssertionError


def age(path, days):
    then = time.time() - days * 86400
    os.utime(path, (then, then))


def test_an_array_is_made_once_and_again_where_its_file_is_damaged(folder):
    assert cached_array("a", lambda: np.arange(5)).tolist() == [0, 1, 2, 3, 4]
    assert cached_array("a", refuse).tolist() == [0, 1, 2, 3, 4]
    (folder / "a.npy").write_bytes(b"half of a file")
    assert cached_array("a", lambda: np.arange(3)).tolist() == [0, 1, 2]
    assert [path.name for path in folder.iterdir()] == ["a.npy"]
    assert cache_bytes() == (folder / "a.npy").stat().st_size


def test_what_nobody_asked_for_in_long_goes_when_something_is_stored(folder):
    for key in ("old", "used"):
        cached_array(key, lambda: np.zeros(2))
        age(folder / f"{key}.npy", KEPT_DAYS + 1)
    (folder / "killed.tmp").write_bytes(b"")
    age(folder / "killed.tmp", KEPT_DAYS + 1)
    cached_array("used", refuse)
    cached_array("new", lambda: np.zeros(2))
    assert {path.name for path in folder.iterdir()} == {"used.npy", "new.npy"}
