"""What the words of `Manifest.smoothness` mean, said so that nobody takes Hertz's law for smooth in every sense."""

from __future__ import annotations

#: Word of the manifest -> what people read.
WORDS = {
    "twice smooth": "twice continuously differentiable",
    "smooth": "once continuously differentiable (second derivative unbounded at contact onset)",
    "kinked": "continuous with a kink (the first derivative jumps or is unbounded)",
    "discontinuous": "not continuous (the force jumps)",
}
