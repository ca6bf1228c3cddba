"""Runs over TCP with the board in its own process, or behind a line that does damage."""

from __future__ import annotations

import json
import re
import socket
import struct
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import jsonschema
import msgspec
import numpy as np
import pytest

from hil.board.agent import run_board
from hil.host.ledger import COLUMNS, read_ledger
from hil.host.run import HostFrame, run_host
from hil.host.summary import LedgerSummary, summary_schema
from hil.host.truth_logger import TruthLogger
from hil.link.clock import answer_time_sync, now_ns
from hil.link.errors import LinkError
from hil.link.messages import Bye, FrameChunk, FrameHeader, Hello, PoseMessage, TimeSyncRequest
from hil.link.packets import PacketType, decode_packet
from hil.link.session import Link, greet_host
from hil.link.transport import connect
from simulator.errors import UserError

CAMERA = {"width_px": 64, "height_px": 48, "fx_px": 100.0, "fy_px": 100.0, "cx_px": 31.5, "cy_px": 23.5}
MARK = "truth-must-not-leak"

# An oracle: the pose is written into the first pixels of the image, as the host knows it.
BOARD = """
import sys, time
from hil.board.agent import run_board
class Result:
    reason = "oracle"; confidence = 0.5; q_camera_from_target_wxyz = (1.0, 0.0, 0.0, 0.0)
    def __init__(self, image):
        self.accepted = bool(image[0, 0] % 3)
        self.t_camera_from_target_m = (0.0, 0.0, float(image[0, 0]))
        self.stages_ms = {"look": 0.5, "think": 1.5}
class Oracle:
    def __init__(self, camera): assert camera["width_px"] == 64
    def estimate(self, image):
        if image[0, 0] == 7: raise RuntimeError("seven")
        return Result(image)
summary = run_board(sys.argv[1], make_estimator=Oracle, method="oracle", model_name="tango")
print(summary.ended); sys.exit(0 if summary.goodbye else 1)
"""


def frames(n: int, *, every_s: float = 0.05):
    for k in range(n):
        image = np.full((48, 64), k % 256, np.uint8)
        truth = {
            "q_camera_from_target_wxyz": [0.0, 0.0, 0.0, 1.0] if k == 1 else [1.0, 0.0, 0.0, 0.0],
            "t_camera_from_target_m": [0.0, 0.123456789, float(k)],
            "note": MARK,
        }
        yield HostFrame(k, "2026-01-01T00:00:00Z", k * every_s, 0.01, image, CAMERA, truth, 2.0)


class Estimate:
    """Accepts at once; a subclass of nothing, as a user's own would be."""

    accepted, reason, confidence = True, "", 1.0
    q_camera_from_target_wxyz = (1.0, 0.0, 0.0, 0.0)
    t_camera_from_target_m = (0.0, 0.0, 1.0)

    def __init__(self) -> None:
        self.stages_ms: dict[str, float] = {}


class Instant:
    """Answers after the next of its ``sleeps``, at once when there is none left."""

    def __init__(self, _camera) -> None:
        self.sleeps: list[float] = []

    def estimate(self, _image):
        time.sleep(self.sleeps.pop(0) if self.sleeps else 0.0)
        return Estimate()


class Loop:
    """A run with whatever is started once the ports are open."""

    def __init__(self, *starters) -> None:
        self.starters, self.threads, self.results = starters, [], []

    def on_listening(self, url, truth_url) -> None:
        self.url, self.truth_url = url, truth_url
        for starter in self.starters:
            thread = threading.Thread(target=self._start, args=(starter, url), daemon=True)
            thread.start()
            self.threads.append(thread)

    def _start(self, starter, url) -> None:
        self.results.append(starter(url))

    def run(self, source, **options):
        defaults = {
            "url": "tcp://127.0.0.1:0",
            "mode": "lockstep",
            "truth": "off",
            "log_dir": None,
            "timeout_s": 2.0,
            "connect_timeout_s": 20.0,
        }
        summary = run_host(source, on_listening=self.on_listening, **{**defaults, **options})
        for thread in self.threads:
            thread.join(5.0)
        return summary


def board(estimator=Instant, **options):
    return lambda url: run_board(url, make_estimator=estimator, **options)


