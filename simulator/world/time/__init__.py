"""Instants, time scales (UTC, TT, UT1), and the Earth orientation parameters that relate them."""
