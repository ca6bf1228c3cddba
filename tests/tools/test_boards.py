"""The emulated board: what is made and asked without QEMU, and, slowly, the loop with it."""

from __future__ import annotations

import itertools
import os
import platform
import shutil
import stat
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from flyaround.hil.board.agent import describe_board
from flyaround.hil.host.frame_record import FrameRecord
from flyaround.hil.host.ledger.frames_csv import LedgerWriter
from flyaround.hil.host.ledger.summary import SUMMARY_JSON, summarise
from flyaround.hil.host.link_process.ipc import Board
from flyaround.hil.link.packets.messages import Hello
from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.load import load_scenario
from tools.boards import debian_image
from tools.boards.agreement import agreement, compare_runs
from tools.boards.debian_image import BoardImage, image_name, is_whole, missing_programs
from tools.boards.emulator import qemu_command
from tools.boards.initramfs import cpio, loading_order
from tools.boards.loops import LINES, SCENARIO, scenario_of


def test_drivers_are_loaded_behind_what_they_need() -> None:
    def module(*needed: str) -> bytes:
        return b"\x7fELF\0license=GPL\0depends=" + ",".join(needed).encode() + b"\0vermagic=6\0"

    modules = {
        "virtio": module(),
        "virtio_ring": module("virtio"),
        "virtio_pci": module("virtio-ring", "virtio"),
        "virtio_blk": module("virtio", "virtio_ring"),
        "unused": module(),
    }
    assert loading_order(modules, ["virtio-blk", "virtio_pci"]) == [
        "virtio",
        "virtio_ring",
        "virtio_blk",
        "virtio_pci",
    ]
    with pytest.raises(FileNotFoundError, match="no driver ext9"):
        loading_order(modules, ["ext9"])


@pytest.mark.skipif(shutil.which("cpio") is None, reason="cpio reads what we write")
def test_the_first_archive_is_one_that_cpio_reads(tmp_path: Path) -> None:
    files = [
        ("dev", stat.S_IFDIR | 0o755, b""),
        ("init", stat.S_IFREG | 0o755, b"#!/busybox sh\n"),
        ("five", stat.S_IFREG | 0o644, b"12345"),
        ("empty", stat.S_IFREG | 0o600, b""),
    ]
    subprocess.run(["cpio", "-id", "--quiet"], input=cpio(files), cwd=tmp_path, check=True)
    for name, mode, content in files:
        path = tmp_path / name
        assert path.stat().st_mode == mode
        assert path.is_dir() or path.read_bytes() == content
    assert len(list(tmp_path.iterdir())) == len(files)


def test_another_recipe_has_another_name(monkeypatch: pytest.MonkeyPatch) -> None:
    name = image_name()
    assert name == image_name()
    monkeypatch.setattr(
        debian_image, "_pinned", lambda: ("numpy==1.24.2", "opencv-python-headless==4.6.0.66")
    )
    older = image_name()
    monkeypatch.setitem(debian_image.FILES, "etc/hostname", "another\n")
    other = image_name()
    monkeypatch.setattr(debian_image, "PACKAGES", (*debian_image.PACKAGES, "vim"))
    assert len({name, older, other, image_name()}) == 4


def test_an_image_that_is_not_as_it_was_made_is_none(tmp_path: Path) -> None:
    image = BoardImage(tmp_path)
    assert not is_whole(image)
    for path in (image.kernel, image.initramfs, image.disk):
        path.write_bytes(path.name.encode())
    (tmp_path / "manifest.json").write_bytes(msgspec.json.encode(debian_image._hashes(image)))
    assert is_whole(image)
    image.disk.write_bytes(b"root.ext5")
    assert not is_whole(image)


