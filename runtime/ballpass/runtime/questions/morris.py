"""Which of many uncertain inputs matter at all: elementary effects by Morris, with few members."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np

from ballpass.runtime.contract.options import Cycles, Option, Transient
from ballpass.runtime.contract.units import table_unit
from ballpass.runtime.questions import option_names
from ballpass.runtime.questions.question import AnyModel, Question
from ballpass.runtime.questions.sobol import DrawnAnswer, Seed, Spread
from ballpass.runtime.report.report import Report, ReportTable
from ballpass.runtime.show.progress import Progress

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ballpass.runtime.shares.elementary_effects import ElementaryEffect

Of = Annotated[str | Sequence[str], option_names.quantity("Quantity, as `peak_ball_force`. May be repeated.")]
Base = Annotated[
    int, Option(words="Base members N; there are N (inputs + 1) members.", shown="N", least=4, most=100_000)
]


@dataclass(frozen=True, slots=True, kw_only=True)
class ScreenedQuantity:
    """A quantity and the effects of the inputs on it.

    Attributes
    ----------
    name, unit : of the quantity
    effects : of the inputs, in their order

    Examples
    --------
    >>> found = model.morris("bearing.clearance=5 um:15 um", "rms:inner.y", cycles=3, base=8)
    >>> found.quantities[0].name, found.quantities[0].unit
    ('rms:inner.y', 'm')
    """

    name: str
    unit: str
    effects: tuple[ElementaryEffect, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class MorrisAnswer(DrawnAnswer):
    """Effects of uncertain inputs on quantities.

    Attributes
    ----------
    inputs : parameters that vary
    distributions : of the inputs, in words
    quantities : effects on each
    seed, members : seed, members in all
    failed : members without results, and `fault` of the first
    infinite : quantities that are infinite in some members, in words

    Examples
    --------
    >>> vary = ["bearing.clearance=5 um:15 um", "mechanism.bodies.slider.mass=16 kg:17 kg"]
    >>> found = model.morris(vary, "rms:inner.y", cycles=3, base=8)
    >>> clearance, mass = found.quantities[0].effects
    >>> found.members, clearance.size > mass.size
    (24, True)
    """

    quantities: tuple[ScreenedQuantity, ...]

    def _report(self) -> Report:
        from ballpass.runtime.shares.drawn_members import fault_of

        known = all(effect.rows >= 2 for one in self.quantities for effect in one.effects)
        parts, records = [], []
        for one in self.quantities:
            ranked = sorted(zip(self.inputs, one.effects, strict=True), key=lambda pair: -pair[1].size)
            factor, unit = table_unit(one.unit)

            def shown(number: float, factor: float = factor) -> str:
                return f"{factor * number:.4g}"

            parts.append(
                ReportTable.of(
                    ranked,
                    {
                        "input": lambda row: row[0],
                        ">size": lambda row: shown(row[1].size),
                        "95 % interval": lambda row: f"{shown(row[1].size_low)} to {shown(row[1].size_high)}",
                        ">mean": lambda row: shown(row[1].mean),
                        ">deviation": lambda row: shown(row[1].deviation),
                    },
                    title=f"Effects on {one.name} [{unit}]",
                    caption="Changes over the whole of an input's distribution; size: mean without signs. A deviation "
                    "near the size: the input acts together with others, or not linearly.",
                )
            )
            records += [{"quantity": one.name, "input": name, **asdict(effect)} for name, effect in ranked]
        return Report(
            parts=parts,
            facts={**asdict(self), "first_fault": self.fault},
            records=records,
            index=("quantity", "input"),
            warnings=self._warnings(),
            fault=fault_of(self.failed, self.members, known),
        )


def _figures(_model: AnyModel, found: MorrisAnswer, _parameters: object) -> Iterator[tuple[str, Figure]]:
    from ballpass.runtime.plot.effects import draw_effects

    for k, one in enumerate(found.quantities):
        yield ("morris" if k == 0 else f"morris_{k + 1}"), draw_effects(one.name, one.unit, found.inputs, one.effects)


@Question(figures=_figures, needs="scipy")
def morris(
    model: AnyModel,
    vary: Spread,
    of: Of,
    cycles: Cycles = None,
    *,
    base: Base = 16,
    seed: Seed = 1,
    transient: Transient = None,
    parameters: Mapping[str, float] | None = None,
    keep: str | Path | None = None,
    progress: Progress = None,
) -> MorrisAnswer:
    """Find which of many uncertain inputs matter at all, with few members.

    Each base member is compared with others in which one input has moved by half of its distribution (Morris 1991).
    What has a small effect can be left out of `sobol`, which takes many times the members.

    Parameters
    ----------
    parameters : overrides of other parameters, SI
    keep : folder for members that were run, by which a killed call continues; what it kept is deleted at the end
    progress : as for `simulate`

    Raises
    ------
    RequestError
        Unknown names, or wrong distributions.

    Examples
    --------
    >>> found = model.morris("bearing.clearance=5 um:15 um", "rms:inner.y", cycles=3, base=8)
    >>> found.members
    16
    """
    from scipy.stats.qmc import Halton

    from ballpass.runtime.quantity.grammar import quantities_of
    from ballpass.runtime.shares.drawn_members import check_count, read_inputs, run_drawn, values_of
    from ballpass.runtime.shares.elementary_effects import elementary_effects, moved

    inputs = read_inputs(model.manifest, "vary", vary)
    names = list(dict.fromkeys([of] if isinstance(of, str) else of))
    units = [one.unit for one in quantities_of(model, names)]
    count = len(inputs)
    check_count(base * (count + 1))
    shares = Halton(count, scramble=True, seed=np.random.default_rng(seed)).random(base)
    members = values_of(inputs, np.concatenate([shares, *moved(shares)]))
    values, facts = run_drawn(
        *(model, inputs, members, names, seed, progress),
        cycles=cycles,
        transient=transient,
        parameters=parameters,
        keep=keep,
    )
    quantities = []
    for name, unit, column in zip(names, units, values.T, strict=True):
        first, *others = column.reshape(-1, base)
        effects = elementary_effects(shares, first, np.array(others), seed)
        quantities.append(ScreenedQuantity(name=name, unit=unit, effects=tuple(effects)))
    return MorrisAnswer(**facts, quantities=tuple(quantities))
