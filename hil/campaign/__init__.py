"""Batches of runs: campaigns of cases against requirements, and maps of tolerable pose delays.

Every run is a run of `flyaround.hil.host`.
"""
