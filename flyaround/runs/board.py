"""Options of ``flyaround hil board``, one field per option of the bundle's agent, from the same tables."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, cast

import msgspec
import typer

from flyaround.hil.board.gige.options import CAMERA_OPTIONS, TITLE
from flyaround.hil.board.options import AGENT_OPTIONS, AgentOption
from flyaround.runs.document import Run
from flyaround.simulator.runtime.sections import Section

if TYPE_CHECKING:
    from collections.abc import Iterable


def _fields(table: Iterable[AgentOption], panel: str | None = None) -> list[tuple[str, Any, Any]]:
    """Return the fields of an option table."""
    return [
        (
            option.name,
            Annotated[
                option.kind if option.default is not None else option.kind | None,
                typer.Option(
                    option.flag, help=option.text, metavar=option.unit or None, rich_help_panel=panel
                ),
            ],
            option.default,
        )
        for option in table
    ]


BoardCamera = msgspec.defstruct(
    "BoardCamera",
    _fields(CAMERA_OPTIONS, TITLE),
    bases=(Section,),
    namespace={"__doc__": "GigE camera in place of a host."},
    frozen=True,
    kw_only=True,
)
BoardRun = cast(
    "type[Run]",
    msgspec.defstruct(
        "BoardRun",
        [
            (
                "url",
                Annotated[
                    str,
                    typer.Argument(
                        help="URL of the host: tcp://HOST:PORT or serial:///DEVICE?baud=N; or of a camera: gige://ADDRESS."
                    ),
                ],
            ),
            ("target", Annotated[str, typer.Option(help="Target name.")], "tango"),
            *_fields(AGENT_OPTIONS),
            ("at_camera", BoardCamera, BoardCamera()),
        ],
        bases=(Run,),
        namespace={"__doc__": "Options of ``flyaround hil board``: the board's side of the link."},
        tag="flyaround.run.hil-board",
        frozen=True,
        kw_only=True,
    ),
)
