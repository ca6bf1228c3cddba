"""The camera: `lens` projects, `detector` converts light to digital numbers. No GL, no world, no scene."""
