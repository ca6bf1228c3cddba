"""Spacecraft built by code, one folder each, and what they share: levels of detail, materials, labels, assembly."""
