"""Command ``python -m tools.boards``: start an emulated board, test it, and write a board's row of the table.

``prove`` (`make board-qemu`) sends the same images to the host's own estimator and to an emulated board over each of
its lines; ``start`` leaves a board running for another host; ``service`` checks the systemd unit against its
documentation; ``compare`` writes a row from two ledgers.
"""

from __future__ import annotations

import argparse
import logging
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.files import empty_folder
from tools.boards.agreement import compare_runs, table_head
from tools.boards.debian_image import board_image
from tools.boards.loops import (
    LINES,
    SCENARIO,
    emulated_processor,
    pictures,
    run_here,
    run_host,
    scenario_of,
    served_board,
)
from tools.boards.service_checks import check_service

log = logging.getLogger(__name__)


def main() -> int:
    """Return the exit code: 0; 1 if a board disagrees with the host; 2 if an error prevents the comparison."""
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    options = _options()
    try:
        return {"prove": prove, "start": start, "service": service, "compare": compare}[options.command](
            options
        )
    except UserError as error:
        sys.stderr.write(f"{error}\n")
        return 2


def prove(options: argparse.Namespace) -> int:
    """Run the loop over each line and compare the board's answers with the host's."""
    empty_folder(options.output)
    image, runs = board_image(), []
    processor, system = emulated_processor()
    for line in (LINES[name] for name in options.lines):
        folder = options.output / line.name
        folder.mkdir()
        scenario = scenario_of(line, folder)
        log.info("%s: drawing %d pictures", line.text, options.n)
        pictures(scenario, options.n, folder / "pictures")
        log.info("running the host's estimator on them")
        host_rows = run_here(scenario, folder / "pictures", options.n, folder)
        log.info("running the emulated board: it needs seconds for each picture")
        with served_board(image, line, folder) as (_, url):
            run_host(scenario, folder / "pictures", options.n, url, folder / "board")
        runs.append(compare_runs(host_rows, folder / "board", processor, system, line.text))
    print(table_head(), *(run.row() for run in runs), sep="\n")
    return 0 if all(run.agreement.holds for run in runs) else 1


def start(options: argparse.Namespace) -> int:
    """Start a board that runs until Ctrl-C, and print the commands for it."""
    log.info("starting the board: half a minute or more")
    with (
        TemporaryDirectory() as name,
        served_board(board_image(), LINES[options.line], Path(name)) as (board, url),
    ):
        log.info("the board accepts hosts until Ctrl-C:")
        print(f"flyaround hil host {SCENARIO} -n 5 --timeout 300 --silence 120 --listen '{url}'")
        try:
            board.process.wait()
        except KeyboardInterrupt:
            return 0
    return 1


def service(options: argparse.Namespace) -> int:
    """Check the statements of docs/hil_board.md about the service under the emulated board's systemd."""
    empty_folder(options.output)
    lines = check_service(board_image(), options.output)
    print(*lines, sep="\n")
    return 0 if all(line.startswith("holds:") for line in lines) else 1


def compare(options: argparse.Namespace) -> int:
    """Print a board's row from its run and the host's run on the same images."""
    run = compare_runs(options.host, options.board, options.processor, options.system, options.link)
    print(table_head(), run.row(), sep="\n")
    return 0 if run.agreement.holds else 1


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tools.boards", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    command = commands.add_parser("prove", help="run the loop over each line of the emulated board")
    command.add_argument("-o", "--output", type=Path, default=Path("out/boards"), help="new or empty folder")
    command.add_argument("-n", type=int, default=60, help="images per line (default: 60)")
    command.add_argument("--lines", nargs="+", choices=LINES, default=list(LINES))
    command = commands.add_parser("start", help="start an emulated board until Ctrl-C")
    command.add_argument("--line", choices=LINES, default="net")
    command = commands.add_parser("service", help="test the service under the emulated board's systemd")
    command.add_argument(
        "-o", "--output", type=Path, default=Path("out/board-service"), help="new or empty folder"
    )
    command = commands.add_parser("compare", help="print a row of the table in docs/validation/boards.md")
    command.add_argument("host", type=Path, help="ledger of the host's estimator")
    command.add_argument("board", type=Path, help="ledger of the board, for the same images")
    for column in ("processor", "system", "link"):
        command.add_argument(f"--{column}", required=True, help="text for the table")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
