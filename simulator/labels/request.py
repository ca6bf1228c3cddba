"""Requested labels of a frame besides truth record and mask."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from flyaround.simulator.labels.truth import FlowLabel

LAYERS = ("amodal", "parts", "depth", "normals", "flow", "clean", "wireframe")
"""Layer names; ``wireframe`` is part of the truth record, every other layer a file."""

SURFACE_LAYERS = frozenset({"parts", "normals"})


@dataclass(frozen=True, kw_only=True)
class LabelRequest:
    """Labels to produce.

    Parameters
    ----------
    layers : tuple of str, optional
        Names out of ``LAYERS``.
    flow : FlowLabel, optional
        Motion of the craft to the next frame; without it a frame has no optical flow.
    """

    layers: tuple[str, ...] = ()
    flow: FlowLabel | None = None


def parse_labels(text: str) -> tuple[str, ...]:
    """Parse layers from a comma-separated list, ``all`` or ``none``.

    Returns
    -------
    tuple of str
        Distinct layers in the order of ``LAYERS``; empty for ``none`` alone and for an empty text.

    Raises
    ------
    UserError
        If one is unknown.
    """
    names = {name.strip() for name in text.split(",") if name.strip()}
    for name in sorted(names):
        if name not in {*LAYERS, "all", "none"}:
            raise UserError(f"unknown label '{name}' in --labels; choose from all, none, {', '.join(LAYERS)}")
    return tuple(name for name in LAYERS if name in names or "all" in names)
