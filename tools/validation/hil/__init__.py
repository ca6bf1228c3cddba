"""Proof of the bridge's times, as docs/validation/hil.md has them. Not in the wheel."""
