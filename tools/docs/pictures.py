"""Make the images of the README and the documents with our own software: python -m tools.docs.images."""

from dataclasses import replace
from pathlib import Path
from typing import Literal

import cv2
import numpy as np

import flyaround as fa
from flyaround.hil.demo.page import with_inset
from flyaround.simulator.imaging.display import display_picture
from tools.docs.gallery import exposed, radiance, write_jpeg

IMAGES = Path(__file__).parents[2] / "docs" / "images"
JPEG = [cv2.IMWRITE_JPEG_QUALITY, 85]
TILE = (640, 400)
SCENES = (
    ("tango-earth-10m", 0.0),
    ("tango-limb", 60.0),
    ("tango-night", 0.0),
    ("tango-tumble-3-18m", 120.0),
)


def save(name: str, rgb: np.ndarray, size: tuple[int, int]) -> None:
    """Write a JPEG of a given size."""
    small = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(IMAGES / name), np.ascontiguousarray(small[..., ::-1]), JPEG)


def draw(
    renderer: fa.Renderer, name: str, t_s: float, bands: Literal["mono", "rgb"]
) -> tuple[fa.Frame, fa.Target]:
    """Return one frame of a scenario."""
    plan = fa.plan_flight(fa.load_scenario(name), times=(t_s,), bands=bands)
    return fa.take_frame(renderer, plan.scene(0), plan.target), plan.target


def main() -> None:
    """Draw the hero image, the montage with truth, and one tile per kind of scene."""
    IMAGES.mkdir(exist_ok=True)
    with fa.Renderer() as renderer:
        # as the gallery's: without detector noise, with the tone curve of film
        hero, _ = draw(renderer, "tango-close-3m", 0.0, "rgb")
        light = radiance(renderer, replace(hero.scene, quality="high"))
        light = cv2.resize(light, (1280, 800), interpolation=cv2.INTER_AREA)
        write_jpeg(IMAGES / "hero.jpg", exposed(light, 0.985, -0.4))
        scenes = []
        for name, t_s in SCENES:
            frame, _ = draw(renderer, name, t_s, "rgb")
            shown = display_picture(frame.image, frame.scene.sensor, frame.scene.camera.pixel_encoding)
            scenes.append(cv2.resize(shown, TILE, interpolation=cv2.INTER_AREA))
        grid = np.vstack([np.hstack(scenes[:2]), np.hstack(scenes[2:])])
        save("scenes.jpg", grid, (1280, 800))
        tiles = []
        plan = fa.plan_flight(fa.load_scenario("tango-flyaround"), n=20)
        for k in (0, 3, 6, 8, 10, 13, 16, 18, 19):
            frame = fa.take_frame(renderer, plan.scene(k), plan.target)
            if frame.truth is None:
                raise ValueError("a frame of the montage has no truth")
            drawn = with_inset(fa.draw_truth(frame.image, frame.truth, plan.target), frame.truth)
            tiles.append(cv2.resize(drawn, TILE, interpolation=cv2.INTER_AREA))
        montage = np.vstack([np.hstack(tiles[k : k + 3]) for k in range(0, 9, 3)])
        save("montage.jpg", montage, (1440, 900))


if __name__ == "__main__":
    main()
