"""Parts in seven classes: every craft has a body, and names fall where a reader would put them."""

from dataclasses import replace

import pytest

from flyaround.simulator.errors import UserError
from flyaround.simulator.labels.part_classes import (
    PART_CLASSES,
    class_from_name,
    class_report,
    classes_from_file,
    part_class,
    target_classes,
)
from flyaround.simulator.targets.glb.read import load_glb
from flyaround.simulator.targets.glb.write import write_glb
from flyaround.simulator.targets.library import load_target


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


@pytest.mark.parametrize(
    ("part", "expected"),
    [
        ("SolarPanel", "solar_array"),
        ("Solar_Array", "solar_array"),
        ("Cylinder.007_Solar Panel_0", "solar_array"),
        ("solarpanels", "solar_array"),
        ("SOLAR-PANEL-LEFT.001", "solar_array"),
        ("HighGainAntenna2", "antenna"),
        ("S-Band", "antenna"),
        ("rcsThruster3", "propulsion"),
        ("MainEngine", "propulsion"),
        ("dockingPort", "docking"),
        ("StarTracker_1", "sensor"),
        ("radiatorPanel", "radiator"),
        ("phased array", None),
        ("fuelCell", None),
        ("Parker Solar Probe", None),
        ("target", None),
        ("side_panel", None),
        ("Cube.003", None),
    ],
)
def test_words_are_told_apart_by_case_and_any_separator(part, expected):
    assert class_from_name(part) == expected
    assert part_class(part) == (expected or "body")


def craft(*names):
    tango = load_target("tango", "low")
    parts = tuple(replace(tango.parts[0], name=n) for n in names)
    return replace(tango, parts=parts, part_classes={})


def test_a_file_sets_classes_by_name_or_pattern():
    target = craft("Cube.001", "Cube.002", "Hull", "wing [left]")
    document = {
        "schema": "flyaround.part_classes",
        "version": 1,
        "classes": {"Cube.*": "antenna", "Cube.002": "sensor", "wing [left]": "radiator"},
    }
    chosen = classes_from_file(document, "classes.toml", [p.name for p in target.parts])
    assert target_classes(replace(target, part_classes=chosen)) == ("antenna", "sensor", "body", "radiator")
    for change, says in (
        ({"classes": {"Cub": "antenna"}}, "is not a part; name one, such as Cube"),
        ({"classes": {"Hull": "solar"}}, "CLASS one of solar_array, antenna"),
        ({"clases": {}}, "clases"),
        ({"version": 2}, "version"),
    ):
        with pytest.raises(UserError, match=says):
            classes_from_file(document | change, "classes.toml", [p.name for p in target.parts])


def test_classes_that_were_taken_and_parts_that_are_not_known_are_said():
    lines = class_report(craft("SolarPanel", "Cube.001", "Hull"))
    assert "solar_array 1 (SolarPanel); body 2 (Cube.001, Hull)" in lines[0]
    assert lines[1] == "class unknown from the name, body assumed: 1 (Cube.001)"
    assert len(class_report(craft("Hull"))) == 1


def test_classes_that_were_set_are_kept_in_the_target_file(tmp_path):
    target = replace(load_target("chessboard", "low"), part_classes={"plate_white": "sensor"})
    write_glb(target, tmp_path / "a.glb")
    assert load_glb(tmp_path / "a.glb").part_classes == {"plate_white": "sensor"}
