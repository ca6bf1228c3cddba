"""Truth records changed at random that are still records: each is drawn again, or refused in a sentence."""

import json
import time
from dataclasses import replace

import msgspec
import numpy as np
import pytest
from mutations import changed_json
from peak_memory import peak_bytes

from flyaround.simulator.errors import UserError
from flyaround.simulator.frame import take_frame
from flyaround.simulator.labels.truth import read_truth
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.targets.library import load_target

pytestmark = pytest.mark.gl


def draw_changed(path, drawn, seed):
    """Draw so many records of which something was changed; how many were refused on the way."""
    rng, told = np.random.default_rng(seed), []
    plan = plan_flight(load_scenario("tango-flyaround"), n=1)
    scene = replace(plan.scene(0), camera=plan.scene(0).camera.resized(64))
    with Renderer() as renderer:
        record = json.loads(msgspec.json.encode(take_frame(renderer, scene, plan.target).truth))
        while drawn:
            changed = {**record, "scene": json.loads(changed_json(record["scene"], rng))}
            path.write_text(json.dumps(changed))
            start = time.monotonic()
            try:
                truth = read_truth(path)
                drawn -= 1
                take_frame(renderer, truth.scene, load_target(truth.scene.target.name))
            except UserError as error:
                told.append(str(error))
            assert time.monotonic() - start < 60, changed["scene"]
    assert not any("\n" in sentence for sentence in told)
    return len(told)


def test_changed_records_are_drawn_or_refused(tmp_path):
    assert draw_changed(tmp_path / "a.json", 4, 1) > 4


@pytest.mark.slow
def test_many_changed_records_are_drawn_or_refused(tmp_path):
    before = peak_bytes()
    for seed in range(2, 5):
        assert draw_changed(tmp_path / "a.json", 60, seed) > 100
    assert peak_bytes() - before < 1 << 30
