"""A frame as a graph of passes: each declares what it reads and writes, and their order is checked before they run.

After filament's ``fg`` and O'Donnell (2017), FrameGraph: Extensible Rendering Architecture in Frostbite, GDC. Theirs
also allocates textures and drops passes that nobody reads; here passes are few, keep their textures, and are dropped
where what they read is missing from the frame.
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
    """A pass reads what no pass before it writes, or touches what it did not declare."""


@dataclass(frozen=True, eq=False)
class Resource(Generic[T_co]):
    """A name for what passes hand on to each other: a texture, a view, a list of tiles. It carries its type."""

    name: str


class FrameResources:
    """Resources given to a frame's passes, or written by them, so far."""

    def __init__(self) -> None:
        self._values: dict[str, Any] = {}

    def __contains__(self, resource: object) -> bool:
        return isinstance(resource, Resource) and resource.name in self._values

    def __getitem__(self, resource: Resource[T]) -> T:
        """The resource's value; `KeyError` if it was never written."""
        value: T = self._values[resource.name]
        return value

    def __setitem__(self, resource: Resource[T], value: T | None) -> None:
        self._values[resource.name] = value

    def find(self, resource: Resource[T]) -> T | None:
        """The resource's value, or `None` if it is missing from this frame."""
        value: T | None = self._values.get(resource.name)
        return value

    def of(self, one: Pass) -> PassResources:
        """Return the resources as a pass may use them."""
        return PassResources(self._values, one)

    def has_all(self, resources: Iterable[Resource[object]]) -> bool:
        """Return True if none of the resources is missing from this frame."""
        for resource in resources:  # noqa: SIM110 - a generator would be called for each, in every pass of a frame
            if self._values.get(resource.name) is None:
                return False
        return True

    def fill(self, resources: Iterable[Resource[object]]) -> None:
        """Mark those of the resources that nobody wrote as missing from this frame."""
        values = self._values
        for resource in resources:
            if resource.name not in values:
                values[resource.name] = None


class PassResources:
    """A frame's resources as one pass may use them: reading and writing what it declared."""

    def __init__(self, values: dict[str, Any], of: Pass) -> None:
        self._values, self._pass = values, of

    def __getitem__(self, resource: Resource[T]) -> T:
        """A resource that the pass declared among its ``reads``."""
        if resource not in self._pass.reads:
            raise FrameGraphError(f"pass {self._pass.name} reads {resource.name}, which it did not declare")
        value: T = self._values[resource.name]
        return value

    def find(self, resource: Resource[T]) -> T | None:
        """A resource that the pass declared among its ``optional`` ones, or `None` if the frame has none."""
        if resource not in self._pass.optional:
            raise FrameGraphError(f"pass {self._pass.name} reads {resource.name}, which it did not declare")
        value: T | None = self._values.get(resource.name)
        return value

    def __setitem__(self, resource: Resource[T], value: T | None) -> None:
        if resource not in self._pass.writes:
            raise FrameGraphError(f"pass {self._pass.name} writes {resource.name}, which it did not declare")
        self._values[resource.name] = value


class Pass:
    """One step of a frame; a subclass declares its resources and implements `run`.

    Attributes
    ----------
    name : key in the frame's timings.
    reads : required resources; the pass is skipped when the frame lacks one of them.
    optional : resources that it uses when they are present.
    writes : resources that it makes or draws into.
    submits : flush the driver's commands after the pass. A software driver's threads then draw while the next pass is
        prepared.
    """

    name: str
    reads: tuple[Resource[object], ...] = ()
    optional: tuple[Resource[object], ...] = ()
    writes: tuple[Resource[object], ...] = ()
    submits: bool = False

    def run(self, r: PassResources) -> None:
        """Do it, with the resources that the pass declared."""
        raise NotImplementedError

    def release(self) -> None:
        """Free what the pass keeps on the GPU."""


class FrameGraph:
    """Passes in the order in which they run.

    Parameters
    ----------
    given : resources that are there before the first pass.

    Raises
    ------
    FrameGraphError
        If a pass reads what is neither given nor written by a pass before it.
    """

    def __init__(self, passes: Iterable[Pass], given: Container[Resource[object]] = ()) -> None:
        self._passes = tuple(passes)
        written: set[Resource[object]] = set()
        for one in self._passes:
            reads = (resource for resource in (*one.reads, *one.optional) if resource not in written)
            missing = [resource.name for resource in reads if resource not in given]
            if missing:
                raise FrameGraphError(
                    f"pass {one.name} reads {', '.join(missing)}, which no pass before it writes"
                )
            written.update(one.writes)

    def __iter__(self) -> Iterator[Pass]:
        return iter(self._passes)

    def run(
        self, context: moderngl.Context, resources: FrameResources, *, timed: bool = False
    ) -> dict[str, float]:
        """Run the passes that have all they read.

        Parameters
        ----------
        timed : wait for the driver after each pass, so that its time is its own.

        Returns
        -------
        Milliseconds per pass that ran, by name.
        """
        clock = StageClock(context, finish=timed)
        for one in self._passes:
            if resources.has_all(one.reads):
                one.run(resources.of(one))
                if one.submits:
                    flush(context)
                clock.lap(one.name)
            resources.fill(one.writes)
        return clock.stage_ms
