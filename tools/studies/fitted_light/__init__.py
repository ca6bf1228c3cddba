"""Light, and materials, fitted to images of a craft whose poses are known: `python -m tools.studies.fitted_light`."""
