"""What accuracy costs on a user's own scene: errors and times of methods, tolerances and simpler models, measured.

In: models of one scene, from full to simple, and quantities of interest.  Out: a `Trade`.

Every configuration (model, method, tolerance, switch) integrates the same members: parameter sets around the user's,
for contact makes the error of a single run a lottery.  The reference of a member is the full model by one method at a
tight tolerance; a second method says how uncertain it is, and no error is claimed below that.  Members are the outer
loop and configurations the inner one, in another order for each member, so that what disturbs the clock disturbs all
alike.  Times are those of the integration alone, of the processor where the system tells; medians are reported.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ballpass.runtime.certify.prepared import Observable, Prepared, check_observables, default_observables, prepare
from ballpass.runtime.certify.quasi_static import NAME as QUASI_STATIC
from ballpass.runtime.contract.bounds import outside, violations
from ballpass.runtime.contract.errors import RequestError, SimulationError
from ballpass.runtime.native.compilers import find_compiler
from ballpass.runtime.native.ensemble_driver import EnsembleDriver, compile_ensemble
from ballpass.runtime.run.locating import has_kinks

if TYPE_CHECKING:
    from ballpass.runtime.model import Model

#: Name of the model that the scene describes.
FULL = "full"

#: Name of the switch that lets the compiler reorder arithmetic.
FAST_MATH = "fast-math"

#: Name of the switch that ends steps on the kinks of the laws.
KINKS_LOCATED = "kinks located"

#: The reference and the second opinion on it: method and tolerance.
REFERENCE = ("stepper-rodas5p", 1e-11)
SECOND = ("stepper-dp54", 1e-11)

#: Half the width of the interval that parameters are drawn from, relative to the user's value [1].
SPREAD = 0.005

#: Members of the ensemble, and of these those that CasADi's methods run: they take a hundred times as long.
MEMBERS, SAMPLED_MEMBERS = 40, 6

#: Errors that people ask for [1].
TARGETS = (0.1, 0.01, 0.001, 0.0001)

#: Part of the members whose error is at most what is promised.
PROMISED = 0.95


@dataclass(frozen=True, slots=True, kw_only=True)
class Configuration:
    """How to compute: model, method, relative tolerance [1], and a switch ("" for none)."""

    model: str
    method: str
    rtol: float
    switch: str = ""

    @property
    def words(self) -> str:
        """For people: what differs from the full model, method, tolerance."""
        parts = [self.method] if self.model == FULL else [f"{self.model}, {self.method}"]
        parts.append(f"rtol {self.rtol:g}")
        return ", ".join(parts + ([self.switch] if self.switch else []))


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """What a configuration gave.

    Attributes
    ----------
    configuration : how it was computed
    time : median over the members, of the integration of one cycle [s]
    median, promised : relative error of each quantity: median and 95 % point over the members, none below the
        reference's uncertainty [1]
    failures : members it could not finish
    """

    configuration: Configuration
    time: float
    median: Mapping[str, float]
    promised: Mapping[str, float]
    failures: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Trade:
    """Accuracy against time on one scene.

    Attributes
    ----------
    scene, title : of the scene
    quantities : what errors are measured of
    values : of the quantities, medians over the members, in SI
    uncertainty : relative, of the reference: 95 % point of the difference of two methods [1]
    members : parameter sets
    spread : half the width of the interval they are drawn from [1]
    cycles : turns of a run
    numbers : parameters that the members lie around, in SI
    measured : all configurations
    folders : generated folders of the models it was measured with, by name, where they were kept
    """

    scene: str
    title: str
    quantities: tuple[str, ...]
    values: Mapping[str, float]
    uncertainty: Mapping[str, float]
    members: int
    spread: float
    cycles: float
    numbers: Mapping[str, float]
    measured: tuple[Measured, ...]
    folders: Mapping[str, Path] = field(default_factory=dict, compare=False)

    def model(self, name: str) -> Model:
        """A model that was kept with the measurement.

        Raises
        ------
        RequestError
            There is none of that name.
        """
        from ballpass.runtime.model import load  # it builds on this module

        if name not in self.folders:
            raise RequestError(f"trade: no model {name!r} was kept with it. Kept: {', '.join(self.folders) or 'none'}.")
        return load(self.folders[name])

    def error(self, one: Measured, quantity: str | None = None) -> float:
        """95 % point of a quantity's error; of the worst quantity where none is named."""
        return max(one.promised.values()) if quantity is None else one.promised[quantity]

    def front(self, quantity: str | None = None) -> tuple[Measured, ...]:
        """Configurations that no other beats in both error and time, from cheap to accurate."""
        found: list[Measured] = []
        for one in sorted(self.measured, key=lambda m: (m.time, self.error(m, quantity))):
            error = self.error(one, quantity)
            if math.isfinite(error) and (not found or error < self.error(found[-1], quantity)):
                found.append(one)
        return tuple(found)

    def cheapest(self, target: float, quantity: str | None = None) -> Measured | None:
        """The fastest configuration whose error is within the target for 95 % of the members; None where none is."""
        fit = [one for one in self.measured if self.error(one, quantity) <= target]
        return min(fit, key=lambda m: m.time) if fit else None


