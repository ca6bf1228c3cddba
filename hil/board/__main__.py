"""``python -m hil.board URL --model FILE``: the board's agent, with nothing but argparse."""

from __future__ import annotations

import argparse
import logging
import sys
from typing import List, Optional

from hil.board.agent import run_board
from hil.link.errors import LinkError


def main(arguments: Optional[List[str]] = None) -> int:
    """Run the agent; exit code 0 after an orderly session, 1 when the host vanished, 2 for a mistake."""
    parser = argparse.ArgumentParser(prog="hil.board", description=main.__doc__)
    parser.add_argument("url", help="the host: tcp://HOST:PORT or serial:///dev/ttyS0?baud=921600")
    parser.add_argument("--model", required=True, help="board model file, e.g. tango.board.json")
    parser.add_argument("--method", default="svd", help="estimator (default: svd)")
    parser.add_argument("--timeout", type=float, default=60.0, help="seconds to wait for the host")
    parser.add_argument("--window", type=int, default=2, help="frames held at once")
    parser.add_argument("-v", "--verbose", action="store_true", help="say what happens")
    options = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO if options.verbose else logging.WARNING)
    try:
        summary = run_board(
            options.url,
            options.model,
            options.method,
            connect_timeout_s=options.timeout,
            window=options.window,
        )
    except LinkError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    except KeyboardInterrupt:
        sys.stderr.write("stopped from the keyboard\n")
        return 1
    sys.stdout.write(f"{summary.ended}: {summary.accepted} of {summary.frames} poses accepted\n")
    return 0 if summary.goodbye else 1


if __name__ == "__main__":
    sys.exit(main())
