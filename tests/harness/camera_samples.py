"""Files of one camera as programs write it."""

import json
from pathlib import Path

SAMPLES = Path(__file__).parents[1] / "data" / "cameras"
"""Files of one camera as programs write it, in folders by the coefficients that are read of them."""
K = "[600, 0, 320, 0, 601, 240, 0, 0, 1]"
D = "[-0.3, 0.1, 0.001, 0.0005, 0.02]"
ROS = f"image_width: 640\nimage_height: 480\ncamera_name: left\ncamera_matrix: {{rows: 3, cols: 3, data: {K}}}\n"
MESSAGE = f"height: 480\nwidth: 640\ndistortion_model: plumb_bob\nd: {D}\nk: {K}\n"


def sample(path):
    """A camera file as its program writes it."""
    return (SAMPLES / path).read_text()


OPENCV_2_XML, ROS_INI = sample("five/opencv2.xml"), sample("five/ros.ini")
KALIBR, VINS = sample("fisheye/kalibr.yaml"), sample("four/vins.yaml")
VINS_FISHEYE = sample("fisheye/vins_fisheye.yaml")
ORB_SLAM_2, ORB_SLAM_3 = sample("five/orb_slam2.yaml"), sample("fisheye/orb_slam3.yaml")
STELLA = sample("five/stella.yaml")
BASALT, BOP = json.loads(sample("fisheye/basalt.json")), json.loads(sample("none/bop.json"))
MATLAB, NERF = json.loads(sample("five/matlab.json")), json.loads(sample("four_and_0/nerf.json"))
READ_FILES = sorted(path.relative_to(SAMPLES).as_posix() for path in SAMPLES.glob("*/*"))


def without(table, *names):
    return {key: value for key, value in table.items() if key not in names}
