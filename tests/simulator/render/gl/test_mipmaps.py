"""Mipmap levels of the maps against the size of a pixel on the ground."""

import numpy as np
import pytest

from flyaround.simulator.render.gl.mipmaps import mipmap_chain

HEIGHT, WIDTH = 256, 512


def _first(image, *, globe):
    """The second level, whose texels are two of the first wide and high."""
    return (
        mipmap_chain(image, globe=globe).smaller[: HEIGHT // 2 * WIDTH // 2].reshape(HEIGHT // 2, WIDTH // 2)
    )


def _row(latitude_deg):
    return int((90 - latitude_deg) / 180 * HEIGHT / 2)


def test_a_texel_of_a_globe_s_map_shows_as_wide_a_piece_of_ground_as_it_is_high():
    rng = np.random.default_rng(5)
    image = rng.integers(0, 256, (HEIGHT, WIDTH)).astype(np.uint8)
    plain, globe = (_first(image, globe=on).astype(float) for on in (False, True))
    # the mean of n texels with no likeness has a deviation smaller by the root of n: 1 / cos(latitude), to odd numbers
    for latitude, count in ((0, 1), (50, 1), (72, 3), (-72, 3), (79, 5), (-84.2, 9)):
        row = _row(latitude)
        assert np.std(globe[row]) * np.sqrt(count) == pytest.approx(np.std(plain[row]), rel=0.3), latitude
        assert abs(globe[row].mean() - plain[row].mean()) < 1.0
    equator = slice(_row(55), _row(-55))
    np.testing.assert_array_equal(globe[equator], plain[equator])


def test_rows_of_a_globe_go_on_where_they_begin():
    image = np.zeros((HEIGHT, WIDTH), np.uint8)
    image[:, : WIDTH // 2] = 200
    row = _first(image, globe=True)[_row(80)].astype(int)
    assert 0 < row[0] < 200  # between what is beside it and what is at the other end of the row
    assert 0 < row[-1] < 200


def test_other_images_have_plain_levels():
    image = np.random.default_rng(6).integers(0, 256, (HEIGHT, WIDTH)).astype(np.uint8)
    means = image.reshape(HEIGHT // 2, 2, WIDTH // 2, 2).mean(axis=(1, 3))
    assert np.abs(_first(image, globe=False) - means).max() <= 0.5
