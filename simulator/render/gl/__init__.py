"""OpenGL by itself: context, programs, uniform blocks, textures with their mipmaps, buffers, fences. Knows no scene."""
