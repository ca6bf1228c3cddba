"""Soyuz MS, the crewed craft that serves the International Space Station."""
