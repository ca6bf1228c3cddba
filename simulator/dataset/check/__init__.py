"""Verifies every label of a data set again, by other means than those that made it."""
