"""What is swapped between a picture and its twin, and the table of it."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING

import cv2
import msgspec
import numpy as np
import pytest

from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.compare.references import Reference, fitted, read_references
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.frames.pose import Pose
from tools.studies import real_gap
from tools.studies.fitted_light.fit import candidate_lights, scene_at_pose
from tools.studies.fitted_light.pairs import correlation
from tools.studies.real_gap import SHOWN_PX, SwapRow, drawn, failures_picture, swaps, table, twin_of

if TYPE_CHECKING:
    from pathlib import Path

    from flyaround.simulator.render.renderer import Renderer

POSE = Pose.of("camera", "target", (0.5, 0.5, -0.5, 0.5), (0.1, 0.0, 5.0))


def test_the_table_tells_what_is_right_and_what_was_accepted_wrongly() -> None:
    good = SwapRow(0.9, 1.0, 0.01, 0.02, 0.3, accepted=True)
    bad = replace(good, deg=90.0, accepted=True)
    last = table({"theirs": (good, bad)}).splitlines()[-1]
    assert last == "| theirs | 0.90 | 1 of 2 (9-91 %) | 1.00 deg, 20 mm | 0.30 | 2, 1 |"


def test_their_light_is_taken_over_and_detail_stays_ours() -> None:
    on = np.zeros((120, 160), bool)
    on[20:100, 20:140] = True
    ours = np.where(on, 100, 30).astype(np.uint8)
    ours[50:54, 60:100] = 60
    theirs = np.where(on, np.linspace(60, 200, 160)[None], 30).astype(np.uint8)
    lit = real_gap._with_their_light(theirs, ours, ours, on)
    assert np.abs(lit[30, 40:120].astype(float) - theirs[30, 40:120]).max() < 25
    assert lit[52, 80] < 0.7 * lit[30, 80]
    assert (lit[~on] == 30).all()


@pytest.mark.gl
def test_a_twin_of_our_own_picture_is_that_picture(renderer: Renderer, tmp_path: Path) -> None:
    mockup, flight = load_target("tango-mockup@low"), load_target("tango@low")
    camera = fitted(load_camera("speed"), 480, 300)
    bare = scene_at_pose(Reference(tmp_path / "a.png", np.zeros((300, 480), np.uint8), camera, POSE), mockup)
    lights = candidate_lights(bare)
    box = msgspec.structs.replace(lights[40], radiance_w_m2_sr=900.0)
    cv2.imwrite(str(tmp_path / "a.png"), drawn(renderer, replace(bare, lights=(box,)), mockup))
    row = {"filename": "a.png", "q_vbs2tango_true": POSE.q_wxyz, "r_Vo2To_vbs_true": POSE.t_m}
    (tmp_path / "test.json").write_text(json.dumps([row]))
    (reference,) = read_references(tmp_path, load_camera("speed"), 1, tmp_path / "test.json")
    twin = twin_of(renderer, reference, mockup)
    assert correlation(reference.image[twin.on], twin.image[twin.on]) > 0.93
    out = swaps(renderer, twin, mockup, flight, 0)
    like = {name: correlation(reference.image[twin.on], image[twin.on]) for name, image in out.items()}
    assert like["inside: theirs"] == pytest.approx(1.0, abs=1e-3)
    assert like["light: of the recipe"] < like["lens: sharp"]
    assert (out["background: theirs"][0] == reference.image[0]).all()
    # both at one pose: the two halves of the picture are alike
    result = type("Result", (), {})()
    result.q_camera_from_target_wxyz, result.t_camera_from_target_m = (
        np.array(v) for v in (POSE.q_wxyz, POSE.t_m)
    )
    picture = failures_picture(renderer, [(twin, result)], mockup)
    assert picture is not None
    assert (
        np.abs(
            np.subtract(*(h.astype(float) for h in (picture[:, :SHOWN_PX], picture[:, -SHOWN_PX:])))
        ).mean()
        < 2.0
    )
    assert failures_picture(renderer, [], mockup) is None
