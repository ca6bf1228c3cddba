"""Whole runs over UDP to a board's process, on a network that loses, doubles, swaps and damages datagrams."""

from __future__ import annotations

import json
import sys
import zlib
from contextlib import contextmanager

import cv2
import numpy as np
import pytest
from hil_loop import Loop, adds_up, made_frame
from hil_processes import HARNESS, host_process, started
from lossy_udp import lossy_network

from flyaround.__main__ import run
from flyaround.hil.host.ledger.frames_csv import read_ledger
from flyaround.hil.link.transports.url import parse_url

# A board that tells what came: the picture's checksum, as a place.
BOARD = f"""
import sys
sys.path.insert(0, {str(HARNESS)!r})
from estimators import Checksum
from flyaround.hil.board import agent
agent.svd_factory = lambda model, method: (Checksum, "", "")
from flyaround.hil.board.__main__ import run_and_exit
run_and_exit("flyaround.hil.board")
"""
SIZE = (300, 400)


def picture(k):
    return np.random.default_rng(k).integers(0, 256, SIZE, np.uint8)


def flight(n, every_s=0.05):
    for k in range(n):
        yield made_frame(k, picture(k), every_s=every_s)


def told(k):
    """What the board says of a picture that came whole."""
    return float(zlib.crc32(picture(k).tobytes()) % 1_000_000)


@contextmanager
def udp_board(url, *more):
    with started([sys.executable, "-c", BOARD, url, "--model", "none", "--silence", "60", *more]) as process:
        yield process


def run_over(network, n=25, *more, **options):
    """Summary and rows of a run whose board is behind a network; and its exit code."""
    rows, codes, counts = [], [], []

    def start(url):
        with lossy_network(parse_url(url)[2], **network) as (there, seen), udp_board(there, *more) as process:
            codes.append(process.wait(120.0))
            counts.append(seen)

    options = {"url": "udp://127.0.0.1:0"} | options
    summary = Loop(start).run(flight(n, options.pop("every_s", 0.05)), on_row=rows.append, **options)
    assert adds_up(summary)
    assert summary.sent == n == len(rows)
    for row in rows:
        if row.outcome == "accepted":
            assert row.t_m[0] == told(row.frame_id)
    return summary, rows, codes[0], counts[0]


NETWORK = {"loss": 0.02, "swap": 0.05, "double": 0.02, "flip": 0.005}


def test_every_frame_comes_whole_over_a_bad_network():
    summary, _, code, counts = run_over(NETWORK)
    assert (summary.accepted, summary.ended, code) == (25, "completed", 0)
    assert summary.link.packets_corrupt == summary.link.protocol_mistakes == 0
    # 25 frames of 120 kB are some 2200 datagrams
    assert counts["lost"] > 20
    assert counts["swapped"] > 50


def test_in_real_time_with_a_key_the_books_add_up(tmp_path):
    key = tmp_path / "key"
    key.write_bytes(b"k" * 32)
    key.chmod(0o600)
    summary, _, code, _ = run_over(
        NETWORK, 30, "--key", str(key), mode="realtime", key=b"k" * 32, every_s=0.03
    )
    assert (summary.ended, code) == ("completed", 0)
    assert summary.accepted >= 1
    assert summary.dropped.keys() <= {"superseded", "timeout", "lost", "corrupt"}


@pytest.mark.slow
@pytest.mark.parametrize("loss", [0.1, 0.3, 0.6])
def test_a_network_that_loses_most_costs_time_never_pixels(loss):
    summary, _, code, counts = run_over({"loss": loss, "swap": 0.1, "double": 0.1, "flip": 0.02, "seed": 5})
    of_all = f"{counts['lost']} of {counts['sent']} datagrams lost"
    sys.stdout.write(f"{of_all}: {summary.accepted} of 25 accepted\n")
    assert summary.accepted > 20 or loss > 0.5
    assert code in (0, 1)


def test_host_and_board_in_processes_of_their_own(tmp_path):
    with host_process(tmp_path / "log", url="udp://127.0.0.1:0", n=12, size=200, silence_s=60.0) as (
        host,
        url,
    ):
        assert url.startswith("udp://127.0.0.1:")
        with lossy_network(parse_url(url)[2], loss=0.02, swap=0.05) as (there, _), udp_board(there) as board:
            host.communicate(timeout=120.0)
            said, wrong = board.communicate(timeout=120.0)
    assert (host.returncode, board.returncode, wrong) == (0, 0, "")
    assert "12 of 12 poses accepted" in said
    assert json.loads((tmp_path / "log" / "summary.json").read_text())["accepted"] == 12
    assert len(read_ledger(tmp_path / "log")) == 12


@pytest.mark.slow
def test_the_commands_hil_host_and_hil_board_over_udp(tmp_path):
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    for k in range(3):
        image = np.random.default_rng(k).integers(0, 40, (1200, 1920), np.uint8)
        cv2.imwrite(str(pictures / f"{k}.png"), image)
    flyaround = [sys.executable, "-P", "-m", "flyaround", "hil"]
    words = ["host", "tango-flyaround", "-n", "6", "--listen", "udp://127.0.0.1:0", "--from", str(pictures)]
    with started([*flyaround, *words, "--log", str(tmp_path / "log")]) as host:
        url = next(line.split()[2].rstrip(";") for line in host.stderr if line.startswith("listening on"))
        with started([*flyaround, "board", url]) as board:
            host.communicate(timeout=120.0)
            board.communicate(timeout=120.0)
    assert (host.returncode, board.returncode) == (0, 0)
    summary = json.loads((tmp_path / "log" / "summary.json").read_text())
    assert summary["sent"] == 6 == summary["accepted"] + summary["declined"]


@pytest.mark.parametrize("address", [".".join("0000"), "[::]"])
def test_udp_off_the_loopback_needs_a_key(capsys, address):
    assert run(["hil", "host", "tango-flyaround", "-n", "1", "--listen", f"udp://{address}:0"]) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "can be reached from other machines" in said
    assert "hil key FILE" in said
