"""The tour of extremes: cases at the edges of what can be asked for, each with an independent reference or invariant.

``python -m extremes`` runs it and writes docs/extremes.md; the quick cases are part of the test suite.
"""
