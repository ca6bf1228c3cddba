"""Motion of the chaser relative to the target: closed-form solutions and one integrated step. No guidance."""
