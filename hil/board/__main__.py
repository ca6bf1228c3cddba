"""``python -m hil.board URL --model FILE``: the board's agent, with nothing but argparse.

Also ``--image FILE --camera FILE``: one answer as JSON, to see that a board can do it at all.
"""

from __future__ import annotations

import argparse
import json
import logging
import sys
from typing import List, Optional

from hil.board.agent import bundled_models, run_board, svd_factory
from hil.board.files import read_bounded
from hil.link.errors import LinkError
from hil.link.security import read_key

# of a camera file: thousands of times what one takes
MOST_BYTES = 10_000_000


def main(arguments: Optional[List[str]] = None, program: str = "hil.board") -> int:
    """Run the agent; exit code 0 after an orderly session, 1 when the host vanished, 2 for a mistake."""
    parser = argparse.ArgumentParser(prog=program, description=main.__doc__)
    parser.add_argument("url", nargs="?", help="the host: tcp://HOST:PORT or serial:///dev/ttyS0?baud=921600")
    names = ", ".join(bundled_models())
    parser.add_argument(
        "--model",
        required=True,
        help="board model file, e.g. tango.board.json"
        + (f"; or one that is built in: {names}" if names else ""),
    )
    parser.add_argument("--method", default="svd", help="estimator (default: svd)")
    parser.add_argument("--timeout", type=float, default=60.0, help="seconds to wait for the host")
    parser.add_argument("--key", help="file with the key that the host asks for")
    parser.add_argument("--window", type=int, default=2, help="frames held at once")
    parser.add_argument("--image", help="estimate one PNG instead of meeting a host")
    parser.add_argument("--camera", help="CAMERA.json of the image")
    parser.add_argument("-v", "--verbose", action="store_true", help="say what happens")
    options = parser.parse_args(arguments)
    if (options.url is None) == (options.image is None):
        parser.error("give the host's URL, or --image and --camera")
    logging.basicConfig(level=logging.INFO if options.verbose else logging.WARNING)
    try:
        if options.image is not None:
            sys.stdout.write(_answer(options.image, options.camera, options.model, options.method) + "\n")
            return 0
        summary = run_board(
            options.url,
            options.model,
            options.method,
            connect_timeout_s=options.timeout,
            window=options.window,
            key=None if options.key is None else read_key(options.key),
        )
    except LinkError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    except KeyboardInterrupt:
        sys.stderr.write("stopped from the keyboard\n")
        return 1
    sys.stdout.write(f"{summary.ended}: {summary.accepted} of {summary.frames} poses accepted\n")
    return 0 if summary.goodbye else 1


def _answer(image: str, camera: Optional[str], model: str, method: str) -> str:
    """One picture's pose as JSON.

    Raises
    ------
    LinkError
        If a file cannot be used: one sentence.
    """
    import cv2  # noqa: PLC0415 - a board that only relays has none

    from hil.board.svd.native.backend import describe_backend  # noqa: PLC0415 - the same

    if camera is None:
        raise LinkError("--image needs the camera it was taken with: name its file with --camera")
    make, _, _ = svd_factory(model, method)
    try:
        estimator = make(json.loads(read_bounded(camera, MOST_BYTES).decode("utf-8")))
    except (OSError, ValueError, RecursionError) as error:
        raise LinkError(
            f"camera {camera} cannot be used ({error}): give the camera object of a truth record"
        ) from error
    cv2.setNumThreads(1)
    result = estimator.estimate(cv2.imread(image, cv2.IMREAD_UNCHANGED))
    q, t = result.q_camera_from_target_wxyz, result.t_camera_from_target_m
    return json.dumps(
        {
            "accepted": bool(result.accepted),
            "reason": result.reason,
            "q_camera_from_target_wxyz": None if q is None else [float(v) for v in q],
            "t_camera_from_target_m": None if t is None else [float(v) for v in t],
            "confidence": float(result.confidence),
            "stages_ms": {name: float(ms) for name, ms in result.stages_ms.items()},
            "kernels": describe_backend(),
        }
    )


if __name__ == "__main__":
    sys.exit(main())
