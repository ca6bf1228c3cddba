"""The whole chain at once: oblong pixels, a rational lens, a warm colour detector; labels hold, bits arrive."""

import cv2
import msgspec
import numpy as np
import pytest

from flyaround.simulator.camera.lens.files_native import DistortionSection
from flyaround.simulator.camera.lens.intrinsics import LensFile
from flyaround.simulator.camera.sections import DetectorSection
from flyaround.simulator.dataset.capture import capture
from flyaround.simulator.dataset.check.verify import check_dataset
from flyaround.simulator.dataset.formats.native import frame_paths, read_png
from flyaround.simulator.dataset.single_frames import render_scene
from flyaround.simulator.labels.truth import read_truth
from flyaround.simulator.scenario.load import load_scenario
from flyaround.simulator.scenario.plan import plan_flight

pytestmark = pytest.mark.gl

RATIONAL = (0.3, 0.1, 0.001, -0.0015, 0.02, 0.5, 0.15, 0.01)
CAMERA = LensFile(
    width_px=160,
    height_px=112,
    focal_length_mm=1.8,
    pixel_pitch_um=[5.0, 8.0],
    distortion=DistortionSection("brown_conrady", RATIONAL),
).solve("test")
WARM = DetectorSection(
    full_well_e=9000.0,
    gain_e_per_dn=2.2,
    read_noise_e=4.0,
    dark_current_e_s=4000.0,
    temperature_c=35.0,
    prnu=0.01,
    dsnu_e=2.0,
    row_noise_e=1.0,
    hot_pixel_share=1e-3,
    hot_pixel_e_s=5000.0,
    cosmic_rays_cm2_s=200.0,
    colour_filter="grbg",
    black_level_dn=32.0,
)


# blue is an eighth of red: its numbers are multiplied by ten
RED_ONE = [(400.0, 0.05), (500.0, 0.1), (600.0, 0.5), (700.0, 0.75)]


@pytest.fixture(scope="module", params=[None, RED_ONE], ids=["one number", "a curve"])
def scenario(request):
    plain = load_scenario("tango-space-10m")
    detector = msgspec.structs.replace(WARM, quantum_efficiency_curve=request.param)
    sensor = msgspec.structs.replace(
        plain.sensor, bits=12, exposure_s=2e-3, detector=detector, roi_px=(16, 8, 128, 96), binning=1
    )
    optics = msgspec.structs.replace(
        plain.optics,
        f_number=5.6,
        psf="airy",
        psf_sigma_px=0.4,
        natural_vignetting=True,
        mechanical_vignetting=0.5,
    )
    return msgspec.structs.replace(
        plain,
        camera=CAMERA,
        sensor=sensor,
        optics=optics,
        target="tango@low",
        output=msgspec.structs.replace(plain.output, bands="rgb", quality="draft"),
    )


def test_oblong_pixels_a_rational_lens_and_a_warm_detector_pass_the_check(scenario, tmp_path):
    plan = plan_flight(scenario, times=(20.0,))
    summary = capture(
        plan, tmp_path / "set", labels=("amodal", "parts", "depth", "normals", "flow", "clean", "wireframe")
    )
    assert summary.quarantined == ()
    assert check_dataset(tmp_path / "set").faults == ()
    truth = read_truth(frame_paths(tmp_path / "set", 0).truth)
    image = read_png(frame_paths(tmp_path / "set", 0).image)
    assert image.dtype == np.uint16
    assert image.shape == (96, 128, 3)
    camera = truth.scene.camera
    assert camera.fy_px / camera.fx_px == pytest.approx(5 / 8)
    # OpenCV's own projection, of the lens the file gave, moved by the corner of the region
    K = np.array([[360.0, 0, 79.5 - 16], [0, 225.0, 55.5 - 8], [0, 0, 1]])
    points = np.array([k.target_m for k in truth.keypoints])
    rotation = cv2.Rodrigues(truth.scene.camera_from_target.R)[0]
    pixels = cv2.projectPoints(
        points, rotation, np.array(truth.t_camera_from_target_m), K, np.array(RATIONAL)
    )[0][:, 0]
    assert np.abs(pixels - [k.pixel_px for k in truth.keypoints]).max() < 1e-6

    # and the record alone gives the same bytes, with fixed pattern, particles and all
    assert np.array_equal(render_scene(truth.scene, plan.target).image, image)
