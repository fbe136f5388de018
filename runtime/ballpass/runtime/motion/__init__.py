"""Kinds of motion: periodic states and their branches, stroboscopic readings, exponents."""
