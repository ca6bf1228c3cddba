"""Keypoint states that the picture decides, against its clean twin, which leaves half a digital number open."""

import msgspec
import numpy as np
import pytest

from flyaround.simulator.dataset.check.signal import check_states_by_signal
from flyaround.simulator.labels.labelling import truth_record
from flyaround.simulator.labels.layers import clean_twin
from flyaround.simulator.labels.truth import Software
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight


@pytest.fixture(scope="module")
def plan():
    return plan_flight(load_scenario("tango-space-10m"), n=1)


def record_and_twin(plan, value):
    """The record of a picture of one value, and its clean twin."""
    scene = plan.scene(0)
    signal = np.full((scene.camera.height_px, scene.camera.width_px), value, np.float32)
    truth = truth_record(
        scene,
        plan.target,
        signal,
        lambda: min(value, 1.0),
        silhouette_inside=1.0,
        amodal=None,
        wireframe=False,
        software=Software(flyaround="0", gl_renderer="none"),
    )
    return truth, clean_twin(scene, signal)


@pytest.mark.parametrize(
    ("value", "labelled", "possible"),
    [
        (1.2, "saturated", {"saturated", "below_noise"}),
        # reads as full scale too, and is not
        (0.9985, "below_noise", {"saturated", "below_noise"}),
        (0.9, "below_noise", {"below_noise"}),
    ],
)
def test_what_reads_as_full_scale_may_be_half_a_step_below_it(plan, value, labelled, possible):
    truth, twin = record_and_twin(plan, value)
    seen = [k for k in truth.keypoints if k.state == labelled]
    assert len(seen) > 2
    assert check_states_by_signal(truth, twin) == []
    for state in ("visible", "saturated", "below_noise"):
        other = tuple(msgspec.structs.replace(k, state=state) if k in seen else k for k in truth.keypoints)
        wrong = check_states_by_signal(msgspec.structs.replace(truth, keypoints=other), twin)
        assert len(wrong) == (0 if state in possible else len(seen))