def refused(client):
    """A client that is expected to be turned away; returns the sentence it hears."""

    def start(url):
        with pytest.raises(LinkError) as caught:
            client(url)
        return str(caught.value)

    return start


class Proxy:
    """Man in the middle: keeps what went to the board, and may change it packet by packet."""

    def __init__(self, change=lambda _k, _kind, data: data) -> None:
        self.change, self.to_board, self._n = change, bytearray(), 0

    def __call__(self, host_url: str):
        port = int(host_url.rsplit(":", 1)[1])
        with socket.create_server(("127.0.0.1", 0)) as server:
            upstream = socket.create_connection(("127.0.0.1", port))
            result = []
            thread = threading.Thread(
                target=lambda: result.append(board()(f"tcp://127.0.0.1:{server.getsockname()[1]}")),
                daemon=True,
            )
            thread.start()
            downstream, _ = server.accept()
        back = threading.Thread(target=self._copy_back, args=(downstream, upstream), daemon=True)
        back.start()
        while (packet := self._packet(upstream)) is not None:
            kind = decode_packet(packet).type
            data = self.change(self._n, kind, struct.pack("<I", len(packet)) + packet)
            self._n += 1
            self.to_board += data
            try:
                downstream.sendall(data)
            except OSError:
                break
        downstream.close()
        thread.join(5.0)
        upstream.close()
        back.join(5.0)
        return result[0] if result else None

    @staticmethod
    def _copy_back(source, sink) -> None:
        try:
            while data := source.recv(65536):
                sink.sendall(data)
        except OSError:
            pass

    @staticmethod
    def _packet(sock):
        def exactly(n):
            data = b""
            while len(data) < n:
                more = sock.recv(n - len(data))
                if not more:
                    return None
                data += more
            return data

        try:
            prefix = exactly(4)
            return None if prefix is None else exactly(struct.unpack("<I", prefix)[0])
        except OSError:
            return None


def flip_first(kind: PacketType, nth: int):
    """Damage the nth packet of a kind."""
    seen = 0

    def change(_k, this, data):
        nonlocal seen
        if this == kind:
            seen += 1
            if seen == nth:
                return data[:40] + bytes([data[40] ^ 0x04]) + data[41:]
        return data

    return change


def adds_up(summary: LedgerSummary) -> bool:
    return summary.sent == summary.accepted + summary.declined + sum(summary.dropped.values())


# --- the whole loop ------------------------------------------------------------------------


def test_lockstep_with_the_board_in_another_process(tmp_path):
    processes, loggers = [], []

    def start(url):
        loggers.append(TruthLogger(loop.truth_url, tmp_path / "truth.jsonl"))
        loggers[0].start()
        assert loggers[0].wait_connected(10.0)
        command = [sys.executable, "-c", BOARD, url]
        processes.append(subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True))

    loop, rows = Loop(start), []
    summary = loop.run(frames(12), truth="separate", log_dir=tmp_path / "log", on_row=rows.append)
    out, err = processes[0].communicate(timeout=10)
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
    jsonschema.validate(document, summary_schema())
    assert msgspec.convert(document, LedgerSummary) == summary

    assert loggers[0].stop() == 12
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


def test_realtime_paces_by_scenario_time_and_drops_without_credit():
    class Slow(Instant):
        def estimate(self, image):
            time.sleep(0.15)
            return super().estimate(image)

    rows, start = [], time.monotonic()
    summary = Loop(board(Slow, window=1)).run(
        frames(20, every_s=0.05), mode="realtime", on_row=rows.append, window=4
    )
    assert time.monotonic() - start > 19 * 0.05
    assert adds_up(summary)
    assert summary.sent == 20
    assert summary.dropped.keys() == {"no_credit"}
    assert summary.dropped["no_credit"] >= 8
    assert summary.accepted >= 2
    assert summary.board.window == 1
    assert all(row.e2e_ms is None for row in rows if row.outcome == "dropped:no_credit")
    assert summary.deadline_ms == pytest.approx(50.0)
    assert summary.deadline_misses == summary.accepted
    # frames leave when they are due, never before
    assert all(row.send_lag_ms >= 0 for row in rows if row.send_lag_ms is not None)


