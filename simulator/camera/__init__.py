"""Intrinsics, optics and sensor. No GL, no world."""
