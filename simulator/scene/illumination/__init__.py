"""Illumination of the scene: spectral bands, sunlight through the air, Earth-shine, moonlight, planets, lamps.

In double precision, as the renderer's oracle; no GL.
"""
