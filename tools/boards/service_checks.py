"""Checks of the service written by `--systemd-unit` under an emulated board's systemd, against docs/hil_board.md."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING

from flyaround.hil.host.bundle import write_bundle
from flyaround.hil.host.ledger.frames_csv import read_ledger
from flyaround.simulator.errors import UserError
from flyaround.simulator.targets.library import load_target
from tools.boards.emulator import emulated_board
from tools.boards.loops import SCENARIO, TARGET, free_port, pictures, run_host

if TYPE_CHECKING:
    from tools.boards.debian_image import BoardImage

HOST_WANTED, DONE = "a host is wanted", "all of the service is checked"
MAX_S = 1500.0  # time limit of the emulated board [s]


def check_service(image: BoardImage, folder: Path) -> list[str]:
    """Return the result of each check as a line that begins with ``holds:`` or ``FAILS:``.

    Raises
    ------
    UserError
        If the checks do not finish.
    """
    bundle, port = folder / "board.pyz", free_port()
    write_bundle(bundle, [load_target(TARGET)])
    pictures(SCENARIO, 1, folder / "pictures")
    script = f"target={TARGET} url=tcp://10.0.2.2:{port}\n" + Path(__file__).with_suffix(".sh").read_text(
        encoding="utf-8"
    )
    with emulated_board(image, {"run": script.encode(), "board.pyz": bundle.read_bytes()}, folder) as board:
        board.wait_for(HOST_WANTED, MAX_S)
        # the host ends when its board disappears
        with contextlib.suppress(UserError):
            run_host(
                SCENARIO, folder / "pictures", 1, f"tcp://127.0.0.1:{port}", folder / "host", wait_s=60.0
            )
        output = board.wait_for(DONE, MAX_S)
    declined = [row.reason for row in read_ledger(folder / "host") if row.outcome == "declined"]
    has_watchdog = any("watchdog" in reason for reason in declined)
    lines = [line for line in output.split("\n") if line.startswith(("holds:", "FAILS:"))]
    return [
        *lines,
        ("holds:" if has_watchdog else "FAILS:") + " the host receives the reason why its frame is declined",
    ]
