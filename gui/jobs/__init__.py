"""Background jobs beside the window: capture, board and link, estimator, film; no window."""
