"""Plug-ins: entry points of six groups in other packages, listed by name and imported when used."""

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
"""Entry-point group of each kind; docs/plugins.md documents the object that each must provide."""


@dataclass(frozen=True)
class Plugin:
    """One entry point of another package.

    Parameters
    ----------
    kind : Kind
        Kind of the plug-in.
    name : str
        Name of the entry point.
    package : str
        Distribution that provides the plug-in.
    version : str
        Version of that distribution.
    entry : importlib.metadata.EntryPoint
        Entry point from which it is loaded.
    """

    kind: Kind
    name: str
    package: str
    version: str
    entry: EntryPoint

    def load(self) -> Any:  # noqa: ANN401 - what each kind must be is checked where it is used
        """Import the object that the entry point names.

        Returns
        -------
        object
            Object as the package defines it; callers check that it meets its kind's contract.

        Raises
        ------
        UserError
            If the import fails, naming the package.
        """
        try:
            return self.entry.load()
        except Exception as error:
            reason = " ".join(str(error).split())[:200]
            raise UserError(
                f"{self.title} cannot be imported ({type(error).__name__}: {reason}); repair the package, or pip "
                f"uninstall {self.package}"
            ) from error

    @property
    def title(self) -> str:
        """Description for messages."""
        return f"{self.kind} {self.name} of package {self.package} {self.version}"

    def wrong(self, what: str) -> UserError:
        """Return the error for an object that does not meet its kind's contract.

        Returns
        -------
        UserError
            Error for the caller to raise: the plug-in's title, ``what``, and advice.
        """
        return UserError(f"{self.title} {what}; see docs/plugins.md, or pip uninstall {self.package}")


def plugins(kind: Kind) -> dict[str, Plugin]:
    """Return the installed plug-ins of a kind, without importing them.

    Returns
    -------
    dict of str to Plugin
        Plug-ins by name, sorted by name; a new dictionary.
    """
    # sys.path is part of the cache key: it determines which packages are found
    return dict(_entry_points(kind, tuple(sys.path)))


@lru_cache(maxsize=32)
def _entry_points(kind: Kind, _path: tuple[str, ...]) -> tuple[tuple[str, Plugin], ...]:
    by_name: dict[str, Plugin] = {}
    for entry in sorted(entry_points(group=GROUPS[kind]), key=lambda e: e.name):
        package, version = ("?", "?") if entry.dist is None else (entry.dist.name, entry.dist.version)
        by_name.setdefault(entry.name, Plugin(kind, entry.name, package, version, entry))
    return tuple(by_name.items())
