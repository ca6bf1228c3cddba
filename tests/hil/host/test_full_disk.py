"""A disk that fills up under what a run writes: the run goes on, or ends with one sentence; the ledger is whole."""

import json
import logging

import msgspec
import numpy as np
import pytest
from hil_loop import Loop, adds_up, board, frames, made_frame
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from small_disk import small_disk as small_file_system

from flyaround.hil.host.ledger.frames_csv import read_ledger
from flyaround.hil.host.ledger.summary import LedgerSummary
from flyaround.hil.host.recording.cut_mcap import MAGIC, repair_mcap
from flyaround.hil.host.recording.ros_log import RosLog
from flyaround.hil.host.recording.space_packets import SpacePacketSink
from flyaround.hil.host.report import write_report
from flyaround.simulator.errors import UserError


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 192 kB."""
    with small_file_system(tmp_path / "disk", 192) as disk:
        yield disk


def large_frames(n):
    rng = np.random.default_rng(4)
    for k in range(n):
        yield made_frame(k, rng.integers(0, 255, (256, 256), np.uint8), every_s=0.05)


def whole(summary, n):
    return adds_up(summary) and (summary.ended, summary.accepted) == ("completed", n)


def goes_on(n, log, **options):
    """A run whose recorder fails: it comes to its end, and then to a sentence; that sentence."""
    with pytest.raises(UserError, match="the run continued to its end, and its ledger is complete") as caught:
        Loop(board()).run(large_frames(n), log_dir=log, **options)
    summary = msgspec.json.decode((log / "summary.json").read_bytes(), type=LedgerSummary)
    assert whole(summary, n)
    assert len(read_ledger(log)) == n
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_recording_ends_with_one_sentence_and_the_run_goes_on(small_disk, tmp_path, caplog):
    log, path = tmp_path / "log", small_disk / "run.mcap"
    with caplog.at_level(logging.WARNING):
        assert "run.mcap cannot be written (No space left" in goes_on(12, log, recorders=(RosLog(path),))
    said = [record.getMessage() for record in caplog.records]
    assert len(said) == 1
    assert "run.mcap cannot be written (No space left on device)" in said[0]


@pytest.mark.parametrize("room_kib", [1200, 1201, 1999, 3000])
def test_what_is_whole_of_a_recording_stays_readable(room_kib, tmp_path):
    with small_file_system(tmp_path / "disk", room_kib) as disk:
        path = disk / "run.mcap"
        goes_on(60, tmp_path / "log", recorders=(RosLog(path),))
        with path.open("rb") as file:
            found = [message for _, _, message in make_reader(file, validate_crcs=True).iter_messages()]
        with AnyReader([path]) as bag:
            assert len(list(bag.messages())) == len(found)
    assert len(found) > 12


def test_a_recording_of_which_nothing_is_whole_is_left_alone(tmp_path):
    path = tmp_path / "cut.mcap"
    for data in (b"", MAGIC, MAGIC + b"\x01", MAGIC + b"\x06" + bytes(8 + 40), b"no such file" * 9):
        path.write_bytes(data)
        repair_mcap(path)
        assert path.read_bytes() == data


def test_the_live_view_outlives_the_file(small_disk, tmp_path, caplog):
    recorder = RosLog(small_disk / "run.mcap", ("127.0.0.1", 0))
    heard = []
    with caplog.at_level(logging.WARNING):
        goes_on(20, tmp_path / "log", recorders=(recorder,), on_row=lambda _: heard.append(recorder.port))
    assert len(heard) == 20
    assert all(heard)
    assert [record.getMessage().count("the live view continues") for record in caplog.records] == [1, 0]


def test_space_packets_end_and_the_run_goes_on(small_disk, tmp_path, caplog):
    sink = SpacePacketSink(str(small_disk / "run.ccsds"), None)
    (small_disk / "full").write_bytes(bytes(150 * 1024))
    with caplog.at_level(logging.WARNING):
        goes_on(300, tmp_path / "log", recorders=(sink,))
    assert [
        record.getMessage() for record in caplog.records if "SpacePacketSink stops" in record.getMessage()
    ]


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
