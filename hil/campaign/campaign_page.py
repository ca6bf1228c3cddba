"""Report page of a campaign: requirements with margins, matrix of cases and requirements, links to runs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from flyaround.hil.campaign.quantities import QUANTITIES
from flyaround.hil.campaign.verdicts import format_value, worst_verdict
from flyaround.simulator.reports.markup import Markup, element, markup
from flyaround.simulator.reports.page import Page, key_figures, link, note

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from flyaround.hil.campaign.definitions import Campaign, Requirement
    from flyaround.hil.campaign.verdicts import RunVerdict, Verdict

STYLE = """
.ok{color:#1d7a46;font-weight:600}.no{color:var(--bad);font-weight:600}
a.run{display:inline-block;min-width:30px;text-align:center;margin:0 4px 4px 0;padding:1px 5px;border-radius:5px;
text-decoration:none;font-size:13px;font-variant-numeric:tabular-nums;background:#dff1e6;color:#1d7a46}
a.run.no{background:#f8deda;color:var(--bad)}
ul.why{margin:2px 0 12px;padding-left:18px;font-size:13px;overflow-wrap:anywhere}
table.fold th{vertical-align:bottom}td small{display:block}
"""


def write_campaign_page(path: Path, campaign: Campaign, runs: Sequence[RunVerdict]) -> None:
    """Write the page; it links to the runs' folders next to it."""
    met = [_is_met(requirement, runs) for requirement in campaign.requirement]
    page = Page(campaign.title or campaign.name, width_px=1440, style=STYLE)
    failed = sum(not run.passed for run in runs)
    page.add(note(f"Campaign {campaign.name}: {len(campaign.case)} cases, each run with its seeds."))
    page.add(
        key_figures(
            [
                (len(runs), "runs"),
                (len(runs) - failed, "passed"),
                (failed, "failed"),
                (f"{sum(met)} of {len(met)}", "requirements met"),
            ],
            bad=["failed"] if failed else [],
        )
    )
    page.section(
        "Requirements",
        note(
            "The worst of all runs: one without a value, else a failed one, else the one with the least margin."
        ),
    )
    page.add_folding_table(
        ("requirement", "verdict", "quantity", "limit", "runs met", "worst", "margin", "its run"),
        [_requirement_row(r, runs) for r in campaign.requirement],
    )
    page.section(
        "Matrix",
        note("The worst run's value in each case, and the number of runs that meet the requirement."),
    )
    page.add_folding_table(
        ("case", "runs passed", *map(_column, campaign.requirement)),
        [_matrix_row(case.name, campaign, runs) for case in campaign.case],
    )
    page.section("Runs", note("Each number is a seed and links to its run's report."))
    for case in campaign.case:
        page.add(_runs_of(case.name, [run for run in runs if run.case == case.name]))
    page.write(path)


def _verdicts(requirement: Requirement, runs: Sequence[RunVerdict]) -> list[tuple[RunVerdict, Verdict]]:
    return [(run, v) for run in runs for v in run.verdicts if v.requirement is requirement]


def _is_met(requirement: Requirement, runs: Sequence[RunVerdict]) -> bool:
    return all(v.passed for _, v in _verdicts(requirement, runs))


def _sign(*, passed: bool) -> Markup:
    return element("span", "pass" if passed else "FAIL", class_="ok" if passed else "no")


def _value(verdict: Verdict) -> str:
    if verdict.value is None:
        return "\N{EN DASH}"
    return format_value(verdict.value, QUANTITIES[verdict.requirement.quantity].unit)


def _margin(verdict: Verdict) -> str:
    """Format a margin in the quantity's unit and as a share of the limit."""
    limit = verdict.requirement.limit
    if verdict.margin is None:
        return "\N{EN DASH}"
    share = f" ({verdict.margin / abs(limit):.0%})" if isinstance(limit, int | float) and limit else ""
    return format_value(verdict.margin, QUANTITIES[verdict.requirement.quantity].unit) + share


def _n_of_total(n: int, total: int) -> str:
    """Format two counts without a line break."""
    return f"{n} of {total}".replace(" ", "\N{NO-BREAK SPACE}")


def _report(run: RunVerdict, text: str, class_: str | None = None) -> Markup:
    file = "result.json" if run.failure else "report.html"
    return element("a", text, href=f"{run.folder}/{file}", class_=class_, title=run.reason or None)


def _requirement_row(requirement: Requirement, runs: Sequence[RunVerdict]) -> list[Markup | str]:
    verdicts = _verdicts(requirement, runs)
    worst = worst_verdict([v for _, v in verdicts])
    run = next(run for run, v in verdicts if v is worst)
    return [
        requirement.name,
        _sign(passed=all(v.passed for _, v in verdicts)),
        requirement.quantity,
        f"{requirement.comparison} {format_value(requirement.limit, QUANTITIES[requirement.quantity].unit)}",
        _n_of_total(sum(v.passed for _, v in verdicts), len(verdicts)),
        _value(worst),
        _margin(worst),
        _report(run, f"{run.case}, seed {run.seed}"),
    ]


def _column(requirement: Requirement) -> str:
    """Return a requirement's name with the unit of its column."""
    unit = QUANTITIES[requirement.quantity].unit
    return f"{requirement.name} [{unit}]" if unit else requirement.name


def _matrix_row(case: str, campaign: Campaign, runs: Sequence[RunVerdict]) -> list[Markup | str]:
    case_runs = [run for run in runs if run.case == case]
    n = sum(run.passed for run in case_runs)
    total = element("span", _n_of_total(n, len(case_runs)), class_="ok" if n == len(case_runs) else "no")
    row: list[Markup | str] = [case, total]
    for requirement in campaign.requirement:
        verdicts = [v for _, v in _verdicts(requirement, case_runs)]
        if not verdicts:
            row.append("")
            continue
        value = worst_verdict(verdicts).value
        short = "\N{EN DASH}" if value is None else format_value(value, digits=3)
        row.append(_cell(short, sum(v.passed for v in verdicts), len(verdicts)))
    return row


def _cell(text: str, passed: int, total: int) -> Markup:
    """Return a cell: a value above the number of runs that passed."""
    value = element("span", text, class_="ok" if passed == total else "no")
    return element("div", value, element("small", _n_of_total(passed, total)))


def _runs_of(case: str, runs: Sequence[RunVerdict]) -> Markup:
    why = [
        element("li", link(f"{run.folder}/", f"seed {run.seed}"), f": {run.reason}")
        for run in runs
        if not run.passed
    ]
    return markup(
        element("h3", case),
        [_report(run, str(run.seed), "run" if run.passed else "run no") for run in runs],
        element("ul", *why, class_="why") if why else None,
    )
