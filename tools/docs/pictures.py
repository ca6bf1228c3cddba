"""Make the image of the README with our own software: python -m tools.docs.pictures."""

from dataclasses import replace
from pathlib import Path

import cv2

import flyaround as fa
from tools.docs.gallery import exposed, radiance, write_jpeg

IMAGES = Path(__file__).parents[2] / "docs" / "images"


def main() -> None:
    """Draw Tango before the Earth, without the detector's noise and developed as a photograph."""
    plan = fa.plan_flight(fa.load_scenario("tango-close-3m"), times=(0.0,), bands="rgb")
    with fa.Renderer() as renderer:
        light = radiance(renderer, replace(plan.scene(0), quality="high"))
    light = cv2.resize(light, (1280, 800), interpolation=cv2.INTER_AREA)
    write_jpeg(IMAGES / "hero.jpg", exposed(light, 0.985, -0.4))


if __name__ == "__main__":
    main()
