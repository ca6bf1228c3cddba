"""The cache's files: found whole, or found out; and never the end of a program."""

import errno
import os
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from programs import completed

from flyaround.simulator.runtime import cache
from flyaround.simulator.runtime.cache import (
    DamagedError,
    cache_folder,
    map_checked,
    read_checked,
    store_checked,
)
from flyaround.simulator.runtime.cached_arrays import cached_array, entry_of

CONTENTS = bytes(range(256)) * 20


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("FLYAROUND_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache"


def damages(whole, rng, flips=20):
    """A file emptied, cut short at random, made longer, with bits flipped at random."""
    yield b""
    yield b"\0" * len(whole)
    yield whole + b"\0"
    for at in rng.integers(1, len(whole), flips).tolist():
        yield whole[:at]
        flipped = bytearray(whole)
        flipped[at] ^= 1 << int(rng.integers(8))
        yield bytes(flipped)
    flipped = bytearray(whole)
    flipped[0] ^= 1
    flipped[-1] ^= 128
    yield bytes(flipped)


def test_every_damage_of_a_file_is_found_out(folder, caplog):
    path = folder / "part" / "a.bin"
    assert read_checked(path) is None
    assert not caplog.text
    assert store_checked(path, lambda file: file.write(CONTENTS))
    assert read_checked(path) == CONTENTS
    whole = path.read_bytes()
    for data in damages(whole, np.random.default_rng(1), 200):
        path.write_bytes(data)
        assert read_checked(path) is None
    assert "computed again" in caplog.text
    path.write_bytes(whole)
    assert read_checked(path) == CONTENTS


def test_a_file_of_nothing_is_a_file(folder):
    assert store_checked(folder / "a", lambda file: None)
    assert read_checked(folder / "a") == b""


def test_words_swapped_within_a_file_are_found_out(folder):
    """What a sum would not see."""
    path = folder / "a"
    store_checked(path, lambda file: file.write(CONTENTS))
    whole = path.read_bytes()
    path.write_bytes(whole[8:16] + whole[:8] + whole[16:])
    assert read_checked(path) is None


@pytest.mark.parametrize(
    "array",
    [
        np.arange(60, dtype=np.float32).reshape(3, 4, 5),
        np.asfortranarray(np.arange(12).reshape(3, 4)),
        np.zeros((0, 3)),
        np.array(2.5),
        np.zeros(4, [("a", "<f4", 3), ("b", "u1")]),
    ],
)
def test_arrays_come_back_as_they_were(folder, array):
    for kept in (cached_array("a", lambda: array), cached_array("a", lambda: None)):
        assert kept.dtype == array.dtype
        assert kept.shape == array.shape
        assert kept.tobytes("A") == array.tobytes("A")
        assert not kept.flags.writeable
        assert kept.flags.f_contiguous == array.flags.f_contiguous
        assert entry_of(kept) == "a"
    assert entry_of(array) is None
    assert np.array_equal(np.load(folder / "a.npy"), array)  # other programs read it too


def test_a_damaged_array_is_made_again_whatever_the_damage(folder):
    def make():
        made.append(1)
        return np.arange(300.0)

    path = folder / "a.npy"
    made = []
    cached_array("a", make)
    whole = path.read_bytes()
    for k, data in enumerate(damages(whole, np.random.default_rng(2))):
        path.write_bytes(data)
        assert np.array_equal(cached_array("a", make), np.arange(300.0))
        assert len(made) == k + 2
        assert path.read_bytes() == whole
    # sound, but no array
    for text in (b"", b"no array", b"\x93NUMPY\x01\x00\x06\x00{'a':\n", whole[:-48]):
        assert store_checked(path, lambda file, text=text: file.write(text))
        assert np.array_equal(cached_array("a", make), np.arange(300.0))
        assert path.read_bytes() == whole


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS, errno.EACCES, errno.EDQUOT, errno.EIO])
def test_a_disk_that_takes_nothing_costs_time_alone(folder, monkeypatch, caplog, number):
    def refuse(*_, **__):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(cache.tempfile, "NamedTemporaryFile", refuse)
    assert cached_array("a", lambda: np.arange(3)).tolist() == [0, 1, 2]
    assert os.strerror(number) in caplog.text


FULL = """
import resource, signal, sys
import numpy as np
from flyaround.simulator.runtime.cached_arrays import cached_array
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))  # a write beyond it fails halfway, as on a full disk
assert len(cached_array("large", lambda: np.arange(5000.0))) == 5000
assert len(cached_array("small", lambda: np.arange(5.0))) == 5
"""


@pytest.mark.skipif(sys.platform == "win32", reason="needs limits of a process")
def test_a_disk_that_fills_up_halfway_leaves_no_halves(folder):
    done = completed(sys.executable, "-c", FULL, check=True)
    assert done.stderr.count("cannot keep") == 1
    assert {path.name for path in folder.rglob("*") if path.is_file()} == {"small.npy"}


def test_one_folder_for_all_that_is_kept(folder, monkeypatch):
    assert cache_folder() == folder
    assert cache_folder("part") == folder / "part"
    monkeypatch.delenv("FLYAROUND_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", "/nowhere")
    if sys.platform == "linux":
        assert cache_folder() == Path("/nowhere/flyaround")


def test_looking_at_a_file_changes_nothing_of_it(folder):
    store_checked(folder / "a", lambda file: file.write(b"b"))
    mapped, length = map_checked(folder / "a")
    assert mapped[:length] == b"b"
    (folder / "a").write_bytes(b"")
    with pytest.raises(DamagedError):
        map_checked(folder / "a")


def test_what_a_killed_program_left_is_forgotten_after_a_day(folder):
    folder.mkdir()
    left, fresh, other = (folder / name for name in ("tmpleft.tmp", "tmpnow.tmp", "tango.glb"))
    for path in (left, fresh, other):
        path.write_bytes(b"half")
    for path in (left, other):
        os.utime(path, (time.time() - 2 * 86_400,) * 2)
    assert store_checked(folder / "new.glb", lambda file: file.write(CONTENTS))
    assert not left.exists()
    assert fresh.exists()
    assert other.exists()
