"""Orbits: elements, forces, burns, and the propagation of target and chaser. No attitude, no control."""
