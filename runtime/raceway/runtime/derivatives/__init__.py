"""Derivatives at a point, along a run, of a static equilibrium, each with a second opinion."""
