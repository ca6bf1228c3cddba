"""What spares a software driver work, behind one interface: tiles, interpolation, culling on the CPU.

The plain path, which a GPU runs, never comes here.
"""
