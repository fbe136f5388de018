"""Dyads, one file each: how they are found, placed, and their reactions solved."""
