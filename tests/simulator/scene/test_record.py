"""Records of scenes: what older ones do not say is read as it was drawn."""

from dataclasses import replace
from pathlib import Path

import msgspec

from flyaround.simulator.labels.truth import read_truth
from flyaround.simulator.scene.environments import Environment
from flyaround.simulator.scene.record import SceneRecord

OLD = Path(__file__).parents[2] / "data" / "v0.1" / "truth.json"


def test_a_record_without_aerosol_and_airglow_has_those_that_it_was_drawn_with():
    world = read_truth(OLD).scene.environment
    assert type(world) is Environment
    # version 0.2 and before: 4.44e-6 to a metre at the ground, 1.2 km high
    assert (world.aerosol_optical_depth, world.airglow) == (0.0053, False)


def test_a_record_gives_back_the_air_of_its_scene():
    scene = read_truth(OLD).scene
    hazy = msgspec.structs.replace(scene.environment, aerosol_optical_depth=0.2, airglow=True)
    record = SceneRecord.from_scene(replace(scene, environment=hazy))
    again = msgspec.json.decode(msgspec.json.encode(record), type=SceneRecord).scene()
    assert again.environment == hazy
