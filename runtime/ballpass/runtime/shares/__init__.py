"""Inputs that are drawn: whose scatter a result owes how much."""