def test_no_frame_is_sent_before_the_estimator_is_ready():
    def slow_to_build(camera):
        time.sleep(0.8)
        return Instant(camera)

    rows = []
    Loop(board(slow_to_build)).run(frames(2), on_row=rows.append, timeout_s=0.5)
    assert [row.outcome for row in rows] == ["accepted", "accepted"]


def test_zstd_is_negotiated():
    summary = Loop(board()).run(frames(3), compression="zstd")
    assert (summary.accepted, summary.board.encoding) == (3, "zstd")


# --- damage --------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [PacketType.FRAME_CHUNK, PacketType.FRAME_HEADER])
def test_a_damaged_frame_is_dropped_as_corrupt_and_the_run_goes_on(kind):
    rows = []
    summary = Loop(Proxy(flip_first(kind, 3))).run(frames(6), on_row=rows.append)
    assert [row.outcome for row in rows] == ["accepted"] * 2 + ["dropped:corrupt"] + ["accepted"] * 3
    assert summary.dropped == {"corrupt": 1}
    assert adds_up(summary)
    assert "lost a packet on the line" in rows[2].reason


def test_a_damaged_pose_is_never_accepted():
    class BadLine:
        """Flips a bit in the third POSE that comes from the board."""

        def __init__(self) -> None:
            self.seen = 0

        def __call__(self, url):
            line = connect(url, 5.0)
            write = line._write

            def damaged(data):
                if decode_packet(bytes(data[4:])).type == PacketType.POSE:
                    self.seen += 1
                    if self.seen == 3:
                        data = data[:60] + bytes([data[60] ^ 1]) + data[61:]
                write(data)

            line._write = damaged
            link = Link(line)
            greet_host(link, Hello(), 5.0)
            while True:
                message = link.recv(5.0)
                if isinstance(message, TimeSyncRequest):
                    link.send(answer_time_sync(message, now_ns()))
                if isinstance(message, Bye):
                    line.close()
                    return
                if isinstance(message, FrameChunk):
                    link.send(
                        PoseMessage(
                            message.frame_id,
                            accepted=True,
                            q_camera_from_target_wxyz=(1, 0, 0, 0),
                            t_camera_from_target_m=(0, 0, 1),
                        )
                    )

    rows = []
    summary = Loop(BadLine()).run(frames(5), on_row=rows.append, timeout_s=1.0)
    assert [row.outcome for row in rows] == ["accepted"] * 2 + ["dropped:corrupt"] + ["accepted"] * 2
    assert summary.link.packets_corrupt == 1


def test_a_board_that_times_out_and_comes_round():
    class Sleepy(Instant):
        def __init__(self, camera) -> None:
            super().__init__(camera)
            self.sleeps = [0.0, 0.7, 0.0]

    rows = []
    summary = Loop(board(Sleepy)).run(frames(4), on_row=rows.append, timeout_s=0.4)
    assert [row.outcome for row in rows] == ["accepted", "dropped:timeout", "accepted", "accepted"]
    assert rows[1].reason == "no pose within 0.4 s"
    assert summary.link.late_poses == 1


def quitter(url, *, after: int):
    """A board that vanishes in the middle of a frame, without a goodbye."""
    link = Link(connect(url, 10.0))
    greet_host(link, Hello(), 10.0)
    headers = 0
    while True:
        message = link.recv(5.0)
        if isinstance(message, FrameHeader):
            headers += 1
            if headers > after:
                link.transport.close()
                return
        elif isinstance(message, FrameChunk):
            link.send(PoseMessage(message.frame_id, accepted=False, reason="not today"))
        elif isinstance(message, TimeSyncRequest):
            link.send(answer_time_sync(message, now_ns()))


def test_a_board_that_disconnects_mid_frame_and_stays_away(tmp_path):
    summary = Loop(lambda url: quitter(url, after=2)).run(frames(9), log_dir=tmp_path, timeout_s=0.5)
    assert summary.ended == "board_lost"
    assert (summary.sent, summary.declined, summary.dropped) == (3, 2, {"disconnected": 1})
    assert [row.outcome for row in read_ledger(tmp_path)] == ["declined", "declined", "dropped:disconnected"]
    assert msgspec.json.decode((tmp_path / "summary.json").read_bytes(), type=LedgerSummary) == summary


