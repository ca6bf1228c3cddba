"""A thin layer over OpenGL: context, programs, uniform blocks, textures with mipmaps, buffers, fences. Knows no scene.

Terms: a *program* is a vertex and a fragment shader linked for one set of defines; a *uniform block* is a struct shared
by CPU and shaders, laid out from one NumPy dtype; a *fence* is signalled when the driver's threads have left a
framebuffer; a *mipmap chain* is a texture with its smaller levels, computed here and cached.
"""
