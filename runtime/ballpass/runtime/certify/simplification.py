"""A simpler model of the same machine: its error in quantities and its time, measured.

In: a model, a simpler one, quantities of interest.  Out: a `Simplification`.

Both are integrated with the same parameter sets around the user's, because contact makes the error of a single run
random.  Values are those of a tight tolerance, so that only the models differ; a second method says how uncertain they
are.  Times are those of the scene's own tolerance, taken in turns.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from ballpass.runtime.certify.method_choice import MethodChoice, compared_quantities, default_compared, stepper_run
from ballpass.runtime.certify.trade import MEMBERS, SPREAD, perturbed, reference
from ballpass.runtime.certify.trade_report import PROMISED, milliseconds, percent
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.refused_scenes import refuse_still
from ballpass.runtime.contract.units import table_unit
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.point.evaluate import neighbour
from ballpass.runtime.quantity.grammar import quantity_words
from ballpass.runtime.quantity.quantity_run import QuantityRun
from ballpass.runtime.report.numbers import rounded
from ballpass.runtime.report.report import Report, ReportTable
from ballpass.runtime.report.reported import Reported
from ballpass.runtime.request.request import Request
from ballpass.runtime.show.progress import Progress, shown


@dataclass(frozen=True, slots=True, kw_only=True)
class Simplification(Reported):
    """A simpler model compared with the reference model.

    Attributes
    ----------
    title, simpler_title : of both scenes
    quantities : what is compared
    units, meanings : of the quantities, by name
    values, simpler_values : of the quantities, medians over the members, in SI
    change : relative change by the simpler model, median over the members [1]
    error : 95 % point of its size [1]
    uncertainty : relative, of the values of either model: 95 % point of the difference of two methods [1]
    way : how times were taken
    time, simpler_time : of the integration of a cycle, median over the members [s]
    members : parameter sets
    spread : half the width of the interval they are drawn from [1]
    cycles : turns of a run
    """

    title: str
    simpler_title: str
    quantities: tuple[str, ...]
    units: Mapping[str, str]
    meanings: Mapping[str, str]
    values: Mapping[str, float]
    simpler_values: Mapping[str, float]
    change: Mapping[str, float]
    error: Mapping[str, float]
    uncertainty: Mapping[str, float]
    way: str
    time: float
    simpler_time: float
    members: int
    spread: float
    cycles: float

    @property
    def gain(self) -> float:
        """Time of the model over that of the simpler one [1]."""
        return self.time / self.simpler_time

    @property
    def words(self) -> str:
        """Speed and error as a sentence."""
        worst = max(self.quantities, key=lambda name: self.error[name])
        faster = f"{self.gain:.2g} times as fast" if self.gain >= 1.0 else f"{1.0 / self.gain:.2g} times as slow"
        return (
            f"{self.simpler_title}: {milliseconds(self.simpler_time)} a cycle instead of {milliseconds(self.time)} "
            f"({self.way}), {faster}; it differs most in {worst}, by at most {percent(self.error[worst])} for "
            f"{PROMISED:.0%} of {self.members} parameter sets."
        )

    def _report(self) -> Report:
        def shown(values: Mapping[str, float], name: str) -> str:
            return rounded(table_unit(self.units[name])[0] * values[name])

        table = ReportTable.of(
            self.quantities,
            {
                "quantity": str,
                "unit": lambda name: table_unit(self.units[name])[1],
                ">this scene": lambda name: shown(self.values, name),
                ">other": lambda name: shown(self.simpler_values, name),
                ">change": lambda name: f"{100.0 * self.change[name]:+z.3g} %",
                f">{PROMISED:.0%} within": lambda name: percent(self.error[name]),
            },
            title=f"{self.title}; other: {self.simpler_title}",
            caption="\n".join(f"{name}: {words}" for name, words in self.meanings.items()),
        )
        facts = {"simplification": {**asdict(self), "gain": self.gain}, "words": self.words}
        return Report(parts=(table, self.words), facts=facts)


def measure_simplification(
    model: LoadedModel,
    simpler: LoadedModel,
    of: Sequence[str] | None = None,
    *,
    parameters: Mapping[str, float] | None = None,
    members: int = MEMBERS,
    spread: float = SPREAD,
    progress: Progress = None,
) -> Simplification:
    """Measure errors and time of a simpler model.

    Parameters
    ----------
    model : the reference
    simpler : of the same machine; parameters of one name are the same in both, others keep their defaults
    of : quantities, ``peak_ball_force``, ``rms:inner.y``, ...  Default: those of `measure_trade` that both have
    parameters : overrides of parameters that both have, SI; the members lie around them
    progress : as for `Model.simulate`

    Raises
    ------
    RequestError
        A wrong request, or scenes without a common quantity.
    SimulationError
        A run of either model failed.
    """
    for one in (model, simpler):
        refuse_still(f"trade {one.manifest.scene}", integrated=one.manifest.integrated)
    if members < 2:
        raise RequestError(f"members: at least 2 are needed for a 95 % point, not {members!r}.")
    others = {info.name for info in simpler.manifest.parameters}
    alone = [name for name in parameters or {} if name not in others]
    if alone:
        raise RequestError(
            f"{', '.join(alone)}: the simpler scene has no such parameter, so that both would differ in more than the "
            "model. Allowed: parameters of both scenes. Change it in the files."
        )
    names = tuple(of) if of is not None else _common(model, simpler)
    compared = [compared_quantities(one, names) for one in (model, simpler)]
    quantities = [QuantityRun(one, items) for one, items in zip((model, simpler), compared, strict=True)]
    way = MethodChoice(method="stepper", rtol=model.manifest.run.rtol)
    user = model.numbers(parameters)
    shared = {info.name for info in model.manifest.parameters} & others
    base = simpler.numbers({name: user.parameters[name] for name in shared})
    values = np.empty((2, members, len(names)))
    doubt, times = np.empty_like(values), np.empty((2, members))
    cycles = 1.0
    with shown("measuring", progress) as tell:
        for member, drawn in enumerate(perturbed(model, dict(user.parameters), members, spread)):
            varied = {name: drawn[name] for name in shared}
            numbers = (
                neighbour(model, user, {**user.parameters, **varied}),
                neighbour(simpler, base, {**base.parameters, **varied}),
            )
            runs = [stepper_run(model, numbers[0], Request())]
            cycles = runs[0].span.cycles or 1.0
            length = Request(duration=runs[0].duration, transient_cycles=runs[0].span.transient)
            runs.append(stepper_run(simpler, numbers[1], length))
            for k, run in enumerate(runs):
                values[k, member], doubt[k, member] = reference(run, quantities[k])
                times[k, member] = way.measure(quantities[k], run).seconds / cycles
            if tell is not None:
                tell((member + 1) / members)
    with np.errstate(divide="ignore", invalid="ignore"):
        changes = values[1] / values[0] - 1.0
    both = np.median(values, axis=1)
    time, other = np.median(times, axis=1).tolist()
    known = np.quantile(np.max(doubt, axis=0), PROMISED, axis=0)
    largest = np.maximum(np.quantile(np.abs(changes), PROMISED, axis=0, method="higher"), known)

    titles = [each.manifest.title for each in (model, simpler)]
    if titles[0] == titles[1]:
        titles = [each.manifest.scene for each in (model, simpler)]

    def by_name(numbers: np.ndarray) -> dict[str, float]:
        return dict(zip(names, numbers.tolist(), strict=True))

    return Simplification(
        title=titles[0],
        simpler_title=titles[1],
        quantities=names,
        units={item.name: item.unit for item in compared[0]},
        meanings={item.name: quantity_words(model.manifest, item) for item in compared[0]},
        values=by_name(both[0]),
        simpler_values=by_name(both[1]),
        change=by_name(np.median(changes, axis=0)),
        error=by_name(largest),
        uncertainty=by_name(known),
        way=way.words,
        time=time,
        simpler_time=other,
        members=members,
        spread=spread,
        cycles=cycles,
    )


def _common(model: LoadedModel, simpler: LoadedModel) -> tuple[str, ...]:
    theirs = default_compared(simpler.manifest)
    names = tuple(name for name in default_compared(model.manifest) if name in theirs)
    if not names:
        raise RequestError(
            "The two scenes have no quantity in common: their bearings have other names. Give both the same names "
            "([bearings.<name>]), or name quantities that both have with --of."
        )
    return names
