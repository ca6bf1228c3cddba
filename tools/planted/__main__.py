"""``python -m tools.planted [NAME...]``: plants the bugs of ``bugs.toml`` and reports which ones the tests notice."""

from __future__ import annotations

import argparse
import sys
import time
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from tools.mutants.judge import NOTICED, Case, Verdict, copies, failing, judge, mirrored, say

if TYPE_CHECKING:
    from collections.abc import Iterable


class PlantedBug(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A replacement of text in one file.

    Parameters
    ----------
    file : str
        Path relative to the root.
    old, new : str
        Text that occurs once in the file, and its replacement.
    wrong : str
        Effect on a user, in one sentence.
    first : tuple of str
        Files and folders of tests that run before the wider ones.
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
            If the old text is not there, or more than once.
        """
        count = source.count(self.old)
        if count != 1:
            raise ValueError(f"bug {self.name}: its old text stands {count} times in {self.file}")
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
    """Run the program; see `--help`."""
    parser = argparse.ArgumentParser(prog="python -m tools.planted", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help="of bugs; all unless given")
    parser.add_argument("--at-once", type=int, default=2, help="bugs judged side by side")
    parser.add_argument("--narrow", action="store_true", help="run each bug's first tests alone")
    parser.add_argument(
        "--least", type=float, default=0.85, help="share to be noticed; below it the exit code is 1"
    )
    told = parser.parse_args()
    bugs = {bug.name: bug for bug in read_bugs() if not told.names or bug.name in told.names}
    if unknown := set(told.names) - set(bugs):
        parser.error(f"no bug is called {', '.join(sorted(unknown))}")
    root, started, verdicts = Path.cwd(), time.monotonic(), dict[str, Verdict]()

    def heard(case: Case, verdict: Verdict) -> None:
        verdicts[case.name] = verdict

    with copies(root, told.at_once) as made:
        judge((case_of(root, bug, bug.first) for bug in bugs.values()), made, heard)
        left = [bugs[name] for name, verdict in verdicts.items() if verdict.word not in NOTICED]
        if not told.narrow:
            judge((case_of(root, bug, [mirrored(bug.file)]) for bug in left), made, heard)
        wrong = failing(made[0], verdicts.values())
    missed = [n for n, v in verdicts.items() if v.word not in NOTICED or v.test in wrong]
    for name in missed:
        say(f"unnoticed: {name}: {bugs[name].wrong}")
    share = 1 - len(missed) / len(bugs)
    say(f"{len(bugs) - len(missed)} of {len(bugs)} noticed, {share:.0%}, {time.monotonic() - started:.0f} s")
    return 0 if share >= told.least else 1


if __name__ == "__main__":
    sys.exit(main())
