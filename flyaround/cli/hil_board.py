"""hil board: the board agent on this machine, with the bundle's options."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import msgspec
import typer

from flyaround.cli.estimation import check_method
from flyaround.cli.run_options import with_run_options
from flyaround.cli.terminal import say
from flyaround.hil.board.agent import EstimatorFactory, describe_board, estimator_factory
from flyaround.hil.board.answering import BoardEstimator
from flyaround.hil.board.estimation import BoardModel, CameraIntrinsics
from flyaround.hil.board.gige.camera import SCHEME
from flyaround.hil.board.gige.camera_board import run_camera_board
from flyaround.hil.board.gige.options import camera_board_options, check_options
from flyaround.hil.board.options import make_agent
from flyaround.hil.board.service import ExitCode
from flyaround.hil.board.serving import NoSessionError, exit_at_once, exit_code, serve_sessions
from flyaround.hil.board_model.write import write_board_model
from flyaround.hil.evaluate.added_estimators import any_estimator
from flyaround.hil.evaluate.method_choice import MethodChoice
from flyaround.runs.board import BoardRun
from flyaround.runs.document import Run
from flyaround.simulator.runtime.plugins import plugins
from flyaround.simulator.targets.library import load_target

if TYPE_CHECKING:
    from flyaround.hil.board.frame_server import BoardSummary


@partial(with_run_options, kind=BoardRun)
def board(run: Run) -> None:
    """Run the board agent on this machine: connect, estimate, answer.

    The URL is the host's address, such as tcp://192.168.1.10:5600, or this end of a serial line, such as
    serial:///dev/ttyUSB0?baud=921600. Exit codes: 0, the host ended the session; 1, the connection was lost; 2, an
    argument is invalid; 3, the watchdog stopped the estimator; 4, no session could be started.

    With gige://ADDRESS the board reads a GigE camera through Aravis: that of hil camera, or a real one. Such a camera
    accepts no poses: they are written to a file, and sent to a host with --answer.
    """
    options = msgspec.structs.asdict(run)
    options |= msgspec.structs.asdict(options.pop("at_camera"))
    url, target = options["url"], options["target"]
    check_options(url, options)
    check_method(options["method"])
    with TemporaryDirectory() as folder:  # the key file is read only once
        path = Path(folder) / f"{target}.board.json"
        write_board_model(load_target(target), path)
        plugin_factory = (
            added_factory(path, options["method"]) if options["method"] in plugins("estimator") else None
        )
        if url.startswith(SCHEME):
            make, name, sha256 = plugin_factory or estimator_factory(path, options["method"])
        else:
            agent = make_agent(url, str(path), options, plugin_factory)
    if url.startswith(SCHEME):
        hello = describe_board(name, sha256, options["method"], compiled=True)
        _report_and_exit(run_camera_board(url, camera_board_options(options), make, hello))
        return
    try:
        summary = serve_sessions(agent, reconnect=options["reconnect"], start=[])
    except NoSessionError as error:
        say(f"flyaround: {error}", stderr=True)
        raise typer.Exit(ExitCode.NO_SESSION) from error
    _report_and_exit(summary)


def added_factory(model_path: Path, method: str) -> tuple[EstimatorFactory, str, str]:
    """Return a factory for an estimator of a plug-in, like ``estimator_factory`` for the built-in ones."""
    model = BoardModel.read(model_path)

    def make(camera: dict[str, Any]) -> BoardEstimator:
        return any_estimator(model, CameraIntrinsics.from_dict(camera), MethodChoice(method))

    return make, model.name, model.sha256


def _report_and_exit(summary: BoardSummary) -> None:
    """Print how the agent ended, and exit with its code unless it is 0."""
    say(f"{summary.frames} frames, {summary.accepted} accepted: {summary.ended}", stderr=True)
    if summary.hung:
        exit_at_once(ExitCode.WATCHDOG)
    if exit_code(summary):
        raise typer.Exit(exit_code(summary))
