"""Colours: told apart with the usual colour deficiencies, and read over black and over a sunlit cloud."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from flyaround.gui import style

# Machado, Oliveira & Fernandes (2009), severity 1.0, on linear RGB
SEEN_BY = {
    "everyone": np.eye(3),
    "protanopes": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    "deuteranopes": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
}
XYZ_FROM_RGB = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
WHITE_XYZ = np.array([0.9505, 1.0, 1.089])
BLACK, CLOUD = (0.0, 0.0, 0.0, 1.0), (1.0, 1.0, 1.0, 1.0)


def lab(rgba: style.Rgba, eye: np.ndarray) -> np.ndarray:
    """CIE L*a*b* of a colour as an eye sees it."""
    c = np.array(rgba[:3])
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    x = XYZ_FROM_RGB @ np.clip(eye @ linear, 0, 1) / WHITE_XYZ
    f = np.where(x > 0.008856, np.cbrt(x), 7.787 * x + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def contrast(front: style.Rgba, back: style.Rgba) -> float:
    """Contrast of a colour over an opaque one, from 1 to 21 (WCAG 2.1: 4.5 for text, 3 for lines)."""
    bright, dark = sorted((style.luminance(style.over(front, back)), style.luminance(back)), reverse=True)
    return (bright + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("eye", SEEN_BY)
@pytest.mark.parametrize("colours", [(style.GOOD, style.WARN, style.BAD), style.AXIS_COLORS])
def test_colours_that_mean_something_are_told_apart(eye: str, colours: tuple[style.Rgba, ...]) -> None:
    for a, b in combinations(colours, 2):
        assert np.linalg.norm(lab(a, SEEN_BY[eye]) - lab(b, SEEN_BY[eye])) > 30


@pytest.mark.parametrize(
    "colour", [style.INK, style.ACCENT, style.GOOD, style.WARN, style.BAD, style.ORANGE, *style.AXIS_COLORS]
)
def test_text_reads_on_the_console_and_on_any_picture(colour: style.Rgba) -> None:
    assert contrast(colour, style.GROUND) >= 4.5
    # over a picture there is a dark outline between the letters and what is behind them
    for behind in (BLACK, CLOUD):
        outline = style.over(style.HALO, behind)
        assert contrast(colour, outline) >= 3.0


@pytest.mark.parametrize("colour", [style.INK, style.QUIET, style.ACCENT, style.GOOD, style.WARN, style.BAD])
def test_figures_read_on_their_plate(colour: style.Rgba) -> None:
    for behind in (BLACK, CLOUD):
        assert contrast(colour, style.over(style.PLATE, behind)) >= 3.0


def test_without_an_outline_pale_letters_would_not_read_on_cloud() -> None:
    assert contrast(style.ACCENT, CLOUD) < 3.0
    assert contrast(style.INK, CLOUD) < 1.5


@pytest.mark.parametrize("name", ["PRIMARY", "GUARDED", "LIT", "WARN", "BAD", "EDGE", "RAISED"])
def test_letters_read_on_every_button(name: str) -> None:
    fill = getattr(style, name)
    assert contrast(style.letters_on(fill), fill) >= 4.5
