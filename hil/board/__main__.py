"""Board agent: command ``python -m flyaround.hil.board URL --model FILE``.

With ``gige://ADDRESS --camera FILE`` the board reads a GigE camera directly. With ``--image FILE --camera FILE`` it
estimates one image and prints the result as JSON, which checks the installation.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import logging
import signal
import sys
from typing import Iterator, List, NoReturn, Optional

from flyaround.hil.board.agent import bundled_models, describe_board, estimator_factory
from flyaround.hil.board.gige.camera import SCHEME
from flyaround.hil.board.gige.camera_board import read_camera, run_camera_board
from flyaround.hil.board.gige.options import CAMERA_OPTIONS, TITLE, camera_board_options, check_options
from flyaround.hil.board.options import add_options, make_agent
from flyaround.hil.board.service import WATCHDOG_S, ExitCode, program_path, systemd_unit
from flyaround.hil.board.serving import NoSessionError, exit_at_once, exit_code, serve_sessions
from flyaround.hil.link.errors import LinkError


class AgentTerminated(KeyboardInterrupt):
    """Raised on SIGTERM, so that the agent ends as on Ctrl-C and cleans up."""


def main(arguments: Optional[List[str]] = None, program: str = "flyaround.hil.board") -> int:
    """Run the board's agent: connect to the host and answer its frames.

    Exit codes: 0, the host ended the session; 1, the connection was lost; 2, an argument is invalid; 3, the watchdog
    stopped the estimator; 4, no session could be started; 130 and 143, stopped by Ctrl-C or SIGTERM.
    """
    argv = sys.argv[1:] if arguments is None else arguments
    options = _options(argv, program)
    logging.basicConfig(level=logging.INFO if options.verbose else logging.WARNING)
    try:
        with _sigterm_as_exception():
            if options.url is not None:
                check_options(options.url, vars(options))
            if options.systemd_unit:
                sys.stdout.write(_systemd_unit(argv, options))
                return ExitCode.ORDERLY
            if options.image is not None:
                answer = _answer(options.image, options.camera, options.model, options.method)
                sys.stdout.write(answer + "\n")
                return ExitCode.ORDERLY
            if options.url.startswith(SCHEME):
                return _serve_camera(options)
            return _serve(options, argv, program)
    except LinkError as error:
        sys.stderr.write(f"{error}\n")
        return ExitCode.NO_SESSION if isinstance(error, NoSessionError) else ExitCode.MISTAKE
    except AgentTerminated:
        sys.stderr.write("terminated\n")
        return ExitCode.TERMINATED
    except KeyboardInterrupt:
        sys.stderr.write("stopped from the keyboard\n")
        return ExitCode.INTERRUPTED


def run_and_exit(program: str) -> NoReturn:
    """Run `main` and exit without waiting for a hung estimator."""
    exit_at_once(main(program=program))


def _options(arguments: List[str], program: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog=program, description=main.__doc__)
    parser.add_argument(
        "url",
        nargs="?",
        help="The host: tcp://HOST:PORT or serial:///dev/ttyS0?baud=921600; or a camera: gige://ADDRESS",
    )
    names = ", ".join(bundled_models())
    parser.add_argument(
        "--model",
        required=True,
        help="Board model file, e.g. tango.board.json" + (f"; or a bundled one: {names}" if names else ""),
    )
    add_options(parser)
    add_options(parser.add_argument_group(TITLE), CAMERA_OPTIONS)
    parser.add_argument(
        "--systemd-unit", action="store_true", help="Print a unit that runs this as a service, and exit."
    )
    parser.add_argument("--image", help="Estimate one PNG, taken with --camera, without a host.")
    parser.add_argument("-v", "--verbose", action="store_true", help="Log progress.")
    options = parser.parse_args(arguments)
    if (options.url is None) == (options.image is None):
        parser.error("give the host's URL, or --image and --camera")
    return options


def _systemd_unit(argv: List[str], options: argparse.Namespace) -> str:
    arguments = [word for word in argv if word != "--systemd-unit"]
    if not options.reconnect:
        arguments.append("--reconnect")
    if options.watchdog is None:
        arguments += ["--watchdog", f"{WATCHDOG_S:g}"]
    return systemd_unit(program_path(sys.argv[0]), arguments, options.url or "")


def _serve(options: argparse.Namespace, argv: List[str], program: str) -> int:
    """Serve the host, once, or repeatedly with ``--reconnect``, and return the exit code."""
    start = [sys.argv[0]] if program.endswith(".pyz") else ["-m", program]
    agent = make_agent(options.url, options.model, vars(options))
    summary = serve_sessions(agent, reconnect=options.reconnect, start=[*start, *argv])
    sys.stdout.write(f"{summary.ended}: {summary.accepted} of {summary.frames} poses accepted\n")
    return exit_code(summary)


def _serve_camera(options: argparse.Namespace) -> int:
    """Estimate poses on a camera's stream and return the exit code."""
    camera_options = camera_board_options(vars(options))
    make, name, sha256 = estimator_factory(options.model, options.method)
    hello = describe_board(name, sha256, options.method, compiled=True)
    summary = run_camera_board(options.url, camera_options, make, hello)
    # standard output may carry the poses
    sys.stderr.write(f"{summary.ended}: {summary.accepted} of {summary.frames} poses accepted\n")
    return exit_code(summary)


@contextlib.contextmanager
def _sigterm_as_exception() -> Iterator[None]:
    def stop(_number: int, _frame: object) -> None:
        raise AgentTerminated

    try:
        before = signal.signal(signal.SIGTERM, stop)
    except ValueError:  # not the main thread: the caller handles signals
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _answer(image: str, camera: Optional[str], model: str, method: str) -> str:
    """Return the pose of one image as JSON.

    Raises
    ------
    LinkError
        If a file cannot be used; the message is one sentence.
    """
    import cv2  # noqa: PLC0415 - optional: an own estimator may not need OpenCV

    from flyaround.hil.board.encoding import linear_picture  # noqa: PLC0415 - the same
    from flyaround.hil.board.hybrid.native.library import describe_library  # noqa: PLC0415 - the same

    if camera is None:
        raise LinkError("--image needs the camera it was taken with: name its file with --camera")
    make, _, _ = estimator_factory(model, method)
    try:
        intrinsics = read_camera(camera)
        estimator = make(intrinsics)
    except ValueError as error:
        raise LinkError(
            f"camera {camera} cannot be used ({error}): give the camera object of a truth record"
        ) from error
    cv2.setNumThreads(1)
    try:
        picture = cv2.imread(image, cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise LinkError(f"picture {image} cannot be used: it is damaged or too large") from error
    encoding = str(intrinsics.get("encoding", "linear"))
    try:
        result = estimator.estimate(None if picture is None else linear_picture(picture, encoding))
    except ValueError as error:
        raise LinkError(f"picture {image} cannot be used: {error}") from error
    q, t = result.q_camera_from_target_wxyz, result.t_camera_from_target_m
    return json.dumps(
        {
            "accepted": bool(result.accepted),
            "reason": result.reason,
            "q_camera_from_target_wxyz": None if q is None else [float(v) for v in q],
            "t_camera_from_target_m": None if t is None else [float(v) for v in t],
            "confidence": float(result.confidence),
            "stages_ms": {name: float(ms) for name, ms in result.stages_ms.items()},
            "kernels": describe_library(),
        }
    )


if __name__ == "__main__":
    run_and_exit("flyaround.hil.board")
