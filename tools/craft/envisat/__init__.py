"""Envisat, the retired Earth observer."""
