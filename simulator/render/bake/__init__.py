"""What is computed of a mesh once and cached: charts, hidden faces, edges, visibility, radiance transfer. No OpenGL."""
