"""A mesh made fit to be drawn: placed, welded, oriented, closed, with normals. No file formats, no labels."""
