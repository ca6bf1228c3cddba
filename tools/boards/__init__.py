"""Comparison of boards with the host: runs on an emulated board, and the agreement of two runs."""
