"""Comparison of boards with the host: an emulated board, and the agreement of two runs."""
