"""The spacecraft: its mesh and textures on the GPU, its shadow, the passes that draw it. Nothing of Earth or sky."""
