"""ROS images by the definition of sensor_msgs/Image: what a reader that trusts encoding and step alone finds."""

import numpy as np
import pytest

from flyaround.simulator.dataset.formats.ros_messages import image


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("kind", ["uint8", "<u2", ">u2"])
def test_an_image_is_read_back_by_its_encoding_and_step(kind, channels):
    rng = np.random.default_rng(3)
    pixels = rng.integers(0, np.iinfo(kind).max, (5, 7, channels)).astype(kind)
    told = image(pixels if channels == 3 else pixels[..., 0], "2026-03-20T12:00:00Z")
    bits = 8 * pixels.itemsize
    assert told["encoding"] == f"{'mono' if channels == 1 else 'rgb'}{bits}"
    assert (told["height"], told["width"]) == (5, 7)
    assert len(told["data"]) == told["height"] * told["step"]
    order = ">" if told["is_bigendian"] else "<"
    for y in range(5):
        row = told["data"][y * told["step"] : (y + 1) * told["step"]]
        values = np.frombuffer(row, f"{order}u{bits // 8}")
        assert np.array_equal(values.reshape(-1, channels)[:7], pixels[y])
