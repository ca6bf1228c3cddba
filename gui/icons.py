"""Icons of commands: glyphs of Font Awesome 6 Free Solid, included in the imgui-bundle wheel (SIL OFL 1.1)."""

from __future__ import annotations

FONT = "Font_Awesome_6_Free-Solid-900.otf"
CODES = """
play:f04b time.pause:f04c time.step:f051 time.restart:f0e2 hand-on:f3c1 hand-off:f023 steer.arm:f11b
docking.abort:f071 docking.approach:f135 docking.go:f00c docking.no-go:f256 time.next-hold-point:f101
docking.axis-here:f05b steer.toggle:f11b steer.track:f06e steer.centre:f140 steer.stop:f28d steer.reset:f2ea
guidance.waypoint:f4d7 burn.plan:f06d burn.cancel:f1f8 picture.meter:f042 picture.save:f030
capture.start:f302 capture.stop:f04d capture.resume:f04b estimator.run:f544 estimator.forget:f1f8
hil.start:f1e6 hil.stop:f04d hil.board:f2db hil.board-stop:f04d hil.fault:f0e7
scenario.check:f00c scenario.fly:f135 scenario.edit:f304 scenario.save:f0c7 scenario.open:f07c
panel.scenarios:f07c film.start:f008 film.stop:f04d timeline.bookmark:f02e timeline.fly-on:f135
timeline.keep:f0c7 timeline.dataset:f302 timeline.hil:f1e6 timeline.other-future:f126 window.close:f2f5 window.quit:f2f5
settings.undo:f0e2 settings.redo:f01e log.copy-text:f0c5 log.copy:f0c5 log.save:f0c7 window.enlarge:f065
map.fit:f066 window.screenshot:f03e panel.keys:f11c help.panel:f059 sensor.reset:f0e2 help.tour-next:f051
"""
ICONS = {name: chr(int(code, 16)) for name, code in (pair.split(":") for pair in CODES.split())}
"""Glyphs by the name of a command, or of a state of its button."""
PRIMARY = frozenset(
    {"capture.start", "hil.start", "docking.approach", "docking.go", "scenario.fly", "guidance.waypoint"}
)
"""Primary commands of their panels, with filled buttons."""


def labelled(name: str, text: str) -> str:
    """Return a label preceded by the icon of a command, if there is one."""
    return f"{ICONS[name]}  {text}".strip() if name in ICONS else text
