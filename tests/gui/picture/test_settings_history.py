"""Undo and redo of settings."""

from __future__ import annotations

from copy import deepcopy

import pytest

from flyaround.gui.picture.settings_history import SettingsHistory
from flyaround.gui.picture.view_settings import Options, ViewSettings
from flyaround.simulator.errors import UserError
from flyaround.simulator.scene.environments import Environment


def change(history: SettingsHistory, options: Options, stops: float, t_ms: int) -> None:
    before = deepcopy(options)
    options.settings.exposure_stops = stops
    history.note("picture.exposure", before, options, t_ms)


@pytest.fixture
def options() -> Options:
    return Options(ViewSettings(bands="mono", environment=Environment()))


def test_changes_are_undone_and_done_again(options: Options) -> None:
    history = SettingsHistory()
    for k, stops in enumerate((1.0, 2.0)):
        change(history, options, stops, 5000 * k)
    history.step("settings.undo", options, print)
    assert options.settings.exposure_stops == 1.0
    history.step("settings.undo", options, print)
    assert options.settings.exposure_stops == 0.0
    with pytest.raises(UserError, match="no change to undo"):
        history.step("settings.undo", options, print)
    history.step("settings.redo", options, print)
    history.step("settings.redo", options, print)
    assert options.settings.exposure_stops == 2.0
    with pytest.raises(UserError, match="nothing to redo"):
        history.step("settings.redo", options, print)


def test_a_slider_that_is_dragged_is_one_change(options: Options) -> None:
    history = SettingsHistory()
    for k in range(50):
        change(history, options, 0.1 * k, 33 * k)
    history.step("settings.undo", options, print)
    assert options.settings.exposure_stops == 0.0


def test_a_command_that_changes_nothing_is_not_kept(options: Options) -> None:
    history = SettingsHistory()
    history.note("time.pause", deepcopy(options), options, 0)
    with pytest.raises(UserError):
        history.step("settings.undo", options, print)
