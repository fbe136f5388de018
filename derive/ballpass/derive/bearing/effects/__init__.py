"""Effects on the balls, one file each.  A new effect is a file and a line here."""

from ballpass.derive.bearing.effects.ball_deviation import BallDeviation
from ballpass.derive.bearing.effects.ball_waviness import BallWaviness
from ballpass.derive.bearing.effects.defects import Defects
from ballpass.derive.bearing.effects.effect import Effect, GenericBall
from ballpass.derive.bearing.effects.waviness import InnerWaviness, OuterWaviness

#: Effects by the name of their table.
EFFECTS: dict[str, Effect] = {
    effect.name: effect for effect in (OuterWaviness(), InnerWaviness(), BallWaviness(), BallDeviation(), Defects())
}

__all__ = ["EFFECTS", "Effect", "GenericBall"]
