"""Strength and rating life of deep groove ball bearings: formulas of standards as pure functions.

All numbers are SI (m, N, Pa), lives are in turns, as the rest of the project; ISO's formulas are in mm inside.
Everything is made of arithmetic, powers and `abs`: floats, NumPy arrays and CasADi's SX and MX go through alike, so
that lives can be differentiated by geometry.  Bounds of values are checked for floats and arrays only.
"""
