"""A camera that looks at a screen at a slant: perspective, lens, vignetting, blur, noise, and the screen's gamma."""

from dataclasses import dataclass, field

import cv2
import numpy as np

GAMMA = 2.2
LEAK = 0.004  # light of a black screen, of white's
DARK_DN = 64.0
WHITE_DN = 3300.0  # of 4095
NOISE_DN = 6.0
VIGNETTING = 0.25
LENS = (-0.09, 0.03, 0.001, -0.0015)


@dataclass
class StandInCamera:
    """Takes 12-bit pictures of a screen's (H, W) levels."""

    screen_px: tuple[int, int]
    size_px: tuple[int, int] = (1200, 900)
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(5))

    def __post_init__(self) -> None:
        """The screen's pixel that each of the camera's pixels sees."""
        width, height = self.size_px
        focal = 1.1 * width
        K = np.array([[focal, 0, width / 2 - 7.3], [0, focal, height / 2 + 4.1], [0, 0, 1]])
        columns, rows = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
        points = np.column_stack((columns.ravel(), rows.ravel()))
        lens = np.array(LENS)
        stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 50, 1e-12)
        rays = cv2.undistortPoints(points[:, None], K, lens, criteria=stop)[:, 0]
        R = cv2.Rodrigues(np.array([0.10, -0.14, 0.02]))[0]
        # a screen of unit width in the plane z = 0 of its own frame, a little more than the view is filled
        centre = np.array([0.01, -0.01, 0.88])
        normal = R[:, 2]
        directions = np.column_stack((rays, np.ones(len(rays))))
        depth = (normal @ centre) / (directions @ normal)
        on_plane = (directions * depth[:, None] - centre) @ R
        screen_width, screen_height = self.screen_px
        x = (on_plane[:, 0] + 0.5) * screen_width - 0.5
        y = on_plane[:, 1] * screen_width + screen_height / 2 - 0.5
        self.map_x = x.reshape(height, width).astype(np.float32)
        self.map_y = y.reshape(height, width).astype(np.float32)
        r2 = ((columns - width / 2) ** 2 + (rows - height / 2) ** 2) / (width / 2) ** 2
        self.shading = 1 - VIGNETTING * r2

    def look(self, screen: np.ndarray) -> np.ndarray:
        """One picture [DN], float, noise and all."""
        light = LEAK + (1 - LEAK) * (screen.astype(np.float32) / 255) ** GAMMA
        seen = cv2.remap(light, self.map_x, self.map_y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
        seen = cv2.GaussianBlur(seen, (0, 0), 0.6)
        signal = DARK_DN + WHITE_DN * self.shading * seen
        noisy = signal + self.rng.normal(0, NOISE_DN, signal.shape)
        return np.clip(np.rint(noisy), 0, 4095)
