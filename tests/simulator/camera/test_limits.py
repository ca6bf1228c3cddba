"""Limits of detector and optics are the same for a file's keys and for fields; impossible values are refused."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from flyaround.simulator.camera.detector.limits import (
    DETECTOR,
    OPTICS,
    SENSOR,
    optics_problem,
    sensor_problem,
)
from flyaround.simulator.camera.detector.optics import Optics
from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.camera.lens.files_native import CameraFile
from flyaround.simulator.camera.sections import DetectorSection, OpticsSection
from flyaround.simulator.errors import UserError
from flyaround.simulator.scenario.document import SensorSection
from flyaround.simulator.scenario.load import load_recipe

BASE = replace(sensor_preset("cmv4000"), bits=16)
# without a dark current: a temperature at its bound would multiply it beyond what is allowed
DARK = replace(BASE.detector, dark_current_e_s=0.0)
KEYS = {"layer_m": ("layer_um", 1e6), "wavelength_m": ("wavelength_nm", 1e9)}
NOT_OF_A_SECTION = {"binning", "roi_x0_px", "roi_y0_px", "pixel_pitch_x_m", "pixel_pitch_y_m"}
# files of users rely on these
PINNED = {
    "full_well_e": (1.0, 1e9),
    "gain_e_per_dn": (1e-4, 1e6),
    "read_noise_e": (0.0, 1e5),
    "dsnu_e": (0.0, 1e6),
    "f_number": (0.5, 64.0),
    "transmission": (1e-6, 1.0),
}
FIELDS = {
    DetectorSection: (DETECTOR, lambda v: sensor_problem(replace(BASE, detector=replace(DARK, **v)))),
    OpticsSection: (OPTICS, lambda v: optics_problem(replace(Optics(), **v))),
    SensorSection: (SENSOR, lambda v: sensor_problem(replace(sensor_preset("speed"), **v))),
}
CASES = [(section, key) for section, (bounds, _) in FIELDS.items() for key in bounds]


def takes(section, **keys):
    try:
        return msgspec.convert(keys, section)
    except msgspec.ValidationError:
        return None


def ends(low, high):
    """The bounds, and the nearest values beyond."""
    if isinstance(low, int):
        return (low, high), (low - 1, high + 1)
    return (low, high), (float(np.nextafter(low, -np.inf)), float(np.nextafter(high, np.inf)))


def test_limits_are_unchanged():
    assert {key: {**DETECTOR, **OPTICS}[key] for key in PINNED} == PINNED


@pytest.mark.parametrize(("section", "key"), CASES)
def test_fields_are_limited(section, key):
    bounds, problem = FIELDS[section]
    inside, outside = ends(*bounds[key])
    assert [problem({key: value}) for value in inside] == [None, None]
    for value in (*outside, np.nan):
        assert f"{key} is" in problem({key: value})
        assert "allowed" in problem({key: value})


@pytest.mark.parametrize(("section", "key"), [case for case in CASES if case[1] not in NOT_OF_A_SECTION])
def test_file_keys_have_the_limits_of_their_fields(section, key):
    name, per_unit = KEYS.get(key, (key, 1))
    inside, outside = ends(*(x if per_unit == 1 else round(x * per_unit, 6) for x in FIELDS[section][0][key]))
    taken = [takes(section, **{name: value}) for value in inside]
    assert None not in taken
    assert [takes(section, **{name: value}) for value in outside] == [None, None]
    if section is DetectorSection:
        assert [sensor_problem(replace(BASE, detector=s.detector(DARK))) for s in taken] == [None, None]
    if section is OpticsSection:
        assert [optics_problem(s.optics()) for s in taken] == [None, None]


@pytest.mark.parametrize(("pitch_um", "allowed"), [(0.1, True), (1000, True), (0.09, False), (1001, False)])
def test_pixel_pitch_has_the_same_limits_from_all_sources(pitch_um, allowed):
    pitch_m = pitch_um * 1e-6
    size = {"width_px": 64, "height_px": 64, "fx_px": 64, "fy_px": 64, "cx_px": 32, "cy_px": 32}
    pair = [pitch_um, pitch_um]
    assert (
        sensor_problem(replace(BASE, pixel_pitch_x_m=pitch_m, pixel_pitch_y_m=pitch_m)) is None
    ) is allowed
    assert (takes(SensorSection, pixel_pitch_um=pair) is not None) is allowed
    assert (takes(CameraFile, **size, pixel_pitch_um=pair) is not None) is allowed


@pytest.mark.parametrize("focus_m", [0.0, 0.01761, 0.0175, 0.01])
def test_a_lens_focuses_beyond_its_focal_length(focus_m, tmp_path):
    path = tmp_path / "near.toml"
    lens = f"[optics]\ndefocus = true\nfocus_distance_m = {focus_m}\n"
    path.write_text(f'schema = "flyaround.recipe"\nversion = 1\ntitle = "near"\nbase = "eval-black"\n{lens}')
    if focus_m in {0.0, 0.01761}:  # the focal length is 17.6 mm
        assert load_recipe(path).optics.focus_distance_m == focus_m
    else:
        with pytest.raises(UserError, match=r"focus_distance_m is .*, allowed: 0 for infinity, or more than"):
            load_recipe(path)
    path.write_text(path.read_text().replace("true", "false"))
    load_recipe(path)
