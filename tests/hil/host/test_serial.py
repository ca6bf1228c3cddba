"""A whole run over a serial line: two pseudo-terminals wired to each other."""

from __future__ import annotations

import sys
import threading

import numpy as np
import pytest
from hil_loop import made_frame
from serial_line import null_modem

from flyaround.hil.board.agent import run_board
from flyaround.hil.host.link_process.ipc import LinkConfig
from flyaround.hil.host.run import RunConfig, run_host
from flyaround.hil.host.serial_time import line_time_s


class Mean:
    """Says how bright the image is, as a distance."""

    accepted, reason, confidence = True, "", 1.0
    q_camera_from_target_wxyz = (1.0, 0.0, 0.0, 0.0)

    def __init__(self, _camera) -> None:
        self.stages_ms = {"mean": 0.1}

    def estimate(self, image):
        self.t_camera_from_target_m = (0.0, 0.0, float(image.mean()))
        return self


def noise(k: int):
    return np.random.default_rng(k).integers(0, 256, (60, 80), dtype=np.uint8)


def frames(n: int):
    for k in range(n):
        yield made_frame(k, noise(k), every_s=0.1)


@pytest.mark.parametrize("damage_every", [0, 12_000])
def test_run_over_a_serial_line(damage_every):
    rows, ended = [], []
    with null_modem(damage_every) as (left, right):
        board = threading.Thread(
            target=lambda: ended.append(
                run_board(
                    f"serial://{right}?baud=921600",
                    make_estimator=Mean,
                    connect_timeout_s=60.0,
                    silence_s=60.0,
                )
            )
        )
        link = LinkConfig(
            url=f"serial://{left}?baud=921600", mode="lockstep", truth="off", timeout_s=4.0, silence_s=60.0
        )
        summary = run_host(
            frames(15),
            RunConfig(link=link),
            on_row=rows.append,
            on_listening=lambda *_: board.start(),
        )
        board.join(60.0)
    assert summary.board.encoding == "zstd"
    assert summary.sent == 15 == summary.accepted + summary.dropped_total
    if damage_every:
        assert summary.dropped.keys() == {"corrupt"}
        assert 3 <= summary.dropped["corrupt"] <= 9
    else:
        assert summary.accepted == 15
        assert ended[0].goodbye
    for row in rows:
        if row.outcome == "accepted":
            assert row.t_m[2] == noise(row.frame_id).mean()


@pytest.mark.slow
def test_a_run_at_115200_baud_reaches_its_computed_rate():
    """Raw frames of a whole run, from the first byte to the last: at best 95 % of what start and stop bits leave."""
    size_bytes, rows = 60 * 80, []
    with null_modem() as (left, right):
        board = threading.Thread(
            target=run_board,
            args=(f"serial://{right}?baud=115200",),
            kwargs={"make_estimator": Mean, "connect_timeout_s": 10.0},
        )
        url = f"serial://{left}?baud=115200"
        link = LinkConfig(url=url, mode="lockstep", truth="off", timeout_s=10.0, compression="raw")
        summary = run_host(
            frames(8), RunConfig(link=link), on_row=rows.append, on_listening=lambda *_: board.start()
        )
        board.join(60.0)
    assert summary.accepted == 8
    shares = [line_time_s(size_bytes, 115_200) / (1e-3 * row.send_ms) for row in rows]
    sys.stdout.write(
        f"{100 * max(shares):.1f} % of the computed rate at best, {100 * min(shares):.1f} % at worst\n"
    )
    # COBS may save a byte a block, and the last piece is given to the line at once
    assert all(share < 1.05 for share in shares)
    assert max(shares) > 0.95
