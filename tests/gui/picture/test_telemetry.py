"""What of a flight is drawn and told: reduced cameras, the look, figures, places in a view."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flyaround.gui.picture.figures import FIGURES
from flyaround.gui.picture.view_settings import ViewSettings, apply_view_settings
from flyaround.gui.views.letterbox import Letterbox
from flyaround.simulator.camera.lens.camera_model import reduced_camera
from flyaround.simulator.piloting.session import FlightSession
from flyaround.simulator.piloting.telemetry import telemetry_of
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scene.state import SceneState
from flyaround.simulator.world.frames.rotation import rotation_angle_rad
from tests.harness.pilot import fly


@pytest.fixture
def session() -> FlightSession:
    return FlightSession.of(load_scenario("tango-flyaround"))


def test_reduced_camera_sees_the_same_directions(session: FlightSession) -> None:
    camera = session.plan.camera
    half = reduced_camera(camera, 2)
    assert (half.width_px, half.height_px) == (camera.width_px // 2, camera.height_px // 2)
    # the outer corner of the image, at pixel edges, is the same ray
    x = (-0.5 - camera.cx_px) / camera.fx_px
    assert (-0.5 - half.cx_px) / half.fx_px == pytest.approx(x, rel=1e-12)


def test_look_changes_only_what_it_says(session: FlightSession) -> None:
    scene = session.scene()
    settings = ViewSettings(bands=scene.bands, environment=scene.environment)
    assert apply_view_settings(scene, settings) == scene
    darker: SceneState = apply_view_settings(scene, replace(settings, exposure_stops=-1.0))
    assert darker == replace(scene, exposure_s=scene.exposure_s / 2)


def test_letterbox_keeps_the_aspect_and_maps_pixel_edges() -> None:
    box = Letterbox.fit((200, 100), (10.0, 20.0, 400.0, 400.0))
    assert (box.x, box.y, box.width, box.height) == (10.0, 120.0, 400.0, 200.0)
    assert box.at((-0.5, -0.5)) == (10.0, 120.0)
    assert box.at((199.5, 99.5)) == (410.0, 320.0)


def test_telemetry_of_a_known_geometry(session: FlightSession) -> None:
    fly(session, 1.0)
    world, scene = session.craft.world, session.scene()
    shown = telemetry_of(world, scene)
    later = session.flight.state(session.t_s + 0.01)
    assert shown.range_m == pytest.approx(world.range_m, abs=1e-9)
    assert shown.closing_m_s == pytest.approx(-(later.range_m - world.range_m) / 0.01, abs=1e-4)
    # the relative attitude turns at the relative rate
    next_scene = session.plan.scene_of(later, 0)
    turned = rotation_angle_rad(scene.q_camera_from_target_wxyz, next_scene.q_camera_from_target_wxyz)
    assert np.degrees(turned) / 0.01 == pytest.approx(
        float(np.linalg.norm(shown.relative_rate_deg_s)), rel=1e-3
    )


def test_no_figure_shows_a_negative_zero() -> None:
    signed = [figure.form for figure in FIGURES.values() if "+" in figure.form]
    assert signed
    assert not [form for form in signed if "-" in form.format(-1e-9)]
