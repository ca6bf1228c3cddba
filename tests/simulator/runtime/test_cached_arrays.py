"""The cache folder: what is kept, made again, forgotten."""

import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from flyaround.simulator.runtime.cached_arrays import (
    cached_array,
    cached_arrays,
)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("FLYAROUND_CACHE_DIR", str(tmp_path))
    return tmp_path


def refuse():
    raise AssertionError


def age(path, days):
    then = time.time() - days * 86400
    os.utime(path, (then, then))


def test_what_nobody_asked_for_in_long_goes_when_something_is_stored(folder):
    for key in ("old", "used"):
        cached_array(key, lambda: np.zeros(2))
        age(folder / f"{key}.npy", 91)
    (folder / "killed.tmp").write_bytes(b"")
    age(folder / "killed.tmp", 91)
    cached_array("used", refuse)
    cached_array("new", lambda: np.zeros(2))
    assert {path.name for path in folder.iterdir()} == {"used.npy", "new.npy"}


def test_what_is_being_made_is_waited_for_and_not_made_twice(folder):
    made = []

    def make():
        made.append(1)
        time.sleep(0.2)
        return np.arange(4), np.arange(3)

    with ThreadPoolExecutor(3) as pool:
        all_of = [pool.submit(cached_arrays, ("a", "b"), make) for _ in range(3)]
        assert [[len(x) for x in future.result()] for future in all_of] == [[4, 3]] * 3
    assert len(made) == 1
    assert {path.name for path in folder.iterdir()} == {"a.npy", "b.npy"}


def test_two_programs_make_it_once_and_a_killed_one_is_not_waited_for(folder):
    code = (
        "import sys, time; import numpy as np; from flyaround.simulator.runtime.cached_arrays import cached_array\n"
        "def make(): print('made', flush=True); time.sleep(float(sys.argv[1])); return np.arange(6)\n"
        "cached_array('a', make)"
    )
    both = [
        subprocess.Popen([sys.executable, "-c", code, "0.5"], stdout=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    assert sorted(one.communicate()[0] for one in both) == ["", "made\n"]
    (folder / "a.npy").unlink()
    with subprocess.Popen([sys.executable, "-c", code, "60"], stdout=subprocess.PIPE, text=True) as slow:
        assert slow.stdout is not None
        assert slow.stdout.readline() == "made\n"
        slow.kill()
    assert cached_array("a", lambda: np.arange(2)).tolist() == [0, 1]


def test_a_maker_that_fails_leaves_the_next_one_free(folder):
    with pytest.raises(AssertionError):
        cached_array("a", refuse)
    assert cached_array("a", lambda: np.arange(2)).tolist() == [0, 1]
