"""From functions to files: C, headers, manifest, EQUATIONS.md."""
