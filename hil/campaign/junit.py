"""JUnit XML of a campaign, for test viewers: a suite for each case, a test for each requirement of a run.

Times are those of the flight, so that the same runs give the same bytes: ``timestamp`` is the scenario's epoch, and
``time`` the duration of the approach.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from flyaround.hil.campaign.definitions import Campaign, ReadyCase
    from flyaround.hil.campaign.verdicts import RunVerdict

# Characters that XML 1.0 cannot represent
_UNWRITABLE = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def junit_xml(
    campaign: Campaign,
    cases: Sequence[ReadyCase],
    runs: Sequence[RunVerdict],
    durations_s: Mapping[tuple[str, int], float],
) -> bytes:
    """Return the document. All tests of a run without a result fail.

    Parameters
    ----------
    campaign : Campaign
        Campaign with its requirements.
    cases : sequence of ReadyCase
        Cases of the campaign.
    runs : sequence of RunVerdict
        Verdicts on the runs.
    durations_s : mapping of tuple of str and int to float
        Durations of the flights, by case and seed.
    """
    root = ET.Element("testsuites")
    for number, ready in enumerate(cases):
        case = ready.case
        case_runs = [run for run in runs if run.case == case.name]
        tests = [_test_case(campaign, run, k) for run in case_runs for k in range(max(1, len(run.verdicts)))]
        suite = ET.SubElement(
            root,
            "testsuite",
            {
                "id": str(number),
                "package": campaign.name,
                "name": case.name,
                "timestamp": ready.scenario.epoch_utc[:19],
                "hostname": "localhost",
                "tests": str(len(tests)),
                "failures": str(sum(test.find("failure") is not None for test in tests)),
                "errors": "0",
                "time": f"{sum(durations_s.get((run.case, run.seed), 0.0) for run in case_runs):.3f}",
            },
        )
        properties = ET.SubElement(suite, "properties")
        for name, value in (("scenario", case.scenario), ("pose", case.pose), ("mode", case.mode)):
            ET.SubElement(properties, "property", {"name": name, "value": _writable(value)})
        suite.extend(tests)
        ET.SubElement(suite, "system-out")
        ET.SubElement(suite, "system-err")
    ET.indent(root, " ")
    data: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return data + b"\n"


def _test_case(campaign: Campaign, run: RunVerdict, k: int) -> ET.Element:
    """Return the test of a requirement of a run, or of the run alone if it has no requirements."""
    verdict = run.verdicts[k] if run.verdicts else None
    name = f"seed {run.seed}" + (f": {verdict.requirement.name}" if verdict is not None else "")
    test = ET.Element(
        "testcase",
        {"name": _writable(name), "classname": f"{campaign.name}.{run.case}", "time": "0"},
    )
    why = run.failure or (verdict.sentence if verdict is not None and not verdict.passed else "")
    if why:
        kind = "run" if run.failure or verdict is None else verdict.requirement.quantity
        failure = ET.SubElement(test, "failure", {"message": _writable(why), "type": kind})
        failure.text = f"see {run.folder}"
    return test


def _writable(text: str) -> str:
    return _UNWRITABLE.sub("\N{REPLACEMENT CHARACTER}", text)
