"""Each method on the stiffest and the least damped case; refusals with cause, place and remedy; laws that jump."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from hand_written_press import Machine
from replacements import BEFORE_PUNCH, CLEARANCE, CRANK, OUTER, PUNCH, RATIO, ROTOR_LOAD, SPEED, START
from stepper_methods import EXPLICIT, NAMES, ORDERS
from test_numbers import difference

from ballpass.runtime import IntegrationError, Model
from ballpass.runtime.contract.errors import RequestError, SimulationError

pytestmark = pytest.mark.extreme

Holds = Callable[..., None]
Press = Callable[..., Model]

STEPPERS = ("stepper", *NAMES)
#: CasADi's integrator, in its virtual machine.
CASADI = "cvodes"

#: Law, numbers, part of a turn, SciPy's method and tolerance.
CASES = {
    # the printed ratio read in SI (eigenvalues to -1e6 1/s with the shipped rings), and an outer ring of a gramme
    "stiffest": ("one-sided", {RATIO: 0.25e-5, f"{OUTER}.mass": 1e-3, START: BEFORE_PUNCH}, 0.15, "LSODA", 1e-9),
    "no damping": ("none", {f"{OUTER}.damping": 0.0, START: BEFORE_PUNCH}, 0.05, "DOP853", 1e-11),
}


@pytest.fixture(scope="module")
def expected(press: Press) -> Callable[[str], np.ndarray]:
    """States by SciPy on the press written by hand."""

    @cache
    def states(kind: str) -> np.ndarray:
        law, numbers, turns, by, tight = CASES[kind]
        model = press(law)
        solution = model.simulate(cycles=turns, parameters=numbers, samples_per_cycle=1000, transient=0)
        size = 1e-2 * (np.max(np.abs(solution.x), axis=0) + 1e-12)
        return Machine.of(model, numbers).integrate(solution.t, solution.x[0], method=by, rtol=tight, magnitude=size)

    return states


@pytest.mark.parametrize("kind", ["stiffest", "no damping"])
@pytest.mark.parametrize("method", [*STEPPERS, CASADI])
def test_every_method(
    press: Press, holds: Holds, expected: Callable[[str], np.ndarray], kind: str, method: str
) -> None:
    """Every method on the stiffest case and without any damping, against SciPy on the press written by hand."""
    law, numbers, turns, _, _ = CASES[kind]
    rtol = 1e-8 if kind == "stiffest" else 1e-10
    solution = press(law).simulate(
        cycles=turns, parameters=numbers, method=method, rtol=rtol, samples_per_cycle=1000, transient=0
    )
    holds(difference(solution.x, expected(kind)), 1e-3, f"{solution.statistics.steps} steps")


STIFFER = {RATIO: 2.5e-4, f"{OUTER}.mass": 1e-3, START: BEFORE_PUNCH}


@pytest.mark.parametrize("method", ["stepper", CASADI])
def test_a_hundred_times_stiffer_still(press: Press, holds: Holds, method: str) -> None:
    """A hundred times stiffer still: implicit methods agree with rodas4 at 1e-9."""
    solution, tight = (
        press().simulate(cycles=1, parameters=STIFFER, method=by, rtol=rtol, samples_per_cycle=100, transient=0)
        for by, rtol in ((method, 1e-6), ("stepper-rodas4", 1e-9))
    )
    holds(difference(solution.x, tight.x), 1e-2, f"{solution.statistics.steps} steps")


@pytest.mark.parametrize(
    ("method", "error", "words"),
    [
        *(
            pytest.param(
                name, IntegrationError, r"more steps than allowed.*an explicit method crawls on a stiff model",
                marks=[pytest.mark.long] if ORDERS[name][0] > 5 else [],
            )
            for name in EXPLICIT
        ),
    ],
)  # fmt: skip
def test_explicit_methods_are_given_up(press: Press, method: str, error: type[Exception], words: str) -> None:
    """A hundred times stiffer still: explicit methods are refused with a remedy, after bounded work."""
    with pytest.raises(error, match=f"(?s){words}"):
        press().simulate(cycles=1, parameters=STIFFER, method=method, samples_per_cycle=100, transient=0)


#: What a refusal on the way says besides its cause: where and when, and the ball, or that none is in contact.
WHERE = (
    r"Method \S+, t = [\d.e+-]+ s, crank angle [\d.]+ deg, \d+ samples kept in \.partial\."
    r".*(ball \d+ at [\d.]+ deg|No ball is in contact there)"
)
TOO_SMALL = r"(step size fell to the resolution of time|stopped being finite).*check initial state"


def _assert_told(caught: IntegrationError, cause: str, kept: int) -> None:
    said = str(caught)
    assert re.search(cause, said, re.DOTALL), said
    assert re.search(WHERE, said, re.DOTALL), said
    assert len(caught.partial.t) >= kept
    assert np.all(np.isfinite(caught.partial.x))
    assert caught.partial.t[-1] <= caught.time * (1.0 + 1e-12)
    assert caught.ball is not None


@pytest.mark.parametrize("method", [*STEPPERS, CASADI])
def test_a_start_at_1e200_m(press: Press, method: str) -> None:
    """A start from which forces overflow at once is refused with cause, place and the samples so far."""
    with pytest.raises(IntegrationError) as caught:
        press().simulate(cycles=1, initial=np.full(8, 1e200), method=method, transient=0)
    _assert_told(caught.value, TOO_SMALL + r"|integrator could not go on.*a looser rtol", 1)


@pytest.mark.parametrize("method", STEPPERS[::2])
def test_a_load_of_1e300_n(press: Press, method: str) -> None:
    """A load of 1e300 N is refused with cause, place and the samples before it."""
    with pytest.raises(IntegrationError) as caught:
        press().simulate(cycles=1, parameters={PUNCH: 1e300}, method=method, transient=0)
    _assert_told(caught.value, TOO_SMALL, 50)


@pytest.mark.parametrize(
    ("request_it", "error", "words"),
    [
        pytest.param(
            lambda model: model.reduce(cycles=3, parameters={PUNCH: 1e300}), SimulationError,
            TOO_SMALL + r".*crank angle [\d.]+ deg.*ball \d+ at", id="reduce, load of 1e300 N",
        ),
        pytest.param(
            lambda model: model.simulate(cycles=1, parameters={CRANK: 0.1}), RequestError,
            r"cannot be assembled at joint 'C'.*Change the lengths", id="linkage at its dead centre",
        ),
        pytest.param(
            lambda model: model.simulate(cycles=1, parameters={SPEED: 0.0}), RequestError,
            r"nothing turns.*Give duration", id="turns of a shaft that stands",
        ),
        pytest.param(
            lambda model: model.simulate(cycles=100_000), RequestError,
            r"would not fit into memory.*Model\.reduce", id="100 000 turns with 2000 samples each",
        ),
        pytest.param(
            lambda model: model.simulate(cycles=1, rtol=1e-14), RequestError, r"rtol: a number from 1e-13",
            id="rtol 1e-14",
        ),
    ],
)  # fmt: skip
def test_refusals_name_cause_and_remedy(
    press: Press, request_it: Callable[[Model], object], error: type[Exception], words: str
) -> None:
    """What cannot be met is refused with cause and remedy."""
    with pytest.raises(error, match=f"(?s){words}"):
        request_it(press())


@pytest.mark.parametrize("method", ["stepper", *STEPPERS[2:4]])
def test_growth_without_bound(
    rotor: Press, holds: Holds, boundless: Callable[[Model], Model], method: str
) -> None:  # fmt: skip
    """Damping of the wrong sign: refused with the samples kept, which grow as the closed form does."""
    model = boundless(rotor())
    rate, mass, speed = 200.0, 1.0, 1.0
    numbers = {
        "shaft.speed": 0.0, "bearing.inner_ring.damping": -rate * mass, "bearing.inner_ring.mass": mass,
        CLEARANCE: 1e300, "load.force.x": 0.0, "load.force.y": 0.0, "bearing.initial.inner.x": 0.0,
        "bearing.initial.inner.y": 0.0, "bearing.initial.inner_velocity.x": speed,
    }  # fmt: skip
    with pytest.raises(IntegrationError, match="check") as caught:
        model.simulate(duration=5.0, parameters=numbers, method=method, rtol=1e-8, samples_per_cycle=1000, transient=0)
    kept = caught.value.partial
    assert "samples kept in .partial" in str(caught.value)
    assert len(kept.t) > 10
    assert np.all(np.isfinite(kept.x))
    t = kept.t[1:]
    with np.errstate(over="ignore"):
        expected = speed * np.expm1(rate * t) / rate
    error = float(np.max(np.abs(kept["inner.x"][1:] / expected - 1.0)))
    holds(error, 1e-4, f"{len(kept.t)} samples kept, to {t[-1]:.3g} s")


@pytest.mark.parametrize("multiple", [1.0, *(pytest.param(k, marks=pytest.mark.long) for k in (30.0, 3000.0))])
@pytest.mark.parametrize("law", [pytest.param("one-sided-gated", marks=pytest.mark.long), "two-sided-gated"])
def test_laws_whose_force_jumps(press: Press, holds: Holds, law: str, multiple: float) -> None:
    """Laws whose force jumps at contact, times the shipped damping: steps a turn, rejected ones included."""
    model = press(law)
    numbers = {RATIO: multiple * model.parameters[RATIO]}
    statistics = model.simulate(cycles=4, parameters=numbers, transient=0).statistics
    holds(((statistics.steps or 0) + (statistics.rejected or 0)) / 4.0, 20_000.0)


@pytest.mark.long
@pytest.mark.parametrize("frequency", [1e3, 1e5])
def test_a_fast_load_on_a_shaft_that_stands(rotor: Press, holds: Holds, frequency: float) -> None:
    """A load that swings 1e5 times while nothing turns: velocity against the closed form."""
    harmonic = (
        'type = "harmonic"\nmean = ["0 N", "0 N"]\namplitude = ["20 N", "0 N"]\nfrequency = "40 Hz"\nphase = "0 deg"'
    )
    mass, amplitude, w = 20.0, 20.0, 2.0 * math.pi * frequency
    numbers = {
        "shaft.speed": 0.0, "load.frequency": frequency, "load.mean.x": 0.0, "load.amplitude.x": amplitude,
        CLEARANCE: 1.0, "bearing.inner_ring.damping": 0.0, "bearing.inner_ring.mass": mass,
        "bearing.initial.inner.x": 0.0, "bearing.initial.inner.y": 0.0,
    }  # fmt: skip
    solution = rotor((ROTOR_LOAD, harmonic)).simulate(
        duration=1.0, parameters=numbers, rtol=1e-12, samples_per_cycle=50, transient=0
    )
    speed = amplitude / (mass * w)
    error = float(np.max(np.abs(solution["inner.vx"] - speed * np.sin(w * solution.t)))) / speed
    holds(error, 1e-3, f"{solution.statistics.steps} steps")
