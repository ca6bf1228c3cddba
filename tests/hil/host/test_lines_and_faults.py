"""Every line under every fault, in whole runs: books that add up, and no pixel that was not sent."""

from __future__ import annotations

import zlib
from contextlib import contextmanager

import numpy as np
import pytest
from estimators import Checksum
from hil_loop import Loop, adds_up, board, made_frame
from serial_line import null_modem

from flyaround.hil.link.errors import LinkError
from flyaround.simulator.scenario.faults import (
    Bandwidth,
    Corrupt,
    Delay,
    Disconnect,
    Drop,
    Duplicate,
    Faults,
    Jitter,
    Reorder,
)

KEY = b"k" * 32
N = 6
FAULTS = {
    "delay": Delay(delay_ms=30.0),
    "jitter": Jitter(most_ms=30.0),
    "bandwidth": Bandwidth(bytes_per_s=100_000.0),
    "drop": Drop(chance=0.3),
    "duplicate": Duplicate(chance=0.5),
    "reorder": Reorder(chance=0.3),
    "corrupt": Corrupt(chance=0.3),
    "disconnect": Disconnect(start_s=0.1),
}
LINES = ["tcp", "serial", "tcp sealed", "serial sealed"]


@contextmanager
def urls(line):
    """The host's, and what makes it the board's."""
    if line.startswith("serial"):
        with null_modem() as (left, right):
            yield f"serial://{left}?baud=3000000", lambda _: f"serial://{right}?baud=3000000"
    else:
        yield f"{line.split()[0]}://127.0.0.1:0", lambda url: url


def picture(k):
    return np.random.default_rng(k).integers(0, 256, (48, 64), np.uint8)


def strike(line, name, mode):
    key = KEY if line.endswith("sealed") else None
    rows = []
    with urls(line) as (url, there):

        def serve(listening):
            # only silence tells of a serial line that was cut; a busy machine is silent, too
            silence_s = 0.8 if line.startswith("serial") else 60.0
            for _ in range(6 if name == "disconnect" else 1):
                try:
                    summary = board(Checksum, key=key, connect_timeout_s=20.0, silence_s=silence_s)(
                        there(listening)
                    )
                except LinkError:
                    return
                if summary.goodbye:
                    return

        frames = (made_frame(k, picture(k), every_s=0.1) for k in range(N))
        summary = Loop(serve).run(
            frames,
            on_row=rows.append,
            url=url,
            key=key,
            mode=mode,
            faults=Faults(seed=2, line=(FAULTS[name],)),
            timeout_s=4.0 if name != "disconnect" else 6.0,
            max_misses=0,
        )
    assert adds_up(summary)
    assert summary.sent == N == len(rows)
    for row in rows:
        if row.outcome == "accepted":
            assert row.t_m[0] == zlib.crc32(picture(row.frame_id).tobytes()) % 1_000_000
        else:
            assert row.outcome.startswith("dropped:")
            assert mode == "realtime" or name in row.faults
    return summary


@pytest.mark.parametrize(
    ("line", "name"), [("tcp", "corrupt"), ("tcp sealed", "duplicate"), ("tcp sealed", "reorder")]
)
def test_a_line_under_a_fault(line, name):
    assert strike(line, name, "lockstep").accepted > 0


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["lockstep", "realtime"])
@pytest.mark.parametrize("name", FAULTS)
@pytest.mark.parametrize("line", LINES)
def test_every_line_under_every_fault(line, name, mode):
    summary = strike(line, name, mode)
    assert summary.ended == "completed"
    assert summary.accepted > 0
    if name in ("delay", "jitter", "bandwidth", "duplicate") and mode == "lockstep":
        assert summary.accepted == N
    if name == "disconnect" and mode == "lockstep":
        assert summary.link.sessions == 2
