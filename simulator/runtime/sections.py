"""Base class of the typed tables in a user's file, and constraints on their numbers."""

from __future__ import annotations

from dataclasses import field, fields
from typing import Annotated, Any, TypeVar

import msgspec
from msgspec import Meta

Degrees = Annotated[float, Meta(ge=-360, le=360)]
Inclination = Annotated[float, Meta(ge=0, le=180)]
Rate = Annotated[float, Meta(ge=-90, le=90)]
Metres = Annotated[float, Meta(ge=-1e6, le=1e6)]
Range = Annotated[float, Meta(gt=0, le=1e5)]
Seconds = Annotated[float, Meta(gt=0, le=1e6)]
Speed = Annotated[float, Meta(ge=-1e3, le=1e3)]
Inertia = Annotated[float, Meta(gt=0, le=1e9)]
TorqueNm = Annotated[float, Meta(ge=-1e3, le=1e3)]
_T = TypeVar("_T")
Interval = tuple[_T, _T]
DirectionXyz = tuple[float, float, float]
MetresXyz = tuple[Metres, Metres, Metres]
SpeedXyz = tuple[Speed, Speed, Speed]


class Section(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A table of a file; keys that are not listed are refused. Angles are in degrees, as users write them."""


def bounded(default: float, low: float, high: float) -> Any:  # noqa: ANN401 - as of `dataclasses.field`
    """Declare a dataclass field with a default and bounds, for `bounds_of`.

    Returns
    -------
    dataclasses.Field
        Field whose metadata hold the smallest and the largest value. The type is Any, as that of `dataclasses.field`
        is.
    """
    return field(default=default, metadata={"bounds": (low, high)})


def bounds_of(kind: Any) -> dict[str, tuple[float, float]]:  # noqa: ANN401 - a dataclass or one of its instances
    """Return the bounds of a dataclass's fields.

    Returns
    -------
    dict of str to tuple of float
        Smallest and largest value by field name, in the order of the fields; fields without bounds are left out.
    """
    return {f.name: f.metadata["bounds"] for f in fields(kind) if f.metadata}


def within(bounds: tuple[float, float], per_unit: float = 1) -> Meta:
    """Return the constraint of a file's key by the bounds of the field that it sets.

    Parameters
    ----------
    bounds : tuple of float
        Lowest and highest value.
    per_unit : float, optional
        Units of the key per unit of the field.

    Returns
    -------
    msgspec.Meta
        Constraint for an annotated key.
    """
    low, high = (x if per_unit == 1 else float(f"{x * per_unit:.12g}") for x in bounds)
    return Meta(ge=low, le=high)
