"""Meaning of the words of `Manifest.smoothness`: which derivatives of a law are continuous, which are bounded."""

from __future__ import annotations

#: Word of the manifest -> description.
WORDS = {
    "twice smooth": "twice continuously differentiable",
    "smooth": "once continuously differentiable (second derivative unbounded at contact onset)",
    "kinked": "continuous with a kink (the first derivative jumps or is unbounded)",
    "discontinuous": "not continuous (the force jumps)",
}
