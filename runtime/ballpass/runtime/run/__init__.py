"""A run over time: request, segments, inputs, steps, samples, reductions."""
