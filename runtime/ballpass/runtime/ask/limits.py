"""A limit of a quantity as questions take it: ``rms:inner.y <= 5 um``."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.units import QuantityError, parse_quantity
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.quantity.grammar import parse_quantity as parse_quantity_name
from ballpass.runtime.time.timeline import is_even
from ballpass.runtime.time.turning import TURN


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """A constraint on a quantity.

    Attributes
    ----------
    quantity, unit : its name and unit
    upper : whether the quantity must stay below
    limit : [unit]
    value : at the optimum [unit]
    active : whether it holds the optimum
    multiplier : change of the goal by that of the limit [goal's unit / unit]
    beyond : how far the quantity is beyond the limit, as a share of it, or of what it is where the limit is zero [1]
    """

    quantity: str
    unit: str
    upper: bool
    limit: float
    value: float = float("nan")
    active: bool = False
    multiplier: float = 0.0
    beyond: float = float("nan")

    @property
    def sign(self) -> float:
        """1 for an upper limit, -1 for a lower one."""
        return 1.0 if self.upper else -1.0


def read_limits(
    manifest: Manifest,
    option: str,
    texts: Sequence[str],
    model: LoadedModel | None = None,
    parameters: Mapping[str, float] | None = None,
    varied: Sequence[str] = (),
) -> list[Limit]:
    """Constraints from the texts of an option.

    Parameters
    ----------
    model, parameters, varied : by which hours of a life are turns; without a model they are not converted

    Raises
    ------
    RequestError
        Another form, an unknown quantity, a wrong unit, or hours where the speed is not one number.
    """
    found = []
    for text in texts:
        name, sign, written = limited(option, text)
        quantity = parse_quantity_name(manifest, name)
        try:
            if quantity.unit == "turns":
                value, in_hours = _life(option, written)
                if in_hours and model is not None:
                    value *= 3600.0 * _speed(model, option, quantity.channel, parameters or {}, varied) / TURN
            else:
                value = parse_quantity(written, quantity.unit or "1")
        except QuantityError as error:
            raise RequestError(f"{option} {name}: {error}") from None
        found.append(Limit(quantity=name, unit=quantity.unit, upper=sign == "<=", limit=value))
    return found


def limited(option: str, text: str) -> tuple[str, str, str]:
    """Quantity, sign and value of a limit, as written; RequestError for another form."""
    match = re.fullmatch(r"\s*(.+?)\s*(<=|>=)\s*(.+?)\s*", text)
    if match is None:
        raise RequestError(f'{option}: {text!r:.80} is no limit. Allowed: "Q <= VALUE" or "Q >= VALUE".')
    name, sign, written = match.groups()
    return name, sign, written


def _life(option: str, written: str) -> tuple[float, bool]:
    """The number of a life, and whether it is in hours, not turns."""
    match = re.fullmatch(r"(\S+?)\s*(h|turns)", written)
    if match is None:
        raise RequestError(
            f'{option}: {written!r:.80} is no life. Give hours or turns, as in "20000 h" or "1e9 turns".'
        )
    return parse_quantity(match[1], "1"), match[2] == "h"


def _speed(
    model: LoadedModel, option: str, channel: str, parameters: Mapping[str, float], varied: Sequence[str]
) -> float:
    """Mean speed of the inner ring against the outer one, where it is one number [rad/s]."""
    manifest, values = model.manifest, model.numbers(parameters).values
    ring = next(one for one in manifest.bearings if one.prefix + "ball.force" == channel).ring_speed
    others = (model.numbers({**parameters, one: values[one] * 1.01 + 1e-9}).values[ring] for one in varied)
    if not is_even(manifest, values) or any(one != values[ring] for one in others):
        raise RequestError(
            f"{option}: hours are turns by the speed, which is not one number here. Give turns, as in "
            '"life >= 1e9 turns".'
        )
    return abs(float(values[ring]))
