"""Unknowns from measured signals."""
