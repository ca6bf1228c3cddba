"""Validation of rendering against integrals, published figures and a path tracer."""
