"""A whole run over a serial line: two pseudo-terminals wired to each other."""

import zlib

import numpy as np
import pytest
from estimators import Checksum
from hil_loop import Loop, board, made_frame
from serial_line import null_modem


def noise(k):
    return np.random.default_rng(k).integers(0, 256, (60, 80), dtype=np.uint8)


def frames(n):
    for k in range(n):
        yield made_frame(k, noise(k), every_s=0.1)


@pytest.mark.parametrize("damage_every", [0, 12_000])
def test_run_over_a_serial_line(damage_every):
    rows = []
    with null_modem(damage_every) as (left, right):
        loop = Loop(lambda _: board(Checksum, connect_timeout_s=60.0)(f"serial://{right}?baud=921600"))
        url = f"serial://{left}?baud=921600"
        summary = loop.run(frames(15), on_row=rows.append, url=url, timeout_s=4.0)
    assert summary.board.encoding == "zstd"
    assert summary.sent == 15 == summary.accepted + summary.dropped_total
    if damage_every:
        assert summary.dropped.keys() == {"corrupt"}
        assert 3 <= summary.dropped["corrupt"] <= 9
    else:
        assert summary.accepted == 15
        assert loop.results[0].goodbye
    for row in rows:
        if row.outcome == "accepted":
            assert row.t_m[0] == zlib.crc32(noise(row.frame_id).tobytes()) % 1_000_000
