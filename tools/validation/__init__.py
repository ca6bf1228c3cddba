"""Validation against analytic results and independent programs. It is not part of the simulator."""
