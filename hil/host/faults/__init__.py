"""Faults that a run is given on purpose: of the camera and of the line, seeded, told in the ledger."""
