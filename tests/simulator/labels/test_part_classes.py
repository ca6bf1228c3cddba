"""Parts in seven classes: every craft has a body, and names fall where a reader would put them."""

import pytest

from simulator.labels.part_classes import PART_CLASSES, part_class
from simulator.targets.library import load_target


@pytest.mark.parametrize(
    ("part", "expected"),
    [
        ("wing_px_cells", "solar_array"),
        ("rendezvous_dish", "antenna"),
        ("antenna_3", "antenna"),
        ("draco_thrusters", "propulsion"),
        ("probe_arms", "docking"),
        ("star_tracker_1_lens", "sensor"),
        ("radiator_ribs", "radiator"),
        ("cargo_shell", "body"),
        ("drive_ring", "body"),
    ],
)
def test_a_part_has_the_class_that_its_name_says(part, expected):
    assert part_class(part) == expected


def test_the_papers_craft_have_all_or_nearly_all_of_the_seven():
    assert len(PART_CLASSES) == 7
    for name, fewest in (
        ("dragon", 6),
        ("soyuz-ms", 7),
        ("tianzhou", 7),
        ("change6-ascender", 7),
        ("envisat", 7),
    ):
        assert len({part_class(p.name) for p in load_target(name).parts}) >= fewest
