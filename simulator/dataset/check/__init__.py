"""Verifies every label of a data set independently of the code that made it."""
