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
from flyaround.simulator.compare.references import Reference, read_references, resize_camera
from flyaround.simulator.targets.library import load_target
from flyaround.simulator.world.frames.pose import Pose
from tools.studies.fitted_light.fit import candidate_lights, scene_at_pose
from tools.studies.fitted_light.pairs import correlation
from tools.studies.real_gap import SHOWN_PX, drawn, failures_picture, swaps, twin_of

if TYPE_CHECKING:
    from pathlib import Path

    from flyaround.simulator.render.renderer import Renderer

POSE = Pose.from_arrays("camera", "target", (0.5, 0.5, -0.5, 0.5), (0.1, 0.0, 5.0))


@pytest.mark.slow
@pytest.mark.gl
def test_a_twin_of_our_own_picture_is_that_picture(renderer: Renderer, tmp_path: Path) -> None:
    mockup, flight = load_target("tango-mockup@low"), load_target("tango@low")
    camera = resize_camera(load_camera("speed"), 480, 300)
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
