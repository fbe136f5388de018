"""A run over time: steps of the compiled driver, what they are reduced to, and where one failed."""
