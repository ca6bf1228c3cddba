"""Contact sheets: six frames of a flight in one picture, that show the target where the flight has it."""

import numpy as np
import pytest

from flyaround.simulator.contact_sheets.scenario_sheet import contact_sheet, write_contact_sheets
from flyaround.simulator.dataset.formats.native import read_png
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.scenario.load import load_scenario

pytestmark = pytest.mark.gl


def test_sheet_holds_six_frames_with_the_target_in_the_middle(tmp_path):
    scenario = load_scenario("tango-space-10m")
    write_contact_sheets([scenario], tmp_path, 240)
    sheet = read_png(tmp_path / "tango-space-10m.png")
    assert sheet.shape == (300, 720, 3)
    for row in range(2):
        for column in range(3):
            tile = sheet[150 * row : 150 * (row + 1), 240 * column : 240 * (column + 1)].astype(float)
            assert tile[50:100, 95:145].mean() > 2 * tile[125:, :50].mean()


def test_sheets_are_the_same_bytes_again():
    scenario = load_scenario("tango-space-10m")
    with Renderer() as renderer:
        first, second = (contact_sheet(scenario, renderer, 120) for _ in range(2))
    assert np.array_equal(first, second)
