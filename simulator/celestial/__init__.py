"""Data of the sky and the Earth: maps, seasons, sea ice, albedo, air tables, craters, star catalogue and colours.

Read from ``assets`` or made once and cached, as arrays. No OpenGL and no camera; `render` uploads and draws them.
"""
