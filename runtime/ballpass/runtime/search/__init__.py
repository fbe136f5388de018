"""Minima under bounds and constraints, of smooth and of kinked functions."""