def test_a_board_that_comes_back_finishes_the_run():
    def comes_back(url):
        quitter(url, after=2)
        time.sleep(0.2)
        return run_board(url, make_estimator=Instant)

    rows = []
    summary = Loop(comes_back).run(frames(9), on_row=rows.append, timeout_s=5.0)
    assert [row.outcome for row in rows] == ["declined"] * 2 + ["dropped:disconnected"] + ["accepted"] * 6
    assert (summary.ended, summary.link.sessions) == ("completed", 2)


def test_a_second_board_is_turned_away_with_a_sentence():
    def second(url):
        time.sleep(0.3)
        return refused(board())(url)

    class Steady(Instant):
        def estimate(self, image):
            time.sleep(0.1)
            return super().estimate(image)

    loop = Loop(board(Steady), second)
    summary = loop.run(frames(10))
    assert summary.accepted == 10
    assert "another board is connected to this host: stop it first" in str(loop.results[0])


def test_the_host_goes_away_without_a_goodbye():
    with socket.create_server(("127.0.0.1", 0)) as server:
        done = []
        thread = threading.Thread(
            target=lambda: done.append(
                run_board(f"tcp://127.0.0.1:{server.getsockname()[1]}", make_estimator=Instant)
            )
        )
        thread.start()
        from hil.link.messages import HelloAck
        from hil.link.tcp import TcpTransport

        sock, _ = server.accept()
        link = Link(TcpTransport(sock, "board"), 5)
        assert isinstance(link.recv(5.0), Hello)
        link.send(HelloAck(CAMERA, 64, 48))
        link.transport.close()
        thread.join(5.0)
    assert not done[0].goodbye
    assert re.fullmatch(r"the host went away without a goodbye \(.*\) after 0 frames", done[0].ended)


# --- a user's mistakes ---------------------------------------------------------------------


@contextmanager
def taken_port():
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


def test_port_in_use_is_one_sentence_and_nothing_is_written(tmp_path):
    with taken_port() as port:
        for options in ({"url": f"tcp://127.0.0.1:{port}"}, {"truth_url": f"tcp://127.0.0.1:{port}"}):
            sentence = f"port {port} on 127.0.0.1 is in use by another program: stop it, or choose another"
            with pytest.raises(UserError, match=sentence) as caught:
                Loop().run(frames(1), truth="separate", log_dir=tmp_path / "log", **options)
            assert "\n" not in str(caught.value)
    assert not (tmp_path / "log").exists()


def test_no_board_is_one_sentence_and_the_books_are_closed(tmp_path):
    with pytest.raises(UserError, match=r"no board connected to tcp://127.* within 0\.2 s: start one with"):
        Loop().run(frames(1), log_dir=tmp_path, connect_timeout_s=0.2)
    summary = msgspec.json.decode((tmp_path / "summary.json").read_bytes(), type=LedgerSummary)
    assert (summary.ended, summary.sent) == ("no_board", 0)


def test_a_board_with_another_model_is_refused_by_name():
    loop = Loop(refused(board(model_name="cygnus")))
    with pytest.raises(UserError, match="model of 'cygnus' but the host flies 'tango'"):
        loop.run(frames(1), target_name="tango", connect_timeout_s=1.5)
    loop.threads[0].join(5.0)
    assert "refuses: the board carries a model of 'cygnus'" in loop.results[0]


def test_an_old_ledger_is_not_overwritten(tmp_path):
    (tmp_path / "frames.csv").write_text("precious")
    with pytest.raises(UserError, match="is there already: name another folder"):
        Loop().run(frames(1), log_dir=tmp_path)
    assert (tmp_path / "frames.csv").read_text() == "precious"


def test_a_renderer_that_fails_leaves_a_ledger_that_adds_up(tmp_path):
    def failing():
        yield from frames(3)
        raise UserError("the renderer lost its context")

    with pytest.raises(UserError, match="lost its context"):
        Loop(board()).run(failing(), log_dir=tmp_path)
    summary = msgspec.json.decode((tmp_path / "summary.json").read_bytes(), type=LedgerSummary)
    assert (summary.ended, summary.accepted, len(read_ledger(tmp_path))) == ("failed", 3, 3)


def test_the_agent_as_a_program_says_one_sentence(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "hil.board", "tcp://127.0.0.1:1", "--model", str(tmp_path / "none.json")],
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
        cwd=Path(__file__).parents[2],
    )
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "none.json cannot be read" in done.stderr
