"""Ledger files and the report made from them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from hil.host.ledger import COLUMNS, LedgerRow, LedgerWriter, pose_errors, read_ledger
from hil.host.report import write_report
from hil.host.summary import summarise, this_machine
from simulator.errors import UserError

RUN = {
    "started_utc": "2026-01-01T00:00:00+00:00",
    "ended": "completed",
    "mode": "lockstep",
    "truth": "off",
    "url": "tcp://127.0.0.1:5600",
    "timeout_s": 1.0,
}


def row(k: int, outcome: str, **more) -> LedgerRow:
    return LedgerRow(
        frame_id=k, epoch_utc="2026-01-01T00:00:00Z", t_s=0.1 * k, exposure_s=0.01, outcome=outcome, **more
    )


def answered(k: int, outcome: str, e2e_ms: float) -> LedgerRow:
    return row(
        k,
        outcome,
        reason='says "no", twice',
        e2e_ms=e2e_ms,
        board_total_ms=e2e_ms - 1,
        uplink_ms=0.5,
        downlink_ms=0.1,
        board_wait_ms=0.05,
        stages_ms={"roi": 0.2 * e2e_ms, "pnp": 0.5 * e2e_ms},
        q_wxyz=(1.0, 0.0, 0.0, 0.0),
        t_m=(0.1, -0.2, 9.0),
        E_T_m=0.01 * (k + 1),
        E_R_deg=0.1 * (k + 1),
    )


ROWS = [answered(k, "declined" if k % 4 == 3 else "accepted", 10.0 + k) for k in range(20)] + [
    row(20, "dropped:timeout", reason="no pose within 1 s"),
    row(21, "dropped:corrupt"),
    row(22, "dropped:timeout"),
]


def write(folder, rows):
    writer = LedgerWriter(folder)
    for r in rows:
        writer.add(r)
    writer.close()


def test_rows_survive_the_file(tmp_path):
    write(tmp_path, reversed(ROWS))
    back = read_ledger(tmp_path)
    assert [r.frame_id for r in back] == list(range(23))
    assert back[3].reason == 'says "no", twice'
    assert back[3].t_m == (0.1, -0.2, 9.0)
    assert back[20].e2e_ms is None
    assert back[20].q_wxyz is None
    assert all(b.stages_ms.keys() == r.stages_ms.keys() for b, r in zip(back, ROWS, strict=True))


def test_the_header_line_is_documented():
    docs = Path(__file__).parents[2] / "docs"
    assert ",".join(COLUMNS) in (docs / "hil_protocol.md").read_text().splitlines()
    page = (docs / "formats" / "ledger.md").read_text()
    assert all(name in page for name in COLUMNS if not name.startswith("truth_"))


def test_each_row_is_on_disk_at_once_and_half_a_line_is_left_out(tmp_path):
    writer = LedgerWriter(tmp_path)
    writer.add(ROWS[0])
    assert len(read_ledger(tmp_path)) == 1
    writer.close()
    with (tmp_path / "frames.csv").open("a") as file:
        file.write("1,2026-01-01T00:00:00Z,0.1,0.01,acc")
    assert len(read_ledger(tmp_path)) == 1


def test_summary_counts_percentiles_and_misses():
    s = summarise(ROWS, deadline_ms=25.0, **RUN)
    assert (s.sent, s.accepted, s.declined, s.dropped_total) == (23, 15, 5, 3)
    assert s.dropped == {"corrupt": 1, "timeout": 2}
    latencies = [10.0 + k for k in range(20)]
    assert s.e2e_ms_p50 == pytest.approx(np.percentile(latencies, 50))
    assert s.e2e_ms_p99 == pytest.approx(np.percentile(latencies, 99))
    assert s.e2e_ms_max == 29.0
    assert s.deadline_misses == 4
    assert s.median_E_T_m == pytest.approx(np.median([0.01 * (k + 1) for k in range(20) if k % 4 != 3]))
    assert [t.name for t in s.stages] == ["roi", "pnp"]


def test_books_that_do_not_add_up_are_an_error():
    with pytest.raises(AssertionError, match="does not add up"):
        summarise([*ROWS, row(23, "lost somewhere")], **RUN)


def test_pose_errors_of_known_poses():
    half_turn = pose_errors((0, 0, 0, 2.0), (0, 0, 1), (1, 0, 0, 0), (0, 3, 5))
    assert half_turn == pytest.approx((5.0, 180.0))
    assert pose_errors((-1, 0, 0, 0), (0, 0, 1), (1, 0, 0, 0), (0, 0, 1)) == (0.0, 0.0)
    assert pose_errors((0, 0, 0, 0), (0, 0, 1), (1, 0, 0, 0), (0, 0, 1)) == (0.0, 180.0)


@pytest.mark.parametrize("rows", [ROWS, ROWS[:1], ROWS[20:], []], ids=["all", "one", "only drops", "none"])
def test_a_report_of_any_ledger(tmp_path, rows):
    write(tmp_path, rows)
    page = write_report(tmp_path)
    text = page.read_text()
    for picture in re.findall(r'src="([^"]+)"', text):
        assert (tmp_path / picture).read_bytes().startswith(b"\x89PNG")
    assert f"{len(rows)} sent = " in text
    assert ("latency.png" in text) == any(r.e2e_ms is not None for r in rows)
    write_report(tmp_path)  # again, over itself


def test_no_ledger_is_one_sentence(tmp_path):
    with pytest.raises(UserError, match=r"no ledger at .*name a folder"):
        write_report(tmp_path)
    (tmp_path / "frames.csv").write_text("a,b\n1,2\n")
    with pytest.raises(UserError, match="has no column 'frame_id'"):
        write_report(tmp_path)
    write(tmp_path / "ok", ROWS[:2])
    (tmp_path / "ok" / "summary.json").write_text("{}")
    with pytest.raises(UserError, match=r"summary\.json is not a ledger summary"):
        write_report(tmp_path / "ok")


def test_the_processor_is_told_by_its_name() -> None:
    cpuinfo = Path("/proc/cpuinfo")
    told = cpuinfo.read_text(encoding="utf-8") if cpuinfo.exists() else ""
    name = re.search(r"^model name\s*:\s*(.+)$", told, re.MULTILINE)
    processor = this_machine().processor
    assert processor == name.group(1).strip() if name else processor
