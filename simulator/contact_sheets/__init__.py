"""Pages of small images: each target from all sides, and overviews of flights. Nothing below dataset/ imports it."""
