"""Tableaus of the integration methods and their order conditions."""