def full_configurations(model: Model) -> tuple[Configuration, ...]:
    """Methods and tolerances for the full model."""
    decades = {
        "stepper": range(-8, -1),
        "stepper-rodas4": range(-7, 0),
        "stepper-rodas5p": range(-8, 0),
        "stepper-dop853": range(-8, -1),
        QUASI_STATIC: (-4, -2, -1),
        "rosenbrock": (-4, -2),
        "erk": (-6, -4),
        "cvodes": (-8, -6, -4),
    }
    return tuple(
        Configuration(model=FULL, method=method, rtol=10.0**decade)
        for method, range_ in decades.items()
        if method in model.methods
        for decade in range_
    )


def simple_configurations(name: str) -> tuple[Configuration, ...]:
    """Methods and tolerances for a simpler model: its own error shows where the tolerance's does not."""
    return tuple(
        Configuration(model=name, method=method, rtol=rtol)
        for method in ("stepper", "stepper-rodas4")
        for rtol in (1e-2, 1e-4, 1e-6)
    )


def switched_configurations() -> tuple[Configuration, ...]:
    """The same with arithmetic that the compiler may reorder."""
    return tuple(replace(one, switch=FAST_MATH) for one in simple_configurations(FULL))


def located_configurations(model: Model) -> tuple[Configuration, ...]:
    """Methods and tolerances with kinks located, for a model whose motion has some."""
    if not (model.has_stepper and has_kinks(model.manifest)):
        return ()
    return tuple(
        Configuration(model=FULL, method=method, rtol=rtol, switch=KINKS_LOCATED)
        for method in ("stepper", "stepper-rodas5p")
        for rtol in (1e-3, 1e-5, 1e-7)
    )


#: What ``-ffast-math`` does to arithmetic, but NaN stays NaN.  The flag itself would have the linker add code that
#: turns off subnormal numbers in the whole process as soon as the library is loaded.
REORDERED = (
    *("-fassociative-math", "-freciprocal-math", "-fno-signed-zeros", "-fno-trapping-math", "-fno-math-errno"),
    "-ffp-contract=fast",
)


def compile_fast_math(model: Model, folder: Path) -> EnsembleDriver | None:
    """The stepper, compiled so that arithmetic may be reordered, but NaN stays NaN; None without a compiler.

    Parameters
    ----------
    folder : the model's generated folder

    Raises
    ------
    CompileError
        The compiler failed.
    """
    compiler = find_compiler() if model.has_stepper else None
    if compiler is None:
        return None
    flags = (*compiler.flags, *REORDERED)
    return EnsembleDriver(
        compile_ensemble(folder.absolute(), model.manifest, replace(compiler, flags=flags)), model.manifest
    )


def perturbed(model: Model, count: int, spread: float = SPREAD, seed: int = 1) -> dict[str, np.ndarray]:
    """Parameter sets around the model's: every number that is not zero, drawn evenly from its neighbourhood.

    The times of a load's table stay: drawn one by one they would change places where the load is steep.  A number that
    is not allowed is mirrored at the user's, for that one may lie on its bound.
    """
    random = np.random.default_rng(seed)
    manifest = model.manifest
    times = {name for item in manifest.inputs for name in item.times}
    sets = {}
    for info in manifest.parameters:
        if info.default == 0.0 or info.name in times:
            continue
        values = info.default * (1.0 + spread * random.uniform(-1.0, 1.0, count))
        values = np.where(outside(info, values), 2.0 * info.default - values, values)
        sets[info.name] = np.where(outside(info, values), info.default, values)
    defaults = {info.name: info.default for info in manifest.parameters}
    for bad, _ in violations(manifest, {name: sets.get(name, np.full(count, v)) for name, v in defaults.items()}):
        # two numbers that are too near each other for their member: it becomes the user's own
        for name, values in sets.items():
            values[bad] = defaults[name]
    return sets


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reference:
    """Values of the members' quantities, shape (members, quantities), and relative differences of two methods."""

    values: np.ndarray
    doubt: np.ndarray


def make_reference(
    model: Model, members: Mapping[str, np.ndarray], quantities: Sequence[str], progress: Callable[[float], None]
) -> Reference:
    """Quantities of the members by two methods.

    Raises
    ------
    SimulationError
        Either method could not finish most members.
    """
    found = []
    for k, (method, rtol) in enumerate((REFERENCE, SECOND)):
        progress(0.5 * k)
        result = model.simulate_many(members, list(quantities), method=method, rtol=rtol)
        found.append(np.column_stack([result[name] for name in quantities]))
        if 2 * len(result.failures) > len(found[-1]):
            raise SimulationError(
                f"No reference can be made: {method} at rtol {rtol:g} could not finish {len(result.failures)} of "
                f"{len(found[-1])} members. The first said: {result.failures[0].message}"
            )
    values, second = found
    with np.errstate(divide="ignore", invalid="ignore"):
        return Reference(values=values, doubt=np.abs(second - values) / np.abs(values))


