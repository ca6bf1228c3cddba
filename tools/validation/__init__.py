"""Validation: comparisons with analytic results and with independent programs. Nothing here is needed to simulate."""
