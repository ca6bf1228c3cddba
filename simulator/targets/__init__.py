"""Targets: geometry, materials, keypoints, wireframe and mass properties of craft, as target files and imported meshes.

The built-in craft are files in ``assets/targets``; their CAD is `tools.craft`. No craft is built here, and nothing here
imports GL or ``world``.
"""