def measure_trade(
    models: Mapping[str, Model],
    of: Sequence[str] | None = None,
    *,
    members: int = MEMBERS,
    spread: float = SPREAD,
    configurations: Sequence[Configuration] | None = None,
    fast_math: EnsembleDriver | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Trade:
    """Measure errors and times.

    Parameters
    ----------
    models : by name, the ``full`` one among them
    of : quantities, ``peak_ball_force``, ``rms:inner.y``, ...  Default: peak ball force, rms and range of the inner
        ring's motion
    configurations : default: all that the models and the compiler allow
    fast_math : the full model's stepper, compiled so that arithmetic may be reordered
    progress : called with what is under way and the finished fraction of it

    Raises
    ------
    RequestError
        A wrong request.
    SimulationError
        There is no reference.
    """
    say = progress or (lambda _, __: None)
    full = models[FULL]
    names = tuple(of) if of is not None else default_observables(full)
    observables = check_observables(full, names)
    if members < 2:
        raise RequestError(f"members: at least 2 are needed for a 95 % point, not {members!r}.")
    if configurations is None:
        configurations = (
            *full_configurations(full),
            *(one for name in models if name != FULL for one in simple_configurations(name)),
            *(switched_configurations() if fast_math is not None else ()),
            *located_configurations(full),
        )
    sets = perturbed(full, members, spread)
    reference = make_reference(full, sets, names, lambda f: say("making the reference", f))
    errors = np.full((len(configurations), members, len(names)), np.nan)
    times = np.full((len(configurations), members), np.nan)
    failures = np.zeros(len(configurations), dtype=int)
    order = np.random.default_rng(2)
    turns = 1.0
    for member in range(members):
        ready = {
            name: _prepare(model, {path: float(values[member]) for path, values in sets.items()})
            for name, model in models.items()
        }
        turns = ready[FULL].cycles
        for k in order.permutation(len(configurations)):
            one = configurations[k]
            if _is_sampled(one) and member >= SAMPLED_MEMBERS:
                continue
            values, seconds = _integrate(ready[one.model], observables, one, fast_math)
            if values is None:
                failures[k] += 1
                errors[k, member] = np.inf
                continue
            with np.errstate(divide="ignore", invalid="ignore"):
                errors[k, member] = np.abs(values / reference.values[member] - 1.0)
            times[k, member] = seconds / turns
        say("measuring", (member + 1) / members)
    doubt = np.nanquantile(reference.doubt, PROMISED, axis=0)
    measured = tuple(
        _summary(one, errors[k], times[k], doubt, names, int(failures[k])) for k, one in enumerate(configurations)
    )
    return Trade(
        scene=full.manifest.scene,
        title=full.manifest.title,
        quantities=names,
        values=dict(zip(names, np.nanmedian(reference.values, axis=0).tolist(), strict=True)),
        uncertainty=dict(zip(names, doubt.tolist(), strict=True)),
        members=members,
        spread=spread,
        cycles=turns,
        numbers=dict(full.parameters),
        measured=measured,
    )


def _prepare(model: Model, numbers: Mapping[str, float]) -> Prepared:
    """A simpler model has no parameters for what it leaves out."""
    return prepare(model, {path: value for path, value in numbers.items() if path in model.parameters})


def _is_sampled(one: Configuration) -> bool:
    return one.method in ("rosenbrock", "erk", "cvodes")


def _integrate(
    ready: Prepared, observables: Sequence[Observable], one: Configuration, fast_math: EnsembleDriver | None
) -> tuple[np.ndarray | None, float]:
    driver = fast_math if one.switch == FAST_MATH else None
    if one.switch == KINKS_LOCATED:
        driver = ready.model.ensemble_driver.with_stepper(ready.model.locating_stepper)
    try:
        done = ready.run(observables, one.method, one.rtol, driver)
    except SimulationError:
        return None, math.nan
    return np.array(done.values), done.seconds


def _summary(
    one: Configuration,
    errors: np.ndarray,
    times: np.ndarray,
    doubt: np.ndarray,
    names: Sequence[str],
    failures: int,
) -> Measured:
    tried = errors[~np.all(np.isnan(errors), axis=1)]
    # a member without result counts as infinitely wrong: quantiles of the method "higher" keep that
    median = np.quantile(tried, 0.5, axis=0, method="higher")
    promised = np.quantile(tried, PROMISED, axis=0, method="higher")
    return Measured(
        configuration=one,
        time=float(np.nanmedian(times)) if np.any(np.isfinite(times)) else math.inf,
        median=dict(zip(names, np.maximum(median, doubt).tolist(), strict=True)),
        promised=dict(zip(names, np.maximum(promised, doubt).tolist(), strict=True)),
        failures=failures,
    )
