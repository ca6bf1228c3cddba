"""Montages of docs/camera.md: the effect of each noise term and lens property on one image."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from flyaround.simulator.camera.detector.optics import Optics
from flyaround.simulator.camera.detector.presets import sensor_preset
from flyaround.simulator.camera.detector.sensor import Detector, Sensor
from flyaround.simulator.camera.lens.files import load_camera
from flyaround.simulator.imaging.image_formation import digitise_scene, expose_scene
from flyaround.simulator.render.renderer import Renderer
from flyaround.simulator.runtime.arrays import vec3
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight
from flyaround.simulator.scene.state import SceneState
from flyaround.simulator.world.frames.rotation import matrix_from_quat

TILE = (300, 225)  # size of a tile [px]
QUIET = Detector(
    full_well_e=20_000.0, gain_e_per_dn=5.0, black_level_dn=60.0, read_noise_e=0.0, shot_noise=False
)


def detector(**changes: Any) -> Sensor:  # noqa: ANN401 - any field of the detector
    """Return an ideal 12-bit detector with only the given properties."""
    return Sensor(preset="picture", bits=12, blur_sigma_px=0.7, detector=replace(QUIET, **changes))


def backlit(scene: SceneState) -> SceneState:
    """Return the scene with the Sun 25 degrees off the boresight, up and to the right."""
    towards = np.array([0.35, -0.25, 1.0]) / np.linalg.norm([0.35, -0.25, 1.0])
    r_sun = matrix_from_quat(scene.q_camera_from_eci_wxyz).T @ towards * 1.496e11
    return replace(scene, r_sun_eci_m=vec3(r_sun))


def tile(image: np.ndarray, bits: float, text: str) -> np.ndarray:
    """Return one tile of the montage: 8 bits, with its caption below."""
    values: np.ndarray = (np.clip(image.astype(float) / (2**bits - 1), 0, 1) ** 0.6 * 255).astype(np.uint8)
    if values.ndim == 2:
        values = cv2.cvtColor(values, cv2.COLOR_GRAY2BGR)
    out = cv2.resize(
        values, TILE, interpolation=cv2.INTER_AREA if values.shape[1] > TILE[0] else cv2.INTER_NEAREST
    )
    out = cv2.copyMakeBorder(out, 0, 22, 1, 1, cv2.BORDER_CONSTANT, value=(255, 255, 255))
    cv2.putText(out, text, (6, TILE[1] + 16), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (20, 20, 20), 1, cv2.LINE_AA)
    return out


def grid(tiles: list[np.ndarray], columns: int) -> np.ndarray:
    """Return the tiles in rows."""
    return np.vstack([np.hstack(tiles[k : k + columns]) for k in range(0, len(tiles), columns)])


def main() -> None:
    """Draw and write both montages."""
    parser = argparse.ArgumentParser(description="Make the montages of docs/camera.md.")
    parser.add_argument("-o", "--output", type=Path, default=Path("docs/images"))
    folder = parser.parse_args().output
    scenario = load_scenario("tango-close-3m")
    plan = plan_flight(scenario, times=(0.0,))
    scene = plan.scene(0)
    with Renderer() as renderer:
        radiance = renderer.render(scene, plan.target).radiance
        exposure = 4.5e-5
        terms: list[tuple[str, Sensor, float]] = [
            ("no noise", detector(), 1.0),
            (
                "photon noise, 1/200 of the light",
                detector(shot_noise=True, gain_e_per_dn=0.025, black_level_dn=0.0),
                0.005,
            ),
            ("read noise 600 e", detector(read_noise_e=600.0), 1.0),
            ("row and column noise 400 e", detector(row_noise_e=400.0, column_noise_e=400.0), 1.0),
            ("PRNU 10 %", detector(prnu=0.1), 1.0),
            ("DSNU 600 e", detector(dsnu_e=600.0), 1.0),
            (
                "hot and dead pixels, 1 % each",
                detector(hot_pixel_share=0.01, hot_pixel_e_s=1e8, dead_pixel_share=0.01),
                1.0,
            ),
            (
                "dark current 30 000 e/s, 0.1 s, uneven by 0.3",
                detector(shot_noise=True, dark_current_e_s=3e4 * 0.1 / 4.5e-5, dark_nonuniformity=0.3),
                1.0,
            ),
            ("full well, 1.8 times the light", detector(), 1.8),
            ("blooming, 1.8 times the light", detector(blooming=0.3), 1.8),
            ("20 digital numbers for all the light", detector(gain_e_per_dn=1000.0, black_level_dn=0.0), 1.0),
            ("cosmic rays, a thick detector", detector(cosmic_rays_cm2_s=8e7, layer_m=6e-4), 1.0),
            ("preset speed", sensor_preset("speed"), 1.0),
            ("preset thesis", sensor_preset("thesis"), 1.0),
            ("preset imx174", sensor_preset("imx174"), 1.0),
            ("preset cmv4000", sensor_preset("cmv4000"), 1.0),
        ]
        tiles = []
        y, x = slice(715, 865), slice(740, 940)
        for text, sensor, light in terms:
            t = exposure * light if sensor.detector is not None else 9e-4
            one = replace(scene, sensor=sensor, exposure_s=t, optics=Optics(f_number=2.8))
            image = digitise_scene(one, expose_scene(one, radiance))[y, x]
            # a coarse scale is shown over the range of its digital numbers
            bits = float(np.log2(21)) if text.startswith("20 digital") else sensor.bits
            tiles.append(tile(image, bits, text))
        cv2.imwrite(str(folder / "camera_noise.jpg"), grid(tiles, 4), [cv2.IMWRITE_JPEG_QUALITY, 43])
        ideal = replace(sensor_preset("ideal"), full_scale_j_m2_sr=0.08, bits=16)
        sun = plan_flight(load_scenario("tango-limb"), times=(0.0,))
        lenses: list[tuple[str, str, Optics]] = [
            ("pinhole (speed)", "speed", Optics()),
            ("Brown-Conrady, five times SPEED+", "speedplus", Optics()),
            ("Kannala-Brandt, 140 degrees", "fisheye-140", Optics()),
            (
                "vignetting of a wide lens",
                "fisheye-140",
                Optics(natural_vignetting=True, mechanical_vignetting=0.5),
            ),
            ("defocus: focused at infinity, f/1.4", "speed", Optics(f_number=1.4, defocus=True)),
            ("veiling glare, Sun 25 degrees off the axis", "speed", Optics(veiling_glare_sr=0.5)),
        ]
        tiles = []
        for text, name, optics in lenses:
            camera = load_camera(name)
            if name == "speedplus":
                distortion = camera.distortion
                camera = replace(
                    camera, distortion=replace(distortion, coefficients=(-1.1, 0.9, -0.003, -0.001))
                )
            base = backlit(sun.scene(0)) if "glare" in text else scene
            target = sun.target if "glare" in text else plan.target
            one = replace(base, camera=camera, optics=optics, sensor=ideal, exposure_s=1e-3)
            image = digitise_scene(one, expose_scene(one, renderer.render(one, target).radiance))
            tiles.append(tile(image, 16, text))
        cv2.imwrite(str(folder / "camera_lens.jpg"), grid(tiles, 3), [cv2.IMWRITE_JPEG_QUALITY, 82])


if __name__ == "__main__":
    main()
