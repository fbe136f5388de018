"""What a run returns: samples, statistics, sensitivities, settled values, and their files."""
