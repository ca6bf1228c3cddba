"""Render the image of the README: python -m tools.docs.pictures."""

from dataclasses import replace
from pathlib import Path

import cv2

import flyaround as fa
from tools.docs.gallery import exposed, radiance, write_jpeg

IMAGES = Path(__file__).parents[2] / "docs" / "images"


def main() -> None:
    """Render Tango in front of the Earth, without detector noise and with a photographic tone curve."""
    plan = fa.plan_flight(fa.load_scenario("tango-close-3m"), times=(0.0,), bands="rgb")
    with fa.Renderer() as renderer:
        light = radiance(renderer, replace(plan.scene(0), quality="high"))
    light = cv2.resize(light, (1280, 800), interpolation=cv2.INTER_AREA)
    write_jpeg(IMAGES / "hero.jpg", exposed(light, 0.985, -0.4))


if __name__ == "__main__":
    main()
