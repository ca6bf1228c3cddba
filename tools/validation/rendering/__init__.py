"""Images against integrals, published figures and a path tracer: `python -m tools.validation.rendering`."""
