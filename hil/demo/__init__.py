"""Demo: capture, check, closed loop with a board process, and one page with the results."""
