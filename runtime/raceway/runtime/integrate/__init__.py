"""Integration of a model over time: segments, steps, samples, reductions."""
