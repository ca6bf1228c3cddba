"""Labels of random frames checked by other means. `python -m tools.validation.labels` writes the page."""
