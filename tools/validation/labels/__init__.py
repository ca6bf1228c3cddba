"""Labels of random frames, tested by other methods. `python -m tools.validation.labels` writes the page."""
