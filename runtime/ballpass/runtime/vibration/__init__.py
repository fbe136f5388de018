"""Signals and their spectra: what a recorder hears of a bearing, and how its faults are named."""
