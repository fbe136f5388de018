"""What the texts of options name: quantities, parameters, states, outputs, as `Option.names` reads them.

In: the manifest of a model, or None before a scene is derived, the parameter's name, its texts.  Out: a `RequestError`
for names that there are not, with the message that the question itself has.  Readers are imported inside functions: the
command line imports all options before it knows which one is given.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ballpass.runtime.contract.manifest import Manifest
from ballpass.runtime.contract.options import Option
from ballpass.runtime.contract.parameters import check_name

Reader = Callable[[Manifest | None, str, Sequence[str]], None]


def quantities(manifest: Manifest | None, _option: str, texts: Sequence[str]) -> None:
    """Quantities, as ``peak_ball_force``; their kinds are those of every scene."""
    from ballpass.runtime.quantity.grammar import parse_quantities, refuse_unknown_kinds

    if manifest is None:
        refuse_unknown_kinds(texts)
    else:
        parse_quantities(manifest, texts)


def goals(manifest: Manifest | None, option: str, texts: Sequence[str]) -> None:
    """Quantities, with a minus in front of one that is to be largest: ``-life``."""
    quantities(manifest, option, [text.removeprefix("-") for text in texts])


def limits(manifest: Manifest | None, option: str, texts: Sequence[str]) -> None:
    """Limits of quantities: ``rms:inner.y <= 5 um``."""
    from ballpass.runtime.ask.limits import limited, read_limits

    if manifest is None:
        quantities(None, option, [limited(option, text)[0] for text in texts])
    else:
        read_limits(manifest, option, texts)


def parameters(manifest: Manifest | None, _option: str, texts: Sequence[str]) -> None:
    """Parameters, also by patterns: ``bearing.*``."""
    from ballpass.runtime.contract.parameters import parameters_named

    if manifest is not None:
        parameters_named(texts, [info.name for info in manifest.parameters])


def quantity(words: str) -> Option:
    """Option of quantities."""
    return Option(words=words, shown="Q", names=quantities)


def ranged(words: str, example: str, *, counted: bool = False, deviations: bool = False) -> Option:
    """Option of parameters with bounds."""
    shown = "PATH=A:B:N" if counted else "PATH=A:B"
    return Option(words=words, shown=shown, example=example, names=_ranges(counted=counted, deviations=deviations))


def _ranges(*, counted: bool, deviations: bool) -> Reader:
    """Reader of parameters with bounds: ``bearing.clearance=5 um:40 um``; options as for `parameter_range`."""

    def read(manifest: Manifest | None, option: str, texts: Sequence[str]) -> None:
        from ballpass.runtime.ask.parameter_range import parameter_range

        if manifest is not None:
            for text in texts:
                parameter_range(manifest.parameters, option, text, counted=counted, deviations=deviations)

    return read


def distributions(manifest: Manifest | None, option: str, texts: Sequence[str]) -> None:
    """Parameters with distributions: ``bearing.clearance=norm:loc=10 um:scale=1 um``."""
    from ballpass.runtime.shares.drawn_members import read_inputs

    if manifest is not None:
        read_inputs(manifest, option, texts)


def outputs(manifest: Manifest | None, _option: str, texts: Sequence[str]) -> None:
    """Outputs: ``inner.ax``."""
    from ballpass.runtime.request.sampling import output_names

    if manifest is not None:
        output_names(manifest, texts)


def signals(manifest: Manifest | None, option: str, texts: Sequence[str]) -> None:
    """Outputs or states: ``inner.ax``."""
    if manifest is not None:
        states = {info.name for info in manifest.states}
        outputs(manifest, option, [text for text in texts if text not in states])


def states(manifest: Manifest | None, _option: str, texts: Sequence[str]) -> None:
    """States: ``inner.y``."""
    names = [info.name for info in manifest.states] if manifest is not None else texts
    for text in texts:
        check_name("state", text, names)


def measured(manifest: Manifest | None, _option: str, texts: Sequence[str]) -> None:
    """Outputs that columns of measured data hold: ``outer.y=probe_2``."""
    from ballpass.runtime.fit.measured import columns_by_output, measurable

    columns = columns_by_output(texts)
    if manifest is not None:
        measurable(manifest, columns)


def measured_quantities(manifest: Manifest | None, option: str, sources: Sequence[Any]) -> None:
    """Quantities that rows of files of measured data name; a file that cannot be read is refused as well."""
    from ballpass.runtime.fit.measured import quantities_in

    quantities(manifest, option, [name for source in sources for name in quantities_in(source)])


def functions(manifest: Manifest | None, _option: str, texts: Sequence[str]) -> None:
    """What a Jacobian differentiates: ``rhs``, ``reaction.A.*``."""
    from ballpass.runtime.point.jacobian import differentiable

    if manifest is not None:
        differentiable(manifest, texts)


def directions(manifest: Manifest | None, _option: str, texts: Sequence[str]) -> None:
    """By what a Jacobian differentiates: ``states``, ``time``, ``bearing.clearance``."""
    from ballpass.runtime.point.jacobian import check_directions

    if manifest is not None:
        check_directions(manifest, texts)


def bearings(manifest: Manifest | None, _option: str, texts: Sequence[str]) -> None:
    """Bearings by name."""
    from ballpass.runtime.plot.record import bearing_named

    if manifest is not None:
        for text in texts:
            bearing_named(manifest, text)


def kinks(_manifest: Manifest | None, _option: str, texts: Sequence[str]) -> None:
    """What a run does at kinks."""
    from ballpass.runtime.request.locating import check_kinks

    for text in texts:
        check_kinks(text)


def methods(_manifest: Manifest | None, _option: str, texts: Sequence[str]) -> None:
    """Methods of all models, with a compiler and without one."""
    from ballpass.runtime.contract.method_registry import STEPPERS
    from ballpass.runtime.native.casadi_integrators import METHODS

    known = ("auto", *STEPPERS, *METHODS)
    for text in texts:
        check_name("method", text, known)


def stepper_methods(_manifest: Manifest | None, _option: str, texts: Sequence[str]) -> None:
    """Methods of the project's own stepper, of which every scene has the same."""
    from ballpass.runtime.request.choose_method import stepper_method

    for text in texts:
        stepper_method(text)


def differentiating_methods(_manifest: Manifest | None, _option: str, texts: Sequence[str]) -> None:
    """Methods that differentiate their own steps."""
    from ballpass.runtime.request.choose_method import differentiating_method

    for text in texts:
        differentiating_method("sensitivity", text)
