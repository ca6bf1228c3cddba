"""The detector: optics, point spread function, electrons, noise and digital numbers. No scene, no GL."""
