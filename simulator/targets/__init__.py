"""Targets: geometry, materials, keypoints, wireframe and mass properties, from target files and imported meshes.

The built-in craft are files in ``assets/targets``, made by `tools.craft`. Nothing here imports GL or ``world``.
"""
