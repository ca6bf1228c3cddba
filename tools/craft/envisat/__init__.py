"""Envisat-like debris: a large dead Earth observer, its dimensions, structure, instruments, labels and mass."""

from tools.craft.envisat.craft import build_envisat

__all__ = ["build_envisat"]
