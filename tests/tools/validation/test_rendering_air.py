"""The rows of the rendering page about scattering in the air."""

from tools.validation.rendering import air as rendering_air


def test_air_scatters_as_the_solver_of_the_whole_equation_has_it():
    for row in rendering_air.rows():
        assert row.met, row
