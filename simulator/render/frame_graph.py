"""A frame as a graph of passes: each declares its inputs and outputs, and their order is checked before they run.

After filament's ``fg`` and O'Donnell (2017), FrameGraph: Extensible Rendering Architecture in Frostbite, GDC. Those
also allocate textures and drop unused passes; here passes keep their textures, and are skipped if an input is missing
from the frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from flyaround.simulator.render.gl.fences import flush
from flyaround.simulator.render.gl.timing import StageClock

if TYPE_CHECKING:
    from collections.abc import Container, Iterable, Iterator

    import moderngl

T = TypeVar("T")
T_co = TypeVar("T_co", covariant=True)


class FrameGraphError(RuntimeError):
    """A pass reads a resource that no earlier pass writes, or uses one that it did not declare."""


@dataclass(frozen=True, eq=False)
class Resource(Generic[T_co]):
    """A typed key of a resource that passes share: a texture, a view, a list of tiles; equal to itself alone."""

    name: str


class FrameResources:
    """Resources given to a frame's passes, or written by them, so far.

    A resource is present, with a value; or missing from this frame, with the value `None`; or unknown, before a pass
    that could write it has run or was skipped. The last alone is not ``in`` the resources.
    """

    def __init__(self) -> None:
        self._values: dict[object, Any] = {}

    def __contains__(self, resource: object) -> bool:
        return resource in self._values

    def __getitem__(self, resource: Resource[T]) -> T:
        """Return the resource's value, None if it is missing from this frame; raise `KeyError` if it is unknown."""
        value: T = self._values[resource]
        return value

    def __setitem__(self, resource: Resource[T], value: T | None) -> None:
        self._values[resource] = value

    def find(self, resource: Resource[T]) -> T | None:
        """Return the resource's value, or `None` if it is missing from this frame or unknown."""
        value: T | None = self._values.get(resource)
        return value

    def for_pass(self, current: Pass) -> PassResources:
        """Return the resources that a pass may use."""
        return PassResources(self._values, current)

    def has_all(self, resources: Iterable[Resource[object]]) -> bool:
        """Return True if all of the resources are present."""
        for resource in resources:  # noqa: SIM110 - a generator would be called for each, in every pass of a frame
            if self._values.get(resource) is None:
                return False
        return True

    def fill(self, resources: Iterable[Resource[object]]) -> None:
        """Mark the unknown ones of these resources as missing from this frame."""
        values = self._values
        for resource in resources:
            if resource not in values:
                values[resource] = None


class PassResources:
    """A frame's resources, restricted to those that one pass declared; any other raises `FrameGraphError`."""

    def __init__(self, values: dict[object, Any], current: Pass) -> None:
        self._values, self._pass = values, current

    def __getitem__(self, resource: Resource[T]) -> T:
        """Return a resource that the pass declared in its ``reads``."""
        if resource not in self._pass.reads:
            raise FrameGraphError(f"pass {self._pass.name} reads {resource.name}, which it did not declare")
        value: T = self._values[resource]
        return value

    def find(self, resource: Resource[T]) -> T | None:
        """Return a resource that the pass declared as ``optional``, or `None` if it is missing from the frame."""
        if resource not in self._pass.optional:
            raise FrameGraphError(f"pass {self._pass.name} reads {resource.name}, which it did not declare")
        value: T | None = self._values.get(resource)
        return value

    def __setitem__(self, resource: Resource[T], value: T | None) -> None:
        if resource not in self._pass.writes:
            raise FrameGraphError(f"pass {self._pass.name} writes {resource.name}, which it did not declare")
        self._values[resource] = value


class Pass:
    """One step of a frame; a subclass declares its resources and implements `run`.

    Attributes
    ----------
    name : str
        Key in the frame's timings.
    reads : tuple of Resource
        Required resources; the pass is skipped if one is missing from the frame.
    optional : tuple of Resource
        Resources that it uses if they are present.
    writes : tuple of Resource
        Resources that it creates or draws into.
    submits : bool
        True to flush the driver's commands after the pass. A software driver's threads then draw while the next pass is
        prepared.
    """

    name: str
    reads: tuple[Resource[object], ...] = ()
    optional: tuple[Resource[object], ...] = ()
    writes: tuple[Resource[object], ...] = ()
    submits: bool = False

    def run(self, r: PassResources) -> None:
        """Run the pass with the resources that it declared."""
        raise NotImplementedError

    def release(self) -> None:
        """Free the pass's resources on the GPU."""


class FrameGraph:
    """Passes in the order in which they run.

    Parameters
    ----------
    passes : iterable of Pass
        Passes, each after those that write its resources.
    given : container of Resource, optional
        Resources available to the first pass.

    Raises
    ------
    FrameGraphError
        If a pass reads a resource that is neither given nor written by an earlier pass.
    """

    def __init__(self, passes: Iterable[Pass], given: Container[Resource[object]] = ()) -> None:
        self._passes = tuple(passes)
        available: set[Resource[object]] = set()
        for current in self._passes:
            reads = (*current.reads, *current.optional)
            missing = [r.name for r in reads if r not in available and r not in given]
            if missing:
                raise FrameGraphError(
                    f"pass {current.name} reads {', '.join(missing)}, which no pass before it writes"
                )
            available.update(current.writes)

    def __iter__(self) -> Iterator[Pass]:
        return iter(self._passes)

    def run(
        self, context: moderngl.Context, resources: FrameResources, *, timed: bool = False
    ) -> dict[str, float]:
        """Run the passes whose required resources are present.

        Parameters
        ----------
        context : moderngl.Context
            Context in which the passes draw.
        resources : FrameResources
            Given resources; the passes add theirs.
        timed : bool, optional
            True to wait for the driver after each pass, so that times are per pass.

        Returns
        -------
        dict
            Milliseconds per pass that ran, by name.
        """
        clock = StageClock(context, finish=timed)
        for current in self._passes:
            if resources.has_all(current.reads):
                current.run(resources.for_pass(current))
                if current.submits:
                    flush(context)
                clock.lap(current.name)
            resources.fill(current.writes)
        return clock.stage_ms
