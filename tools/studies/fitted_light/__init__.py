"""Light and materials fitted to images of a craft with known poses: `python -m tools.studies.fitted_light`."""
