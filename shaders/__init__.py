"""GLSL, read with importlib.resources. No Python logic lives here."""
