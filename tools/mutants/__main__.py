"""``python -m tools.mutants``: judge a seeded sample of cosmic-ray's mutants and record them in its session file.

``cr-report --surviving-only --show-diff SESSION`` prints the mutants that no test detected. An interrupted session
continues; delete the session of an older version of the sources by hand.
"""

from __future__ import annotations

import argparse
import ast
import random
import sys
from difflib import unified_diff
from pathlib import Path
from typing import TYPE_CHECKING

import cosmic_ray.plugins
from attrs import evolve
from cosmic_ray.commands import init
from cosmic_ray.mutating import mutate_code
from cosmic_ray.tools.survival_rate import survival_rate
from cosmic_ray.work_db import use_db
from cosmic_ray.work_item import TestOutcome, WorkerOutcome, WorkItem, WorkResult

from tools.mutants.judge import DETECTED, Case, Verdict, copies, failing, judge, mirrored, say

if TYPE_CHECKING:
    from collections.abc import Sequence

SCOPE = (
    "simulator/world",
    "simulator/geometry",
    "simulator/camera",
    "simulator/imaging",
    "simulator/labels",
    "simulator/scene",
    "simulator/dataset",
    "hil/link",
    "hil/host",
    "hil/evaluate",
)
PAGES_AND_PLOTS = ("evaluation_page.py", "evaluation_plots.py", "failure_tiles.py", "report_plots.py")
"""Files whose pages and plots no fast test can judge."""
# unions in type hints and decorators that save time: their mutants survive without meaning
LEFT_OUT = ("BitOr", "RemoveDecorator")


def files(root: Path, only: Sequence[str] = ()) -> list[str]:
    """Return the files to mutate, relative to the root, in order.

    Parameters
    ----------
    root : Path
        Root of the checkout.
    only : sequence of str
        Prefixes of paths; empty for all files.
    """
    paths = [p for folder in SCOPE for p in (root / folder).rglob("*.py") if p.name not in PAGES_AND_PLOTS]
    names = sorted(path.relative_to(root).as_posix() for path in paths)
    return [name for name in names if name.startswith(tuple(only) or "")]


def draw(root: Path, names: Sequence[str], n: int, seed: int) -> list[WorkItem]:
    """Draw mutants: a file in proportion to its number of lines, one of its mutable lines, and a mutation."""
    chance = random.Random(seed)
    sources = {name: (root / name).read_text(encoding="utf-8") for name in names}
    weights = [source.count("\n") for source in sources.values()]
    places: dict[str, dict[int, list[WorkItem]]] = {}
    drawn: dict[object, WorkItem] = {}
    for _ in range(10 * n):
        name = chance.choices(names, weights)[0]
        if name not in places:
            places[name] = _mutants(Path(name), root, sources[name])
        if places[name]:
            item = chance.choice(places[name][chance.choice(sorted(places[name]))])
            spec = item.mutations[0]
            drawn.setdefault((name, spec.operator_name, spec.occurrence), item)
        if len(drawn) == n:
            break
    return list(drawn.values())


def _mutants(file: Path, root: Path, source: str) -> dict[int, list[WorkItem]]:
    """Return cosmic-ray's mutants of a file by line, without lines whose change affects no result."""
    quiet: set[int] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Raise) or (
            isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        ):
            quiet |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
        for decorator in getattr(node, "decorator_list", ()):
            quiet.add(decorator.lineno)
    with use_db(":memory:") as db:
        init([root / file], db, {})
        items = db.work_items
    by_line: dict[int, list[WorkItem]] = {}
    for item in items:
        spec = item.mutations[0]
        if spec.start_pos[0] not in quiet and not any(word in spec.operator_name for word in LEFT_OUT):
            by_line.setdefault(spec.start_pos[0], []).append(item)
    return by_line


def case_of(root: Path, item: WorkItem) -> Case:
    """Return a mutant as a case for the judge: the tests named after its file come first, then those of its folder."""
    spec = item.mutations[0]
    path = spec.module_path
    source = path.read_text(encoding="utf-8")
    operator = cosmic_ray.plugins.get_operator(spec.operator_name)(**spec.operator_args)
    file = path.relative_to(root).as_posix()
    named = sorted(p.relative_to(root).as_posix() for p in root.glob(f"tests/**/test_{path.stem}.py"))
    name = f"{item.job_id[:8]} {file}:{spec.start_pos[0]} {spec.operator_name.removeprefix('core/')}"
    after = mutate_code(source, operator, spec.occurrence) or source
    return Case(name, file, source, after, (*named, mirrored(file)))


def main() -> int:
    """Judge the mutants and return the exit code: 1 if too few are detected."""
    parser = argparse.ArgumentParser(prog="python -m tools.mutants", description=__doc__)
    parser.add_argument("-n", type=int, default=200, help="number of mutants (default: 200)")
    parser.add_argument("--seed", type=int, default=22)
    parser.add_argument("--only", nargs="*", default=(), help="prefixes of paths (default: all folders)")
    parser.add_argument("--at-once", type=int, default=2, help="mutants judged concurrently")
    parser.add_argument(
        "--least",
        type=float,
        default=0.8,
        help="minimum share of detected mutants; the exit code is 1 below it",
    )
    parser.add_argument(
        "-o", type=Path, default=Path("out/mutants.sqlite"), help="session file of cosmic-ray"
    )
    options = parser.parse_args()
    root = Path.cwd()
    options.o.parent.mkdir(parents=True, exist_ok=True)
    with use_db(str(options.o)) as db, copies(root, options.at_once) as trees:
        if not db.num_work_items:
            db.add_work_items(draw(root, files(root, options.only), options.n, options.seed))
        waiting = {case_of(root, item): item.job_id for item in db.pending_work_items}

        def keep(case: Case, verdict: Verdict) -> None:
            outcome = TestOutcome.KILLED if verdict.word in DETECTED else TestOutcome.SURVIVED
            diff = "\n".join(
                unified_diff(case.before.splitlines(), case.after.splitlines(), lineterm="", n=0)
            )
            result = WorkResult(WorkerOutcome.NORMAL, f"{verdict.word} {verdict.test}", outcome, diff)
            db.set_result(waiting[case], result)

        judge(waiting, trees, keep)
        noticed = [(item, result) for item, result in db.completed_work_items if result.is_killed]
        wrong = failing(trees[0], (Verdict("killed", r.output.partition(" ")[2]) for _, r in noticed))
        for item, result in noticed:
            if result.output.partition(" ")[2] in wrong:
                db.set_result(item.job_id, evolve(result, test_outcome=TestOutcome.SURVIVED))
        share = 1 - survival_rate(db) / 100
    say(f"{share:.0%} detected; cr-report --surviving-only --show-diff {options.o} prints the survivors")
    return 0 if share >= options.least else 1


if __name__ == "__main__":
    sys.exit(main())
