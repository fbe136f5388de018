"""Effects on the balls, one file each.  A new effect is a file and a line here."""

from ballpass.derive.bearing.effects.effect import Effect
from ballpass.derive.bearing.effects.waviness import OuterWaviness

#: Effects by the name of their table.
EFFECTS: dict[str, Effect] = {effect.name: effect for effect in (OuterWaviness(),)}

__all__ = ["EFFECTS", "Effect"]
