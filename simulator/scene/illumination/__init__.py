"""Who lights the scene: spectral bands, sunlight through the air, moonlight, planets, the lamp.

In double precision, as the renderer's oracle; no GL.
"""
