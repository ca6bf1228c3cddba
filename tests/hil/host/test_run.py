"""Runs over TCP with the board in its own process, or behind a line that listens."""

import json
import struct
import subprocess
import sys
import time

import jsonschema
import msgspec
import pytest
from hil_loop import BOARD, MARK, Instant, Loop, Proxy, adds_up, board, frames

from flyaround.hil.host.ledger.frames_csv import COLUMNS, read_ledger
from flyaround.hil.host.ledger.summary import LedgerSummary
from flyaround.hil.host.truth.logger import TruthLogger
from flyaround.hil.link.packets.packet import PacketType


def test_lockstep_with_the_board_in_another_process(tmp_path):
    processes, loggers = [], []

    def start(url):
        loggers.append(TruthLogger(loop.truth_url, tmp_path / "truth.jsonl"))
        loggers[0].start()
        assert loggers[0].wait_connected(60.0)
        command = [sys.executable, "-c", BOARD, url]
        processes.append(subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True))

    loop, rows = Loop(start), []
    summary = loop.run(frames(12), truth="separate", log_dir=tmp_path / "log", on_row=rows.append)
    out, err = processes[0].communicate(timeout=60)
    assert processes[0].returncode == 0, err
    assert "the host ended the session (the run is over) after 12 frames" in out

    # frames 0, 3, 6, 9 are declined by the oracle, 7 makes it crash
    assert (summary.sent, summary.accepted, summary.declined, summary.dropped) == (12, 7, 5, {})
    assert summary.ended == "completed"
    assert [row.frame_id for row in rows] == list(range(12))
    assert rows[7].reason == "the estimator failed: RuntimeError: seven"
    assert rows[7].q_wxyz is None
    assert rows[2].stages_ms == {"look": 0.5, "think": 1.5}
    assert rows[2].E_T_m == pytest.approx(0.123456789, abs=1e-12)
    assert rows[2].E_R_deg == pytest.approx(0.0, abs=1e-9)
    assert rows[1].E_R_deg == pytest.approx(180.0)
    for row in rows:
        assert 0 < row.send_ms <= row.e2e_ms
        assert 0 <= row.board_wait_ms <= row.board_total_ms < row.e2e_ms
        # the clock exchange places the board's times inside the host's, to half a round trip
        slack = summary.link.clock_round_trip_ms
        assert row.uplink_ms > -slack
        assert row.uplink_ms + row.board_total_ms + row.downlink_ms == pytest.approx(row.e2e_ms, abs=1e-6)

    back = read_ledger(tmp_path / "log")
    assert [(r.frame_id, r.outcome, r.truth_t_m, r.stages_ms) for r in back] == [
        (r.frame_id, r.outcome, r.truth_t_m, r.stages_ms) for r in rows
    ]
    assert (tmp_path / "log" / "frames.csv").read_text().splitlines()[0] == ",".join(COLUMNS)
    document = json.loads((tmp_path / "log" / "summary.json").read_text())
    jsonschema.validate(document, msgspec.json.schema(LedgerSummary))
    assert msgspec.convert(document, LedgerSummary) == summary

    assert loggers[0].stop(60.0) == 12
    lines = [json.loads(line) for line in (tmp_path / "truth.jsonl").read_text().splitlines()]
    assert [line["frame_id"] for line in lines] == list(range(12))
    assert lines[4]["truth"]["t_camera_from_target_m"] == [0.0, 0.123456789, 4.0]


@pytest.mark.parametrize("truth", ["off", "separate"])
def test_no_byte_of_truth_reaches_the_board(truth):
    proxy = Proxy()
    summary = Loop(proxy).run(frames(5), truth=truth)
    assert summary.accepted == 5
    stream = bytes(proxy.to_board)
    assert len(stream) > 5 * 48 * 64
    for secret in (MARK.encode(), b"camera_from_target", struct.pack("<d", 0.123456789), b"0.123456"):
        assert secret not in stream


def test_inline_truth_is_sent_before_its_frame_and_only_on_the_link():
    kinds = []

    def note(_k, kind, data):
        kinds.append(kind)
        return data

    loop = Loop(Proxy(note))
    summary = loop.run(frames(3), truth="inline")
    assert (summary.accepted, loop.truth_url) == (3, None)
    about_frames = [k for k in kinds if k in (PacketType.TRUTH, PacketType.FRAME_HEADER)]
    assert about_frames == [PacketType.TRUTH, PacketType.FRAME_HEADER] * 3


class Slow(Instant):
    """Three frames come while it looks at one."""

    def estimate(self, image):
        time.sleep(0.15)
        return super().estimate(image)


def test_realtime_paces_by_scenario_time_and_the_newest_frame_wins():
    rows, start = [], time.monotonic()
    summary = Loop(board(Slow, window=4)).run(
        frames(20, every_s=0.05), mode="realtime", on_row=rows.append, window=4
    )
    assert time.monotonic() - start > 19 * 0.05
    assert adds_up(summary)
    assert summary.sent == 20
    assert summary.dropped.keys() == {"superseded"}
    assert summary.dropped["superseded"] >= 8
    assert summary.accepted >= 2
    assert summary.board.window == 1
    assert all(row.e2e_ms is None for row in rows if row.outcome == "dropped:superseded")
    assert summary.deadline_ms == pytest.approx(50.0)
    assert summary.deadline_misses == summary.sent
    # no frame that a newer one could replace is ever looked at: when one is begun, at most one frame time old is used
    answered = sorted((row for row in rows if row.e2e_ms is not None), key=lambda row: row.frame_id)
    assert answered[-1].frame_id == 19
    for row in rows:
        if row.outcome == "dropped:superseded":
            assert f"frame {row.frame_id + 1} replaced it while it waited" in row.reason
    # frames are handed over when they are due, never before, and sent when the board is free
    assert all(row.handover_error_ms >= 0 for row in rows)
    assert all(row.send_lag_ms >= row.handover_error_ms for row in answered)


def test_a_closed_loop_in_real_time_decides_with_the_pose_of_the_picture_before():
    """The next frame is asked for when it is due to be decided, and what has come by then is in."""
    rows, known, asked = [], [], []

    def source():
        for k, frame in enumerate(frames(8, every_s=0.4)):
            asked.append(time.monotonic())
            known.append((k, [row.frame_id for row in rows]))
            yield frame

    Loop(board()).run(source(), mode="realtime", on_row=rows.append, decide_every_s=0.4)
    # the first is drawn before there is a board; on a busy machine answers may take longer for a second or two
    assert sum(rows_then == list(range(k)) for k, rows_then in known[2:]) >= 2
    # never before it is due, which what follows a frame that was late may be at once
    assert all(at - asked[0] > 0.4 * k - 0.1 for k, at in enumerate(asked))


def test_no_frame_is_sent_before_the_estimator_is_ready():
    def slow_to_build(camera):
        time.sleep(3.5)
        return Instant(camera)

    rows = []
    # a board has 2.5 s to come; once it is there its estimator may take longer
    Loop(board(slow_to_build)).run(frames(2), on_row=rows.append, timeout_s=2.5, connect_timeout_s=2.5)
    assert [row.outcome for row in rows] == ["accepted", "accepted"]
