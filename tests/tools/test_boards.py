"""The emulated board: what is made and asked without QEMU, and, slowly, the loop with it."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import msgspec
import pytest

from flyaround.hil.board.agent import describe_board
from flyaround.hil.host.frame_record import FrameRecord
from flyaround.hil.host.ledger.frames_csv import LedgerWriter
from flyaround.hil.host.ledger.summary import SUMMARY_JSON, summarise
from flyaround.hil.host.link_process.ipc import Board
from flyaround.hil.link.packets.messages import Hello
from flyaround.simulator.errors import UserError
from tools.boards import debian_image
from tools.boards.agreement import compare_runs
from tools.boards.debian_image import missing_programs


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
    with pytest.raises(UserError, match="write the bundle anew"):
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
    rows = [line.split("|") for line in told.stdout.splitlines() if line.startswith("| cortex-a72")]
    assert [row[8].strip() for row in rows] == ["2 of 2"] * 2, told.stdout + told.stderr
    # its library of matrices rounds otherwise, which the UART's small pictures show most (docs/validation/boards.md)
    assert all(float(row[10].split()[0]) < 0.3 for row in rows), told.stdout
