"""Finishes: mirror-like foil, thin films on solar cells, positions of cells."""

from dataclasses import replace

import numpy as np
import pytest

from flyaround.simulator.render.craft.cell_lattice import cell_lattices
from flyaround.simulator.render.craft.finishes import film_reflectance, has_films, is_foil
from flyaround.simulator.scene.illumination.irradiance import uniform_field
from flyaround.simulator.targets.library import load_target


def transfer_matrix(indices, thickness_nm, wavelength_nm):
    """Reflectance of a film between two media at normal incidence, by its characteristic matrix."""
    first, film, last = indices
    phase = 2 * np.pi * film * thickness_nm / wavelength_nm
    b = np.cos(phase) + 1j * np.sin(phase) * last / film
    c = last * np.cos(phase) + 1j * film * np.sin(phase)
    return np.abs((first * b - c) / (first * b + c)) ** 2


def test_film_reflectance_matches_the_characteristic_matrix():
    for band, (low, high) in enumerate(((600, 700), (500, 600), (400, 500))):
        wavelengths = np.arange(low, high) + 0.5
        front = transfer_matrix((1.0, 1.38, 1.5), 600 / 4 / 1.38, wavelengths)
        below = transfer_matrix((1.5, 2.1, 3.8), 600 / 4 / 2.1, wavelengths)
        mean = np.mean(front + (1 - front) ** 2 * below)
        assert film_reflectance("rgb", 1.0)[band] == pytest.approx(mean, rel=0.02)
    red, _, blue = film_reflectance("rgb", 1.0)
    slanting_red, _, slanting_blue = film_reflectance("rgb", 0.5)
    assert blue > 2 * red  # cells are blue
    assert slanting_red / slanting_blue > 1.5 * red / blue  # and turn violet


def test_which_materials_are_foil_and_which_lie_under_films():
    materials = {m.name: m for name in ("tango-mli", "tianzhou") for m in load_target(name).materials}
    assert {n for n, m in materials.items() if is_foil(m)} == {"mli", "mli-gold", "mli-silver"}
    assert {n for n, m in materials.items() if has_films(m)} >= {"solar-cell", "solar-cell-blue"}
    assert not has_films(materials["white-paint"])


def cells(columns, rows, pitch_m, turn, middle_m):
    """Corners and triangles of cells 2 mm smaller than their pitch, in two halves 31 mm apart."""
    corners, triangles = [], []
    for i in range(columns):
        for j in range(rows):
            x = i * pitch_m[0] + (0.031 if i >= columns // 2 else 0.0)
            y = j * pitch_m[1]
            w, h = pitch_m[0] - 0.002, pitch_m[1] - 0.002
            triangles += [[len(corners) + k for k in t] for t in ((0, 1, 2), (0, 2, 3))]
            corners += [(x, y, 0.0), (x + w, y, 0.0), (x + w, y + h, 0.0), (x, y + h, 0.0)]
    return np.array(corners) @ turn.T + middle_m, np.array(triangles)


def test_lattices_find_every_cell_of_two_panels():
    c, s = np.cos(0.4), np.sin(0.4)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    places, triangles = cells(8, 5, (0.04, 0.08), turn, np.array([0.3, -0.2, 0.7]))
    found = cell_lattices(places, triangles)
    assert len(found) == 2
    seen = set()
    for lattice in found:
        assert sorted(lattice[3]) == pytest.approx([0.04, 0.08, 4, 5], abs=1e-4)
        for k, cell in enumerate(places.reshape(-1, 4, 3)):
            at = np.column_stack([cell, np.ones(4)]) @ lattice[:3].T
            inside = ((at[:, :2] > 0) & (at[:, :2] < lattice[3, :2])).all()
            if inside and np.abs(at[:, 2]).max() < 1e-4:
                assert len(np.unique(np.floor(at[:, :2]), axis=0)) == 1
                seen.add(k)
    assert seen == set(range(40))
    assert len(cell_lattices(places[:12], triangles[:6])) == 0  # three cells are none


def foil(renderer, draw_kit, crinkle, distance_m=3.0):
    """Picture of a sheet of foil in sunlight and in the light of half a sky."""
    metal = draw_kit.white(
        name="foil", base_color=(0.8, 0.8, 0.8), metallic=0.7, roughness=0.35, crinkle=crinkle
    )
    target = draw_kit.target([draw_kit.plate("sheet", "foil", (0, 0, 0), 0.5)], [metal])
    camera = replace(
        draw_kit.camera, width_px=200, height_px=200, fx_px=600.0, fy_px=600.0, cx_px=99.5, cy_px=99.5
    )
    scene = draw_kit.scene(target, camera=camera, t_m=(0, 0, distance_m), sun_camera=(-0.3, -0.2, -1))
    return renderer.render(scene, target).radiance.astype(float)[20:180, 20:180]


@pytest.mark.gl
def test_creased_foil_glints_and_is_mostly_dark(renderer, draw_kit):
    creased = foil(renderer, draw_kit, 0.9)
    # a Lambert sheet of that reflectance would be even; foil has the Sun in few places, and dark sky in most
    assert np.quantile(creased, 0.99) > 15 * np.median(creased)
    assert np.median(creased) < creased.mean() / 2


@pytest.mark.gl
def test_creased_foil_in_a_white_furnace_keeps_the_light(renderer, draw_kit):
    metal = draw_kit.white(name="foil", base_color=(1.0, 1.0, 1.0), metallic=0.7, roughness=0.35, crinkle=0.9)
    target = draw_kit.target([draw_kit.plate("sheet", "foil", (0, 0, 0), 0.5)], [metal])
    scene = draw_kit.scene(target, t_m=(0, 0, 3.0), sun_visible_fraction=0.0)
    seen = renderer.render(scene, target, labels=True, sky=uniform_field([3.0]))
    inside = seen.radiance[seen.coverage > 0.999]
    assert inside.mean() == pytest.approx(3.0, rel=0.02)
    # fields of cloud are mirrored, and over all facets add nothing
    assert inside.std() < 0.4 * inside.mean()
