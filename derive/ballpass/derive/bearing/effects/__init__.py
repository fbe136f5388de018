"""Effects on the balls, one file each.  A new effect is a file and a line here."""

from ballpass.derive.bearing.effects.effect import Effect

#: Effects by the name of their table.
EFFECTS: dict[str, Effect] = {}

__all__ = ["EFFECTS", "Effect"]
