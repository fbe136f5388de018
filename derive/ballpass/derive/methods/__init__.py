"""Tableaus of the integration methods."""