def test_what_is_missing_is_named_with_its_package(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(debian_image, "_found", lambda program: None if "qemu" in program else "/usr/bin/x")
    with pytest.raises(UserError, match=r"apt-get install -y --no-install-recommends qemu-system-arm$"):
        missing_programs()
    # and the command ends with that sentence, before anything is fetched
    command = [sys.executable, "-m", "tools.boards", "prove", "-o", str(tmp_path / "out")]
    environment = os.environ | {"PATH": str(tmp_path), "FLYAROUND_CACHE_DIR": str(tmp_path / "cache")}
    told = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert told.returncode == 2, told.stderr
    assert told.stderr.startswith("the emulated board needs Debian packages")
    assert told.stderr.count("\n") == 1


def test_the_emulator_reaches_the_host_and_nobody_the_board() -> None:
    command = qemu_command(BoardImage(Path("/cache/a,b")), Path("/run/job.tar"))
    drives = [word for option, word in itertools.pairwise(command) if option == "-drive"]
    # the disk comes first, is left as it was, and a comma in its name does not end it
    assert drives == [
        "if=none,id=root,format=raw,snapshot=on,file=/cache/a,,b/root.ext4",
        "if=none,id=job,format=raw,readonly=on,file=/run/job.tar",
    ]
    assert "user,id=net" in command
    assert not any("hostfwd" in word or word.startswith("tap") for word in command)


def test_a_line_that_is_slow_has_smaller_pictures(tmp_path: Path) -> None:
    assert scenario_of(LINES["net"], tmp_path) == SCENARIO
    slow = LINES["uart"]
    whole, smaller = load_scenario(slow.scenario), load_scenario(scenario_of(slow, tmp_path))
    assert smaller.camera_model.width_px * slow.binning == whole.camera_model.width_px
    assert msgspec.structs.replace(smaller, sensor=whole.sensor) == whole


def rows(n: int = 40) -> list[FrameRecord]:
    made = []
    for k in range(n):
        row = FrameRecord(
            frame_id=k, epoch_utc="2026-08-20T09:30:00Z", t_s=0.1 * k, exposure_s=0.001, outcome="declined"
        )
        if k % 4:
            row = replace(row, outcome="accepted", q_wxyz=(1.0, 0.0, 0.0, 0.0), t_m=(0.0, 0.0, 10.0))
        made.append(replace(row, board_wait_ms=1.0, board_total_ms=101.0 + k))
    return made


def turned(row: FrameRecord, deg: float, shift_m: float) -> FrameRecord:
    half = np.radians(deg) / 2
    return replace(row, q_wxyz=(np.cos(half), 0.0, np.sin(half), 0.0), t_m=(shift_m, 0.0, 10.0))


def test_agreement_counts_decisions_and_poses() -> None:
    host, board = rows(), rows()
    found = agreement(host, board)
    assert (found.frames, found.same, found.accepted, found.near) == (40, 40, 30, 30)
    assert found.estimator_ms_p50 == pytest.approx(119.5)
    assert found.holds
    board[1] = turned(board[1], 0.099, 0.0099)
    assert agreement(host, board).near == 30
    board[1], board[2] = turned(board[1], 0.101, 0.0), turned(board[2], 0.0, 0.0101)
    found = agreement(host, board)
    # 28 of 30 is under 95 %
    assert (found.near, found.holds) == (28, False)
    assert found.largest_deg == pytest.approx(0.101)
    assert found.largest_m == pytest.approx(0.0101)


def test_a_frame_that_was_dropped_is_another_decision() -> None:
    host, board = rows(), rows()
    for k in (0, 4):
        board[k] = replace(board[k], outcome="dropped:timeout", board_total_ms=None)
    assert agreement(host, board).holds
    board[8] = replace(board[8], outcome="accepted")
    found = agreement(host, board)
    assert (found.same, found.holds) == (37, False)
    with pytest.raises(UserError, match="not of the same frames"):
        agreement(host, board[1:])


def write_run(folder: Path, name: str) -> Path:
    writer = LedgerWriter(folder)
    for row in rows():
        writer.add(row)
    writer.close()
    board = Board(name=name, model="tango", method="hybrid", encoding="raw", window=2)
    told = summarise(
        rows(),
        started_utc="",
        ended="completed",
        mode="lockstep",
        truth="off",
        url="",
        timeout_s=1.0,
        board=board,
    )
    (folder / SUMMARY_JSON).write_bytes(msgspec.json.encode(told))
    return folder


def test_boards_are_held_against_the_same_opencv_alone(tmp_path: Path) -> None:
    here, there, older, others = (tmp_path / name for name in ("here", "there", "older", "others"))
    write_run(here, "vm x86_64 Python 3.11.7, OpenCV 5.0.0, native")
    write_run(there, "pi aarch64 Python 3.9.2, OpenCV 5.0.0, numpy")
    write_run(older, "pi aarch64 Python 3.9.2, OpenCV 4.6.0, native")
    write_run(others, "a board in C")
    row = compare_runs(here, there, "Cortex-A76", "Debian 13", "TCP").row()
    assert row == (
        "| Cortex-A76 | Debian 13 | 3.9.2 | 5.0.0 | numpy | TCP | 40 | 40 of 40 | 30 of 30 | 0 deg, 0 mm | 120 / 137 |"
    )
    with pytest.raises(UserError, match=r"ran with OpenCV 5\.0\.0, the board's with 4\.6\.0"):
        compare_runs(here, older, "", "", "")
    with pytest.raises(UserError, match="write it anew"):
        compare_runs(here, others, "", "", "")


def test_a_board_with_a_long_name_still_tells_its_versions(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        platform, "node", lambda: "a-machine-with-the-longest-name-that-anybody-has-given-one-so-far"
    )
    monkeypatch.setattr("flyaround.hil.board.hybrid.native.library.describe_library", lambda: "native")
    monkeypatch.setattr(platform, "machine", lambda: "aarch64")
    said = Hello.decode(describe_board("tango", "", "hybrid", compiled=True).encode()).board
    assert len(said) == Hello.BOARD_BYTES
    assert said.startswith("a-machine")
    assert said.endswith(", native")
    assert "OpenCV" in said


@pytest.mark.slow
@pytest.mark.gl
@pytest.mark.timeout(3600)
def test_a_board_in_qemu_answers_as_the_host_does(tmp_path: Path) -> None:
    """Two pictures over each line; `make board-qemu` is the same with sixty."""
    try:
        missing_programs()
    except UserError as missing:
        pytest.skip(str(missing))
    command = [sys.executable, "-m", "tools.boards", "prove", "-n", "2", "-o", str(tmp_path / "out")]
    told = subprocess.run(command, capture_output=True, text=True, check=False)
    assert told.returncode == 0, told.stderr
    assert told.stdout.count("2 of 2") == 4
