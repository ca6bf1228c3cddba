"""Automatic exposure: lag, limits, and independence of which frames are drawn."""

import numpy as np
import pytest

from flyaround.simulator.camera.sections import DetectorSection
from flyaround.simulator.errors import UserError
from flyaround.simulator.imaging.auto_exposure import AutoExposure, ExposureTrack
from flyaround.simulator.imaging.image_formation import expose
from flyaround.simulator.imaging.metering import metered_radiance_w_m2_sr
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight


def test_a_step_is_followed_with_the_lag():
    lag = 3.0
    track = ExposureTrack(AutoExposure(lag_s=lag), lambda t: 0.01 if t < 30 else 0.0001)
    assert track.exposure_s(29.0) == pytest.approx(0.01)
    for after in (0.5, 1.0, 2.0):
        share = np.log(track.exposure_s(30 + after * lag) / 0.01) / np.log(0.01)
        assert share == pytest.approx(1 - np.exp(-after), abs=1e-9)
    assert track.exposure_s(300.0) == pytest.approx(0.0001, rel=1e-4)


def test_the_exposure_is_a_function_of_time_alone():
    settings = AutoExposure(lag_s=1.0)
    wanted = lambda t: 0.01 * (1.5 + np.sin(t))  # noqa: E731
    together = ExposureTrack(settings, wanted)
    times = [20.0, 3.3, 0.0, 19.99, 7.0]
    for t, value in zip(times, [together.exposure_s(t) for t in times], strict=True):
        assert ExposureTrack(settings, wanted).exposure_s(t) == value


def test_limits_and_darkness():
    auto = AutoExposure(level=0.5, shortest_s=1e-4, longest_s=0.05)
    assert auto.exposure_for_radiance_s(0.0, 0.1) == 0.05
    assert auto.exposure_for_radiance_s(1e9, 0.1) == 1e-4
    assert auto.exposure_for_radiance_s(10.0, 0.1) == pytest.approx(0.005)


def _with_auto(scenario, **settings):
    from msgspec.structs import replace

    section = AutoExposure(**settings)
    return replace(scenario, sensor=replace(scenario.sensor, auto_exposure=section))


def test_the_meter_follows_the_light():
    scenario = _with_auto(load_scenario("tango-flyaround"), lag_s=0.5)
    plan = plan_flight(scenario, n=4)
    exposures = [plan.scene(k).exposure_s for k in range(4)]
    assert all(1e-5 < e < 0.1 for e in exposures)
    assert max(exposures) > 1.02 * min(exposures)
    # what one frame gets does not depend on the others
    alone = plan_flight(scenario, times=(plan.times_s[2],))
    assert alone.scene(0).exposure_s == exposures[2]
    # twice the level, twice the exposure
    brighter = plan_flight(_with_auto(load_scenario("tango-flyaround"), lag_s=0.5, level=1.0), n=4)
    assert brighter.scene(1).exposure_s == pytest.approx(2 * exposures[1], rel=1e-9)


def test_a_detector_is_metered_by_its_electrons_whatever_the_wavelength_of_diffraction():
    from msgspec.structs import replace

    plain = load_scenario("tango-flyaround")
    exposures = []
    for nm, efficiency in ((550.0, 0.62), (700.0, 0.62), (550.0, 0.31)):
        detector = DetectorSection(quantum_efficiency=[efficiency])
        sensor = replace(plain.sensor, preset="imx174", detector=detector)
        scenario = replace(plain, sensor=sensor, optics=replace(plain.optics, f_number=2.8, wavelength_nm=nm))
        plan = plan_flight(_with_auto(scenario, level=0.5, share=0.9), n=1)
        scene = plan.scene(0)
        exposures.append(scene.exposure_s)
        metered = metered_radiance_w_m2_sr(scene, plan.target, 0.9)
        signal = expose(
            np.full((9, 9), metered, np.float32), scene.sensor, scene.exposure_s, optics=scene.optics
        )
        assert signal[4, 4] == pytest.approx(0.5, rel=1e-4)
    assert exposures[1] == exposures[0]
    assert exposures[2] == pytest.approx(2 * exposures[0], rel=1e-6)


def test_limits_the_wrong_way_round_are_refused():
    with pytest.raises(UserError, match="exchange them"):
        plan_flight(_with_auto(load_scenario("tango-flyaround"), shortest_s=0.2, longest_s=0.1), n=1)


@pytest.mark.gl
def test_the_picture_has_the_level_that_was_asked_for(renderer):
    from dataclasses import replace

    from flyaround.simulator.frame import take_frame

    for name in ("tango-limb", "tango-flyaround"):
        plan = plan_flight(_with_auto(load_scenario(name), share=0.9), n=3, quality="draft")
        plan = replace(plan, camera=plan.camera.resized(192))
        for k in range(3):
            image = take_frame(renderer, plan.scene(k), plan.target, labels=False).image / 255
            lit = image[image > 0.1]
            # the meter knows neither clouds nor the polar snow that some of these frames show
            assert 0.2 < np.quantile(lit, 0.9) < 0.99
            assert np.mean(image > 0.99) < 0.06
