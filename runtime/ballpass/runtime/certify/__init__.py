"""Uncertainty of results: differences, certificates, ``--error``, trade."""
