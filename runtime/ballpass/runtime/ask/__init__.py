"""Quantities of interest of a run: names, values, derivatives."""
