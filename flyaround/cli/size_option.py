"""Sizes in pixels as typed on the command line."""

from __future__ import annotations

from flyaround.simulator.errors import UserError
from flyaround.simulator.runtime.untrusted_files import whole_number


def parse_size(text: str, option: str, bounds_px: tuple[int, int], example: str) -> tuple[int, int]:
    """Return width and height of a text such as ``1920x1200``.

    Parameters
    ----------
    text : str
        Value of the option.
    option : str
        Name of the option, for the message.
    bounds_px : tuple of int
        Smallest and largest side.
    example : str
        Example for the message.

    Raises
    ------
    UserError
        If it is not two whole numbers within the bounds.
    """
    least, most = bounds_px
    sides = [n for n in map(whole_number, text.lower().split("x")) if n is not None and least <= n <= most]
    if len(sides) != 2 or text.lower().count("x") != 1:
        raise UserError(
            f"{option} is '{text[:40]}', allowed: WIDTHxHEIGHT of {least} to {most} each, for example {example}"
        )
    return sides[0], sides[1]
