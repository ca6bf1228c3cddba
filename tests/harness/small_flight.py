"""A flight about Tango's coarsest level on a small image: frames that are drawn in a moment."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import msgspec

from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import Plan, plan_flight


def small_flight(width_px: int, **how: Any) -> Plan:
    """Plan a draft of ``tango-flyaround`` for an image of a width; ``how`` goes to ``plan_flight``."""
    scenario = msgspec.structs.replace(load_scenario("tango-flyaround"), target="tango@low")
    plan = plan_flight(scenario, quality="draft", **how)
    return replace(plan, camera=plan.camera.resized(width_px))
