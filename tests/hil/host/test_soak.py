"""Long runs at 10 Hz of 512 x 512 pictures before a board that answers at once: memory stays flat, every frame comes.

Three minutes; ``make soak`` takes an hour.
"""

import json
import os
import statistics
import sys
import time
from contextlib import ExitStack
from datetime import datetime

import pytest
from hil_processes import PATIENCE_S, children_of, echo_board, host_process, resident_kib

from flyaround.hil.host.ledger.frames_csv import read_ledger

SOAK_S = float(os.environ.get("FLYAROUND_SOAK_S", "180"))
EVERY_S = 0.1
REALTIME = {"mode": "realtime", "every_s": EVERY_S, "size": 512}

pytestmark = [pytest.mark.slow, pytest.mark.timeout(SOAK_S + 300.0)]


def tell(sentence):
    """To whoever runs this with ``-rA``."""
    sys.stdout.write(sentence + "\n")


def test_memory_of_every_process_stays_flat(tmp_path):
    log, weights = tmp_path / "log", {}
    with host_process(log, n=round(SOAK_S / EVERY_S), **REALTIME) as (host, url), echo_board(url) as board:
        while host.poll() is None:
            if (log / "frames.csv").exists():
                (link,) = children_of(host.pid)[:1] or (None,)
                for name, pid in (("host", host.pid), ("link", link), ("board", board.pid)):
                    if pid is not None and host.poll() is None and board.poll() is None:
                        try:
                            weights.setdefault(name, []).append(resident_kib(pid))
                        except OSError:
                            break  # it ends
            time.sleep(0.5)
        _, said = host.communicate(timeout=PATIENCE_S)
        board.communicate(timeout=PATIENCE_S)
    assert (host.returncode, board.returncode) == (0, 0), said
    summary = json.loads((log / "summary.json").read_text())
    assert summary["sent"] == summary["accepted"] + summary["declined"] + sum(summary["dropped"].values())
    tell(f"{summary['sent']} frames, {summary['accepted']} accepted, dropped {summary['dropped']}")
    for name, kib in weights.items():
        # the first sixth is for buffers and caches to fill
        rest = kib[len(kib) // 6 : -2]
        tenth = max(3, len(rest) // 10)
        first, last = statistics.median(rest[:tenth]), statistics.median(rest[-tenth:])
        tell(
            f"{name}: {first / 1024:.1f} MiB, then {last / 1024:.1f} MiB ({100 * (last / first - 1):+.2f} %)"
        )
        assert last < 1.05 * first, name
    assert set(weights) == {"host", "link", "board"}


def test_four_links_at_once_keep_ten_frames_a_second(tmp_path):
    n = 300
    with ExitStack() as stack:
        hosts = [stack.enter_context(host_process(tmp_path / str(k), n=n, **REALTIME)) for k in range(4)]
        boards = [stack.enter_context(echo_board(url)) for _, url in hosts]
        for host, _ in hosts:
            _, said = host.communicate(timeout=n * EVERY_S + PATIENCE_S)
            assert host.returncode == 0, said
        for board in boards:
            board.communicate(timeout=PATIENCE_S)
    rates = []
    for k in range(4):
        rows = read_ledger(tmp_path / str(k))
        assert len(rows) == n
        answered = [datetime.fromisoformat(row.received_utc[:26]) for row in rows if row.received_utc]
        first, last = answered[0], answered[-1]
        rates.append((len(answered) - 1) / (last - first).total_seconds())
    tell(f"frames a second: {', '.join(f'{rate:.3f}' for rate in rates)}; load {os.getloadavg()[0]:.1f}")
    # pictures are drawn before: what is measured is the way there and back
    assert min(rates) >= 9.9
