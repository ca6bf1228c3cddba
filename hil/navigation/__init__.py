"""Filters on board poses and the closed loop (not here yet: the seam is the ledger row)."""
