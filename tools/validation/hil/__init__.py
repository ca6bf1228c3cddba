"""Measurement of the bridge's latencies in docs/validation/hil.md. Not in the wheel."""
