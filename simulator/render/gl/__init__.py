"""OpenGL by itself: context, programs, uniform blocks, textures with their mipmaps, buffers, fences. Knows no scene.

Terms, as used here: a *program* is a vertex and a fragment shader linked for one set of defines; a *uniform block* is a
struct that both the CPU and shaders see, laid out from one numpy dtype; a *fence* tells when the driver's threads have
left a framebuffer; a *mipmap chain* is a texture with its smaller levels, made here and kept in the cache.
"""
