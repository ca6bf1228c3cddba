"""A whole scenario as text, for tests that change a line of it."""

from __future__ import annotations

from pathlib import Path

GOOD = """
epoch_utc = 2026-03-20T12:00:00Z
duration_s = 60.0
camera = "speed"
[orbit]
kind = "elements"
altitude_km = 700.0
[attitude]
rate_deg_s = [1, 0, 0]
[chaser]
mode = "hold"
position_lvlh_m = [0, -10, 0]
[sensor]
preset = "speed"
[environment]
stars = true
[output]
bands = "mono"
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path
