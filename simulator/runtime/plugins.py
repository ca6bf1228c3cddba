"""What other packages add: entry points of six groups, found by name and imported when one is used."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any, Literal

from flyaround.simulator.errors import UserError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

Kind = Literal["sensor", "format", "recipe", "estimator", "target", "body"]

GROUPS: dict[Kind, str] = {
    "sensor": "flyaround.sensors",
    "format": "flyaround.formats",
    "recipe": "flyaround.recipes",
    "estimator": "flyaround.estimators",
    "target": "flyaround.targets",
    "body": "flyaround.bodies",
}
"""The entry-point group of each kind; docs/plugins.md says what each entry point must be."""


@dataclass(frozen=True)
class Plugin:
    """One entry point.

    Parameters
    ----------
    name : by which it is asked for. package, version : that brought it.
    """

    kind: Kind
    name: str
    package: str
    version: str
    entry: EntryPoint

    def load(self) -> Any:  # noqa: ANN401 - what each kind must be is checked where it is used
        """What it names, imported now.

        Raises
        ------
        UserError
            If that fails, naming the package.
        """
        try:
            return self.entry.load()
        except Exception as error:
            said = " ".join(str(error).split())[:200]
            raise UserError(
                f"{self.title} cannot be imported ({type(error).__name__}: {said}); mend the package, or pip uninstall "
                f"{self.package}"
            ) from error

    @property
    def title(self) -> str:
        """In a sentence."""
        return f"{self.kind} {self.name} of package {self.package} {self.version}"

    def wrong(self, what: str) -> UserError:
        """The error of one that is not what its kind must be."""
        return UserError(f"{self.title} {what}; see docs/plugins.md, or pip uninstall {self.package}")


def plugins(kind: Kind) -> dict[str, Plugin]:
    """The entry points of a kind by name, sorted; none is imported yet."""
    # packages may come and go with the path
    return dict(_found(kind, tuple(sys.path)))


@lru_cache(maxsize=32)
def _found(kind: Kind, _path: tuple[str, ...]) -> tuple[tuple[str, Plugin], ...]:
    found: dict[str, Plugin] = {}
    for entry in sorted(entry_points(group=GROUPS[kind]), key=lambda e: e.name):
        package, version = ("?", "?") if entry.dist is None else (entry.dist.name, entry.dist.version)
        found.setdefault(entry.name, Plugin(kind, entry.name, package, version, entry))
    return tuple(found.items())
