"""Files that outlast a loss of power, batches of them, and a disk that is full."""

import errno
import hashlib
import os
import subprocess
import time
from pathlib import Path

import pytest

from flyaround.simulator.dataset.storage import space
from flyaround.simulator.dataset.storage.batches import FrameBatches, FrameFiles
from flyaround.simulator.dataset.storage.manifest import (
    MANIFEST_NAME,
    manifest_lines,
    read_manifest,
    rewrite_manifest,
    sort_manifest,
)
from flyaround.simulator.dataset.storage.store import FolderStore
from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime import files
from flyaround.simulator.runtime.files import write_durable


def _frame(k, size=100):
    named = [(f"images/{k:06d}{end}", bytes([k]) * size) for end in (".png", ".mask.png", ".json")]
    return FrameFiles(named[:-1], named[-1], manifest_lines(named))


def _add_all(store, frames, **limits):
    with FrameBatches(store, **limits) as batches:
        for frame in frames:
            batches.add(frame)


def test_nothing_has_its_name_before_all_of_the_batch_is_on_the_disk(tmp_path, monkeypatch):
    happened = []
    monkeypatch.setattr(files, "_fsync_file", lambda path: happened.append(("disk", path.suffix)))
    rename = Path.replace
    monkeypatch.setattr(
        Path, "replace", lambda self, to: (happened.append(("name", to.name)), rename(self, to))[1]
    )
    write_durable([(tmp_path / name, b"x") for name in ("a.png", "b.png", "a.json")])
    assert happened == [("disk", ".part")] * 3 + [("name", "a.png"), ("name", "b.png"), ("name", "a.json")]


@pytest.mark.parametrize("again", [False, True])
def test_a_folder_that_is_moved_away_meanwhile_is_not_made_again_behind_the_users_back(tmp_path, again):
    folder = tmp_path / "set"
    folder.mkdir()
    store = FolderStore(folder)
    store.write([("images/a", b"x")])
    folder.rename(tmp_path / "elsewhere")
    if again:
        folder.mkdir()  # another of the same name is not it either
    for write in (lambda: store.write([("b", b"x")]), lambda: store.append("c", b"x")):
        with pytest.raises(UserError, match="moved or removed"):
            write()
    assert not folder.exists() or not list(folder.iterdir())


def test_a_disk_that_is_full_says_so_and_leaves_nothing_half_written(tmp_path, monkeypatch):
    real = os.fsync

    def full(handle):
        if len(list(tmp_path.glob(files.PART_FILES))) == 3:
            raise OSError(errno.ENOSPC, "No space left on device")
        real(handle)

    monkeypatch.setattr(files.os, "fsync", full)
    with pytest.raises(UserError, match="no space left on its disk"):
        write_durable([(tmp_path / name, b"x") for name in ("a", "b", "c")])
    assert list(tmp_path.iterdir()) == []


def test_batches_write_every_frame_and_its_lines(tmp_path):
    store = FolderStore(tmp_path)
    with FrameBatches(store, max_bytes=700) as batches:
        for k in range(5):
            batches.add(_frame(k))
    manifest = read_manifest(store)
    assert sorted(manifest) == list(range(5))
    assert all(
        hashlib.sha256((tmp_path / name).read_bytes()).hexdigest() == digest
        for k in manifest
        for name, digest in manifest[k].items()
    )
    done = subprocess.run(["sha256sum", "-c", "--quiet", MANIFEST_NAME], cwd=tmp_path, check=False)
    assert done.returncode == 0


def test_frames_are_on_the_disk_within_a_time(tmp_path):
    with FrameBatches(FolderStore(tmp_path), max_s=0.05) as batches:
        batches.add(_frame(0))
        time.sleep(0.06)
        batches.add(_frame(1))
        # the first `add` after the wait sends the batch to the thread that writes
        until = time.monotonic() + 60
        while not (tmp_path / "images/000001.json").exists() and time.monotonic() < until:
            time.sleep(0.01)
        assert sorted(read_manifest(FolderStore(tmp_path))) == [0, 1]


def test_an_error_elsewhere_keeps_the_frames_and_an_error_of_the_disk_is_told(tmp_path):
    store = FolderStore(tmp_path)

    def broken_off():
        yield _frame(0)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        _add_all(store, broken_off())
    assert sorted(read_manifest(store)) == [0]

    class Full(FolderStore):
        def write(self, *waves):
            raise UserError("cannot write: no space left on its disk")

    with pytest.raises(UserError, match="no space"):
        _add_all(Full(tmp_path), (_frame(k) for k in range(1, 4)), max_bytes=1)
    # lines come before names: those of the frame that was not written are there, and no later ones
    assert sorted(read_manifest(store)) == [0, 1]
    assert not store.exists("images/000001.json")


def test_a_torn_last_line_and_nonsense_are_left_out(tmp_path):
    store = FolderStore(tmp_path)
    text = _frame(3).lines + _frame(1).lines
    (tmp_path / MANIFEST_NAME).write_bytes(b"\xff nonsense\n../../etc/passwd\n" + text[:-20])
    found = read_manifest(store)
    assert sorted(found) == [1, 3]
    assert "images/000001.json" not in found[1]
    sort_manifest(store)
    assert list(read_manifest(store)) == [1, 3]
    rewrite_manifest(store, {3: found[3]})
    assert (tmp_path / MANIFEST_NAME).read_bytes() == _frame(3).lines


def test_too_little_room_is_said_with_both_figures(tmp_path, monkeypatch):
    store = FolderStore(tmp_path)
    monkeypatch.setattr(FolderStore, "free_bytes", lambda _: 12_000_000_000)
    space.require_disk_space(store, 1000, 2_400_000)
    with pytest.raises(
        UserError, match=r"10,000 frames take about 24\.0 GB and the disk of .* has 12\.0 GB left"
    ):
        space.require_disk_space(store, 10_000, 2_400_000)
    monkeypatch.setattr(FolderStore, "free_bytes", lambda _: None)
    space.require_disk_space(store, 10_000, 2_400_000)
