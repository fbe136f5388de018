"""What a run is asked to do: length, start, method, tolerance, samples, segments; resolved before it begins."""
