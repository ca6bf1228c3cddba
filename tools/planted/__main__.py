"""``python -m tools.planted [NAME...]``: plant the bugs of ``bugs.toml`` and report which ones the tests detect."""

from __future__ import annotations

import argparse
import sys
import time
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from tools.mutants.judge import DETECTED, Case, Verdict, copies, failing, judge, mirrored, say

if TYPE_CHECKING:
    from collections.abc import Iterable


class PlantedBug(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A replacement of text in one file.

    Parameters
    ----------
    name : str
        Name on the command line.
    file : str
        Path relative to the root.
    old : str
        Text that occurs once in the file.
    new : str
        Replacement of ``old``.
    wrong : str
        Effect on a user, in one sentence.
    first : tuple of str
        Files and folders of tests that run before the others.
    """

    name: str
    file: str
    old: str
    new: str
    wrong: str
    first: tuple[str, ...]

    def planted(self, source: str) -> str:
        """Return the file's text with the bug.

        Raises
        ------
        ValueError
            If the old text does not occur exactly once.
        """
        count = source.count(self.old)
        if count != 1:
            raise ValueError(f"bug {self.name}: its old text occurs {count} times in {self.file}")
        return source.replace(self.old, self.new)


def read_bugs() -> tuple[PlantedBug, ...]:
    """Return the bugs in the order of ``bugs.toml``."""
    document = tomllib.loads(Path(__file__).with_name("bugs.toml").read_text(encoding="utf-8"))
    return msgspec.convert(document["bug"], tuple[PlantedBug, ...])


def case_of(root: Path, bug: PlantedBug, tests: Iterable[str]) -> Case:
    """Return the judge's case: the file with and without the bug, and the tests."""
    source = (root / bug.file).read_text(encoding="utf-8")
    return Case(bug.name, bug.file, source, bug.planted(source), tuple(tests))


def main() -> int:
    """Judge the bugs and return the exit code: 1 if too few are detected."""
    parser = argparse.ArgumentParser(prog="python -m tools.planted", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="names of bugs (default: all)")
    parser.add_argument("--at-once", type=int, default=2, help="bugs judged concurrently")
    parser.add_argument("--narrow", action="store_true", help="run only each bug's first tests")
    parser.add_argument(
        "--least",
        type=float,
        default=0.85,
        help="minimum share of detected bugs; the exit code is 1 below it",
    )
    options = parser.parse_args()
    bugs = {bug.name: bug for bug in read_bugs() if not options.names or bug.name in options.names}
    if unknown := set(options.names) - set(bugs):
        parser.error(f"no bug has the name {', '.join(sorted(unknown))}")
    root, started, verdicts = Path.cwd(), time.monotonic(), dict[str, Verdict]()

    def heard(case: Case, verdict: Verdict) -> None:
        verdicts[case.name] = verdict

    with copies(root, options.at_once) as trees:
        judge((case_of(root, bug, bug.first) for bug in bugs.values()), trees, heard)
        undetected = [bugs[name] for name, verdict in verdicts.items() if verdict.word not in DETECTED]
        if not options.narrow:
            judge((case_of(root, bug, [mirrored(bug.file)]) for bug in undetected), trees, heard)
        wrong = failing(trees[0], verdicts.values())
    missed = [n for n, v in verdicts.items() if v.word not in DETECTED or v.test in wrong]
    for name in missed:
        say(f"unnoticed: {name}: {bugs[name].wrong}")
    share = 1 - len(missed) / len(bugs)
    say(f"{len(bugs) - len(missed)} of {len(bugs)} detected, {share:.0%}, {time.monotonic() - started:.0f} s")
    return 0 if share >= options.least else 1


if __name__ == "__main__":
    sys.exit(main())
