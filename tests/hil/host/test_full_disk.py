"""A disk that fills up under what a run writes: the run goes on, or ends with one sentence; the ledger is whole."""

from __future__ import annotations

import json
import logging
import subprocess

import numpy as np
import pytest
from hil_loop import Loop, adds_up, board, frames, made_frame

from hil.host.ledger.frames_csv import read_ledger
from hil.host.recording.ros_log import RosLog
from hil.host.recording.space_packets import SpacePacketSink
from hil.host.report import write_report
from simulator.errors import UserError


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 192 kB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    made = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=192k", "none", str(folder)], check=False, capture_output=True
    )
    if made.returncode:
        pytest.skip("needs the rights to mount a small file system")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


def large_frames(n):
    rng = np.random.default_rng(4)
    for k in range(n):
        yield made_frame(k, rng.integers(0, 255, (256, 256), np.uint8), every_s=0.05)


def whole(summary, n):
    return adds_up(summary) and (summary.ended, summary.accepted) == ("completed", n)


def test_a_recording_ends_with_one_sentence_and_the_run_goes_on(small_disk, tmp_path, caplog):
    log, path = tmp_path / "log", small_disk / "run.mcap"
    with caplog.at_level(logging.WARNING):
        summary = Loop(board()).run(large_frames(12), recorders=(RosLog(path),), log_dir=log)
    assert whole(summary, 12)
    assert len(read_ledger(log)) == 12
    said = [record.getMessage() for record in caplog.records]
    assert len(said) == 1
    assert "run.mcap cannot be written (No space left on device)" in said[0]


def test_the_live_view_outlives_the_file(small_disk, caplog):
    recorder = RosLog(small_disk / "run.mcap", ("127.0.0.1", 0))
    heard = []
    with caplog.at_level(logging.WARNING):
        Loop(board()).run(
            large_frames(20), recorders=(recorder,), on_row=lambda _: heard.append(recorder.port)
        )
    assert all(heard)
    assert [record.getMessage().count("the live view goes on") for record in caplog.records] == [1]


def test_space_packets_end_and_the_run_goes_on(small_disk, tmp_path, caplog):
    sink = SpacePacketSink(str(small_disk / "run.ccsds"), None)
    (small_disk / "full").write_bytes(bytes(150 * 1024))
    with caplog.at_level(logging.WARNING):
        summary = Loop(board()).run(large_frames(300), recorders=(sink,), log_dir=tmp_path / "log")
    assert whole(summary, 300)
    assert [
        record.getMessage() for record in caplog.records if "SpacePacketSink stops" in record.getMessage()
    ]


def test_a_ledger_is_whole_up_to_its_last_row(small_disk):
    log = small_disk / "log"
    (small_disk / "full").write_bytes(bytes(180 * 1024))
    with pytest.raises(
        UserError, match=r"frames\.csv cannot be written \(No space left on device\): its \d+ rows"
    ):
        Loop(board()).run(frames(500), log_dir=log)
    rows = read_ledger(log)
    assert rows
    assert [row.frame_id for row in rows] == list(range(len(rows)))


def test_a_report_that_finds_no_room_is_one_sentence(small_disk):
    log = small_disk / "log"
    summary = Loop(board()).run(frames(20), log_dir=log)
    assert adds_up(summary)
    free = 192 * 1024 - sum(-(-p.stat().st_size // 4096) * 4096 for p in log.iterdir())
    (small_disk / "full").write_bytes(bytes(free - 8192))
    with pytest.raises(UserError, match=r"report\.html: no space left on its disk"):
        write_report(log)
    # nothing half written, and the ledger as it was
    assert not list(log.glob(".*"))
    assert len(read_ledger(log)) == 20
    assert json.loads((log / "summary.json").read_text())["sent"] == 20
