"""Strength, life and wear of bearings over a run or a duty cycle."""
