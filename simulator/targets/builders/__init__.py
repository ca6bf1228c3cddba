"""Small reusable mesh builders: boxes, prisms, lathes, rods, trusses, cell grids. No spacecraft."""
