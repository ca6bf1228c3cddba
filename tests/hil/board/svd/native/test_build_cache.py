"""Compiled kernels that are cached: used as they were written alone, and only from a folder that is the user's own."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from flyaround.hil.board.svd.native import backend, compiler, library_cache

STEM = "kernels-0"
MARKED = """
#include <stdio.h>
#include <stdlib.h>
__attribute__((constructor)) static void run(void) { FILE *f = fopen(getenv("MARK"), "w"); if (f) fclose(f); }
int number(void) { return 7; }
"""

pytestmark = pytest.mark.skipif(
    sys.platform == "win32" or shutil.which("cc") is None, reason="needs a C compiler, and owners of folders"
)


@pytest.fixture(scope="module")
def planted(tmp_path_factory) -> Path:
    """A library that leaves a mark where it is loaded."""
    folder = tmp_path_factory.mktemp("planted")
    (folder / "a.c").write_text(MARKED)
    subprocess.run(["cc", "-shared", "-fPIC", "-o", folder / "a.so", folder / "a.c"], check=True)
    return folder / "a.so"


@pytest.fixture
def mark(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv("MARK", str(tmp_path / "mark"))
    return tmp_path / "mark"


def put(planted: Path, folder: Path, stem: str = STEM) -> Path:
    folder.mkdir(mode=0o700, exist_ok=True)
    library_cache.store(planted, folder, stem)
    (file,) = folder.iterdir()
    return file


def load(folder: Path):
    with library_cache.own_folder(folder) as at:
        return None if at is None else library_cache.load_cached(at, STEM)


def test_what_was_kept_is_loaded_and_what_was_changed_is_not(planted, mark, tmp_path, caplog):
    folder, whole = tmp_path / "kernels", planted.read_bytes()
    file = put(planted, folder)
    assert load(folder).number() == 7
    assert mark.exists()
    mark.unlink()
    rng = np.random.default_rng(5)
    flips = [
        bytes(b ^ (1 << int(rng.integers(8))) if k == at else b for k, b in enumerate(whole))
        for at in rng.integers(0, len(whole), 8)
    ]
    for damaged in (b"", whole[:1], whole[: len(whole) // 2], whole[:-1], whole + b"\0", *flips):
        # in a new file: the first one is loaded
        file.unlink(missing_ok=True)
        file.write_bytes(damaged)
        file.chmod(0o600)
        assert load(folder) is None
        assert not mark.exists()
        assert not file.exists()
    assert "compiled again" in caplog.text


@pytest.mark.parametrize("mode", [0o777, 0o775, 0o1777, 0o702])
def test_an_own_folder_that_others_may_write_to_is_closed_to_them_and_used(
    planted, mark, tmp_path, caplog, mode
):
    """As a umask of 002 has made it."""
    folder = tmp_path / "kernels"
    put(planted, folder)
    folder.chmod(mode)
    assert load(folder).number() == 7
    assert folder.stat().st_mode & 0o7777 == 0o700
    assert not caplog.text


def test_nothing_is_loaded_that_others_may_have_written_nor_through_a_link(planted, mark, tmp_path, caplog):
    folder = tmp_path / "kernels"
    file = put(planted, folder)
    folder.chmod(0o777)
    file.chmod(0o622)
    assert load(folder) is None
    put(planted, folder)
    (tmp_path / "elsewhere").symlink_to(folder)
    folder.chmod(0o777)
    assert load(tmp_path / "elsewhere") is None
    assert folder.stat().st_mode & 0o777 == 0o777
    assert not mark.exists()
    assert "no folder" in caplog.text


def test_a_folder_that_cannot_be_closed_to_others_is_not_used(tmp_path, caplog, monkeypatch):
    (tmp_path / "kernels").mkdir()
    (tmp_path / "kernels").chmod(0o777)
    monkeypatch.setattr(library_cache.os, "fchmod", lambda *_: None)  # as on a disk without modes
    assert load(tmp_path / "kernels") is None
    assert "may be written to by others" in caplog.text


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root may give files away")
def test_nothing_is_loaded_that_another_user_planted(planted, mark, tmp_path, caplog):
    folder = tmp_path / "kernels"
    file = put(planted, folder)
    os.chown(file, 65534, -1)
    assert load(folder) is None
    put(planted, folder)
    os.chown(folder, 65534, -1)
    assert load(folder) is None
    assert not mark.exists()
    assert "is another user's" in caplog.text


def test_a_folder_that_changes_places_after_the_check_is_not_looked_into(planted, mark, tmp_path):
    if not library_cache.HELD.is_dir():
        pytest.skip("no folder can be held open by name here")
    folder = tmp_path / "kernels"
    folder.mkdir(mode=0o700)
    with library_cache.own_folder(folder) as at:
        folder.rename(tmp_path / "away")
        put(planted, folder)
        assert library_cache.load_cached(at, STEM) is None
    assert not mark.exists()


def test_a_folder_of_our_own_is_for_us_alone(tmp_path):
    before = os.umask(0)
    try:
        with library_cache.own_folder(tmp_path / "deep" / "kernels") as at:
            assert at is not None
    finally:
        os.umask(before)
    assert (tmp_path / "deep" / "kernels").stat().st_mode & 0o777 == 0o700


def test_where_nothing_can_be_kept_kernels_are_compiled_and_used_all_the_same(choose, tmp_path, monkeypatch):
    """A cache that is a file, and one that is a symbolic link."""
    small = (tmp_path / "small.c", "int one(void) { return 1; }\n")
    small[0].write_text(small[1])
    monkeypatch.setattr(compiler, "SOURCES", ("small.c",))
    monkeypatch.setattr(compiler.pkgutil, "get_data", lambda *_: small[1].encode())
    choose.setenv("FLYAROUND_KERNELS", "native")
    (tmp_path / "file").write_text("")
    (tmp_path / "away").mkdir()
    (tmp_path / "link").mkdir()
    (tmp_path / "link" / "kernels").symlink_to(tmp_path / "away")
    for cache in ("file", "link"):
        choose.setenv("FLYAROUND_CACHE_DIR", str(tmp_path / cache))
        backend._loaded.cache_clear()
        handle = backend.native_library()
        assert handle is not None
        assert handle.one() == 1
    assert not list((tmp_path / "away").iterdir())
