"""The spacecraft: its mesh and textures on the GPU, its shadow, and the passes that draw it."""
