"""Light, and materials, fitted to pictures of a craft whose poses are known: `python -m tools.studies.fitted_light`."""
