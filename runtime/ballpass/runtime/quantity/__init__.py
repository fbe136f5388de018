"""Quantities of a run: their names, how each is evaluated, and how it changes with the parameters."""
