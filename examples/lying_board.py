"""A board that misbehaves in one of five ways, to test that a campaign's requirements, or your own tests, notice it.

    python3 lying_board.py LIE 127.0.0.1 5600

dead: it hangs in its first frame and never sends anything again. slow: it answers each frame two seconds late.
off_by_one: its answers have the number of the next frame. lying: it accepts a pose that is far off, with impossible
times. silent: it takes each frame and its credit, answers clock requests, and sends no pose.

Exit codes are those of board_python.py, which implements everything else.
"""

from __future__ import annotations

import sys
import time
from functools import partial

import numpy as np
from board_python import Board, Line, run

LIES = ("dead", "slow", "off_by_one", "lying", "silent")
SLOW_S = 2.0
FAR_OFF = (0.0, 1.0, 0.0, 0.0), (100.0, -100.0, 1000.0)


class LyingBoard(Board):
    """A board with one misbehaviour."""

    def __init__(self, lie: str, line: Line) -> None:
        super().__init__(line)
        self.lie = lie

    def answer(self, frame_id: int, image: np.ndarray, received_ns: int) -> None:
        """Answer a frame with the misbehaviour."""
        if self.lie == "dead":
            self.line.socket.settimeout(None)
            while True:
                self.line.hear()
        if self.lie == "slow":
            time.sleep(SLOW_S)
        if self.lie == "off_by_one":
            super().answer(frame_id + 1, image, received_ns)
        elif self.lie == "lying":
            # of a wall clock, although the link counts from the start of the machine
            self.say_pose(frame_id, FAR_OFF, (time.time_ns(),) * 3)
            self.release(frame_id)
        elif self.lie == "silent":
            self.release(frame_id)
        else:
            super().answer(frame_id, image, received_ns)


def main() -> int:
    """Serve one session; return its exit code."""
    if len(sys.argv) != 4 or sys.argv[1] not in LIES:
        print(f"usage: lying_board.py {'|'.join(LIES)} HOST PORT", file=sys.stderr)
        return 2
    return run(partial(LyingBoard, sys.argv[1]), *sys.argv[2:])


if __name__ == "__main__":
    sys.exit(main())
