"""Effects on the balls, one file each.  A new effect is a file and a line here."""

from ballpass.derive.bearing.effects.ball_deviation import BallDeviation
from ballpass.derive.bearing.effects.ball_waviness import BallWaviness
from ballpass.derive.bearing.effects.defects import Defects
from ballpass.derive.bearing.effects.effect import Effect, GenericBall
from ballpass.derive.bearing.effects.waviness import InnerWaviness, OuterWaviness
from ballpass.runtime.contract.plugins import Registry

#: Effects by the name of their table.
EFFECTS: Registry[Effect] = Registry(
    "effects", "effect", Effect, (OuterWaviness(), InnerWaviness(), BallWaviness(), BallDeviation(), Defects())
)

__all__ = ["EFFECTS", "Effect", "GenericBall"]
