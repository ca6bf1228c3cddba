"""Measurement of the link's latencies for docs/validation/hil.md; not part of the wheel."""
