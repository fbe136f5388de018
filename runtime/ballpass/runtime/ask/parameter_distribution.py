"""The distribution of one parameter as questions take it: a range, or a distribution of SciPy with its arguments.

In: a manifest and text: ``bearing.clearance=5 um:20 um`` (uniform), ``...=5 um:20 um:log`` (uniform in the logarithm),
or ``...=norm:loc=10 um:scale=2 um``.  Out: a `Distribution`, SI.
"""

from __future__ import annotations

from ballpass.runtime.ask.parameter_range import parameter_range
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.parameters import unknown_name
from ballpass.runtime.contract.units import QuantityError, parse_quantity
from ballpass.runtime.many.distributions import Distribution, plain_arguments


def parameter_distribution(manifest: Manifest, option: str, text: str) -> tuple[str, Distribution]:
    """Read a parameter and its distribution.

    Parameters
    ----------
    option : what the caller calls it, for messages

    Raises
    ------
    RequestError
        Another form, an unknown parameter or distribution, a wrong unit, or numbers out of bounds.
    """
    path, _, written = (part.strip() for part in text.partition("="))
    name, *parts = (part.strip() for part in written.split(":"))
    if not parts or not all("=" in part for part in parts):
        chosen = parameter_range(manifest.parameters, option, text)
        low, high = sorted((chosen.low, chosen.high))
        if chosen.logarithmic:
            return path, Distribution(name="loguniform", arguments={"a": low, "b": high})
        return path, Distribution(name="uniform", arguments={"loc": low, "scale": high - low})
    units = {info.name: info.unit for info in manifest.parameters}
    if path not in units:
        raise RequestError(f"{option}: {unknown_name('parameter', path, units)}")
    given = {word.strip(): value.strip() for word, _, value in (part.partition("=") for part in parts)}
    plain = plain_arguments(name, given)
    try:
        values = {word: parse_quantity(value, "1" if word in plain else units[path]) for word, value in given.items()}
    except QuantityError as error:
        raise RequestError(f"{option} {path}: {error}") from None
    return path, Distribution(name=name, arguments=values)
