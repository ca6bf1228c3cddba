"""Deliberate faults of the camera and of the line, seeded and recorded in the ledger."""
