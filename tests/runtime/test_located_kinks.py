"""Claims about runs whose steps end on the kinks of the laws: times, orders, work, and who pays."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from quick_cases import long_but
from scipy.integrate import solve_ivp
from stepper_methods import FAMILY_ORDERS, NAMES
from stepper_runs import segments_between

from ballpass.runtime import Model, load_solution
from ballpass.runtime.app.summary import summarize
from ballpass.runtime.app.summary_table import render_summary
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.native.stepper import Outcome, Stepper

Make = Callable[..., Model]

#: A ring of 20 kg in 8 balls that stand still, the outer ring fixed, no damping but that of the balls.
STANDING = (
    ('speed = "393.1540342298 rpm"', 'speed = "0 rpm"'),
    ('damping = "200 N*s/m"  ', '#damping = "0 N*s/m"'),
    ("cycles = 24 ", 'duration = "0.02 s" #'),
    ("transient_cycles = 20", "transient_cycles = 0"),
)
LAW = 'law = "none"'
GATED = (LAW, 'law = "two-sided-gated"\ncoefficient = "4000 N*s/m"')
ONE_SIDED = (LAW, 'law = "one-sided"\ncoefficient = "2000 N*s/m"')
TANGENT = (LAW, 'law = "tangent"\nratio = "4e-6 s"')
SEVEN = ("balls = 8", "balls = 7")
MASS, LOAD, CLEARANCE = 20.0, 196.0, 40e-6


@pytest.fixture(scope="module")
def hertz(make_model: Make) -> Model:
    return make_model("varying_compliance", *STANDING)


@pytest.fixture(scope="module")
def gated(make_model: Make) -> Model:
    return make_model("varying_compliance", *STANDING, GATED)


@pytest.fixture(scope="module")
def tangent(make_model: Make) -> Model:
    return make_model("varying_compliance", *STANDING, TANGENT)


@pytest.fixture(scope="module")
def preloaded(make_model: Make) -> Model:
    """Seven balls that never leave their raceways, damped one way only: kinks of the rate, and no others."""
    return make_model(
        "varying_compliance", *STANDING[1:], ONE_SIDED, SEVEN, ('clearance = "0 um"', 'clearance = "-20 um"')
    )


def call(
    model: Model,
    stepper: Stepper,
    start: np.ndarray,
    end: float,
    *,
    method: str = "dp54",
    tolerance: float = 1e-9,
    overrides: dict[str, float] | None = None,
    **options: float,
) -> tuple[Outcome, np.ndarray]:
    """One raw call without samples; the tolerance is relative to micrometres and millimetres a second."""
    numbers = model.numbers(overrides)
    x = np.array(start, dtype=float)
    half = len(x) // 2
    outcome = stepper.run(
        method=method,
        tolerance=tolerance * np.repeat([1e-6, 1e-3], half),
        p=numbers.p,
        c=numbers.c,
        x=x,
        segments=segments_between(model, numbers, np.array([0.0, end])),
        output_times=np.zeros(0),
        output_states=None,
        **options,  # type: ignore[arg-type]
    )
    return outcome, x


def time_of_kink(model: Model, start: np.ndarray, end: float, family: str, overrides: dict[str, float]) -> float:
    """End of the first step that ends on a kink [s]."""
    for most in range(1, 200):
        outcome, _ = call(model, model.locating_stepper, start, end, method=family, overrides=overrides, max_steps=most)
        if outcome.kinks:
            return outcome.time
    raise AssertionError("no kink was located")


@pytest.mark.parametrize("family", list(FAMILY_ORDERS))
@pytest.mark.parametrize("law", ["hertz", "gated"])
def test_a_falling_ring_meets_its_ball_when_the_parabola_says(
    request: pytest.FixtureRequest, law: str, family: str
) -> None:
    """From rest in the middle of the clearance: delta = F t^2 / (2 m) - P_d / 2."""
    model: Model = request.getfixturevalue(law)
    located = time_of_kink(model, np.zeros(4), 0.02, family, {"bearing.clearance": CLEARANCE})
    assert located == pytest.approx(np.sqrt(CLEARANCE * MASS / LOAD), rel=1e-12, abs=0.0)


#: Length of a run of the preloaded ring, and numbers of equal steps at which the order shows, far from rounding: of
#: most methods, and of some.
MOST_SPANS = (2.5e-3, (40, 80, 160))
SPANS = {
    "rodas5p": (2.5e-3, (28, 40, 56, 80)),
    "dop853": (3.7e-3, (14, 20, 28, 40)),
}


@pytest.mark.parametrize("family", list(FAMILY_ORDERS))
def test_located_kinks_restore_the_order_of_the_method(preloaded: Model, family: str) -> None:
    """With steps of one size: stepped over, kinks leave about the second order; located, the method has its own."""
    start = np.array([3e-6, -1e-6, 0.0, 0.0])
    end, counts = SPANS.get(family, MOST_SPANS)
    fine = {"method": "dop853", "tolerance": 1e-6, "largest_step": end / 800}
    _, reference = call(preloaded, preloaded.locating_stepper, start, end, **fine)
    orders, last = [], []
    for stepper in (preloaded.locating_stepper, preloaded.stepper):
        errors = []
        for count in counts:
            size = {"largest_step": end / count, "first_step": end / count}
            outcome, x = call(preloaded, stepper, start, end, method=family, tolerance=0.03, **size)
            assert outcome.rejected == outcome.kinks, "the tolerance took part"
            errors.append(float(np.max(np.abs(x - reference) / np.repeat([1e-6, 1e-3], 2))))
        orders.append(-np.polyfit(np.log(counts), np.log(errors), 1)[0])
        last.append(errors[-1])
    assert orders[0] > FAMILY_ORDERS[family][0] - 0.35
    assert orders[1] < 3.3
    assert last[0] < 0.02 * last[1]


@pytest.mark.long
@pytest.mark.parametrize(("family", "longest"), [("dp54", 16e-6), ("dop853", 24e-6)])
def test_a_step_behind_an_onset_has_its_order_in_the_root_of_time(tangent: Model, family: str, longest: float) -> None:
    """A step of h from there is off by h^((p + 1) / 2) or less; stepped over it is off by h^(3/2), whatever its order.

    The ring flies onto its ball at 0.3 m/s; the tangent damping grows like the root of the time since.
    """
    start = np.array([0.5 * CLEARANCE - 3e-13, 0.0, 0.3, 0.0])
    spans = longest * np.array([0.35, 0.5, 0.7, 1.0])
    overrides = {"bearing.clearance": CLEARANCE}
    found, last = [], []
    for stepper, steps in ((tangent.locating_stepper, 2), (tangent.stepper, 1)):
        errors = []
        for span in spans:
            _, exact = call(
                tangent,
                tangent.locating_stepper,
                start,
                span,
                method="dop853",
                tolerance=1e-11,
                overrides=overrides,
            )
            _, second = call(
                tangent, tangent.stepper, start, span, method="rodas5p", tolerance=1e-10, overrides=overrides
            )
            assert abs(second[2] - exact[2]) < 1e-12
            loose = {"method": family, "tolerance": 0.1, "first_step": span, "overrides": overrides}
            outcome, x = call(tangent, stepper, start, span, **loose)  # type: ignore[arg-type]
            assert outcome.steps == steps, "the tolerance took part"
            errors.append(abs(x[2] - exact[2]))
        found.append(np.polyfit(np.log(spans), np.log(errors), 1)[0])
        last.append(errors[-1])
    assert found[0] > 0.5 * (FAMILY_ORDERS[family][0] + 1) - 0.2
    assert found[1] == pytest.approx(1.5, abs=0.1)
    assert last[0] < 1e-3 * last[1]


def test_a_step_that_looks_for_the_end_of_a_contact_stays_within_its_run(hertz: Model) -> None:
    """The run ends half a nanosecond before its ball leaves, and its last step aims a little short of that."""
    start, overrides = np.array([0.5 * CLEARANCE + 22.73e-6, 0.0, -0.0697, 0.0]), {"bearing.clearance": CLEARANCE}
    release = time_of_kink(hertz, start, 0.01, "dp54", overrides)
    for before in np.geomspace(2.5e-6, 3.3e-6, 50):
        end = release * (1.0 - before)
        outcome, _ = call(hertz, hertz.locating_stepper, start, end, tolerance=1e-4, overrides=overrides)
        assert (outcome.time, outcome.kinks) == (end, 0)


@pytest.mark.long
@pytest.mark.parametrize("law", ["hertz", "tangent"])
def test_contacts_cost_a_few_steps_and_not_a_cascade(request: pytest.FixtureRequest, law: str) -> None:
    """A ring bounces on turning balls.  At a tight tolerance steps of its own clock enter and leave each contact.

    SciPy finds as many contacts.  After thirty, each of which amplifies what came before, the error is less than
    that of stepping over at a tenth of the tolerance, and the work less than half.
    """
    model: Model = request.getfixturevalue(law)
    start, parameters = np.array([0.0, 1e-6, 0.0, 0.0]), {"bearing.clearance": CLEARANCE, "shaft.speed": 41.17}
    expected, contacts = bounce(model, start, 0.06, parameters, tangent=4e-6 if law == "tangent" else 0.0)
    work, error = {}, {}
    for kinks, rtol in (("located", 1e-10), ("stepped-over", 1e-11)):
        run = model.simulate(
            duration=0.06,
            method="stepper-dop853",
            rtol=rtol,
            kinks=kinks,  # type: ignore[arg-type]
            initial=start,
            parameters=parameters,
            outputs=[],
        )
        done = run.statistics
        error[kinks] = float(np.max(np.abs(run.x[-1] - expected) / done.magnitudes))
        work[kinks] = done.steps + done.rejected
        if kinks == "located":
            assert done.located == contacts
            assert done.rejected < 3 * contacts
    assert error["located"] < 2e-7
    assert error["located"] < error["stepped-over"]
    assert 2 * work["located"] < work["stepped-over"]


@pytest.mark.parametrize("depth", [1e-13, 1e-11, 1e-9, 1e-7])
@pytest.mark.parametrize("family", list(FAMILY_ORDERS))
def test_a_touch_within_a_step_of_free_flight_is_not_missed(hertz: Model, family: str, depth: float) -> None:
    """Thrown against the load, the ring turns back behind its ball: one step would do for the whole parabola."""
    pull = LOAD / MASS
    start = np.array([0.0, 0.0, -np.sqrt(2.0 * pull * (0.5 * CLEARANCE + depth)), 0.0])
    given = {"method": family, "overrides": {"bearing.clearance": CLEARANCE}, "tolerance": 1e-9}
    outcome, _ = call(hertz, hertz.locating_stepper, start, -1.5 * start[2] / pull, **given)  # type: ignore[arg-type]
    assert outcome.kinks >= 2


#: Numbers of a scene that change how often and how hard balls land, and by what factor they are varied at most.
VARIED = {
    "bearing.clearance": 10.0,
    "bearing.outer_ring.damping": 10.0,
    "bearing.outer_ring.stiffness": 10.0,
    "bearing.outer_ring.mass": 10.0,
    "bearing.damping.ratio": 10.0,
    "mechanism.driver.speed": 3.0,
    "shaft.speed": 3.0,
}


@pytest.mark.long
@pytest.mark.parametrize(
    "scene",
    [
        "varying_compliance",
        *(
            pytest.param(name, marks=pytest.mark.long)
            for name in ("punching_press", "punching_press_tangent", "offset_slider", "four_bar")
        ),
    ],
)
def test_machines_of_all_kinds_end_and_agree_with_a_second_method(make_model: Make, scene: str) -> None:
    """Random members of each shipped scene: at any tolerance a run ends, and at a tight one it is right.

    The second method steps over kinks at 1e-12; where it does not agree with a third the motion is chaotic, and nothing
    can be said.
    """
    model = make_model(scene)
    rng = np.random.default_rng(20261121)
    scenes = {name: value for name, value in model.numbers().values.items() if name in VARIED}
    given = {"cycles": 1, "transient": 0, "outputs": [], "samples_per_cycle": 50}
    told = 0
    for _ in range(10):
        parameters = {name: value * VARIED[name] ** rng.uniform(-1.0, 1.0) for name, value in scenes.items()}
        for method in ("stepper", "stepper-dp54", "stepper-dop853"):
            rtol = float(10.0 ** rng.uniform(-10.0, -3.0))
            model.simulate(**given, parameters=parameters, method=method, rtol=rtol, kinks="located")  # type: ignore[arg-type]
        second, third = (
            model.simulate(**given, parameters=parameters, method=method, rtol=1e-12, kinks="stepped-over")  # type: ignore[arg-type]
            for method in ("stepper-rodas5p", "stepper-dop853")
        )
        magnitudes = np.array(second.statistics.magnitudes)
        if np.max(np.abs(second.x - third.x) / magnitudes) > 1e-7:
            continue
        told += 1
        for method in ("stepper", "stepper-dp54"):
            found = model.simulate(**given, parameters=parameters, method=method, rtol=1e-10, kinks="located")  # type: ignore[arg-type]
            assert np.max(np.abs(found.x - second.x) / magnitudes) < 1e-6, (parameters, method)
    assert told >= 3


#: Members at which steps of their own clock once fell to the resolution of time, with a tolerance.
FELL = [
    (
        "four_bar",
        4.3e-8,
        {
            "bearing.clearance": 4.173964050084234e-05,
            "bearing.outer_ring.damping": 611.3762778117613,
            "bearing.damping.ratio": 2.4559662188614567e-05,
            "mechanism.driver.speed": 62.42609511283044,
            "bearing.outer_ring.stiffness": 16389897.679792741,
        },
    ),
    pytest.param(
        "offset_slider",
        1.1531105622470469e-09,
        {"bearing.damping.ratio": 1.4060242993123647e-05, "bearing.outer_ring.stiffness": 407884022.8325939},
        marks=pytest.mark.long,
    ),
    (
        "four_bar",
        0.0004777010427687992,
        {
            "bearing.outer_ring.damping": 304.09579688126894,
            "mechanism.driver.speed": 118.56167798533038,
            "bearing.outer_ring.mass": 2.933840912660316,
        },
    ),
]


@pytest.mark.long
@pytest.mark.parametrize(("scene", "rtol", "parameters"), FELL)
def test_steps_foreseen_or_left_over_do_not_vanish(
    make_model: Make, scene: str, rtol: float, parameters: dict[str, float]
) -> None:
    run = make_model(scene).simulate(
        cycles=2,
        transient=0,
        parameters=parameters,
        method="stepper-dop853",
        rtol=rtol,
        kinks="located",
        outputs=[],
        samples_per_cycle=50,
    )
    assert run.statistics.rejected < 3 * (run.statistics.located or 0)


def bounce(
    model: Model,
    start: np.ndarray,
    end: float,
    parameters: dict[str, float],
    *,
    gated: float = 0.0,
    tangent: float = 0.0,
) -> tuple[np.ndarray, int]:
    """State at the end, and contacts begun or ended, by SciPy with an event at each; the equations are written here.

    `gated`: damping of a ball that touches [N s/m]; `tangent`: its damping over its stiffness [s].
    """
    cage = model.constants(parameters)["bearing.cage_speed"]
    angles = 2.0 * np.pi * np.arange(8) / 8.0

    def deflection(t: float, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        co, si = np.cos(cage * t + angles), np.sin(cage * t + angles)
        rate = x[2] * co + x[3] * si + cage * (x[1] * co - x[0] * si)
        return co, si, x[0] * co + x[1] * si - 0.5 * CLEARANCE, rate

    def motion(t: float, x: np.ndarray, touching: np.ndarray) -> list[float]:
        co, si, delta, rate = deflection(t, x)
        depth = np.maximum(delta, 0.0)
        force = 13.34e9 * (depth**1.5 + 1.5 * tangent * np.sqrt(depth) * rate) + np.where(touching, gated * rate, 0.0)
        return [x[2], x[3], (LOAD - force @ co) / MASS, -(force @ si) / MASS]

    t, x, met = 0.0, start, 0
    touching = deflection(t, x)[2] > 0.0
    while t < end:
        events = []
        for ball in range(8):

            def event(t: float, x: np.ndarray, _: np.ndarray, ball: int = ball) -> float:
                return float(deflection(t, x)[2][ball])

            event.terminal, event.direction = True, -1.0 if touching[ball] else 1.0  # type: ignore[attr-defined]
            events.append(event)
        part = solve_ivp(
            motion,
            (t, end),
            x,
            method="DOP853",
            rtol=1e-13,
            atol=np.array([1e-18, 1e-18, 1e-15, 1e-15]),
            events=events,
            args=(touching,),
        )
        t, x = float(part.t[-1]), part.y[:, -1]
        for ball in range(8):
            touching[ball] ^= len(part.t_events[ball]) > 0
            met += len(part.t_events[ball])
    return x, met


@pytest.mark.parametrize("method", long_but(NAMES, "stepper-rodas4"))
def test_a_force_that_jumps_agrees_with_events_of_scipy(gated: Model, method: str) -> None:
    """A ring falls through its clearance and bounces on turning balls, whose damping begins and ends with a jump.

    To 1e-9 at rtol 1e-11, to ten tolerances at 1e-6, and with fewer steps than stepping over takes.
    """
    start, parameters = np.array([0.0, 1e-6, 0.0, 0.0]), {"bearing.clearance": CLEARANCE, "shaft.speed": 41.17}
    expected, contacts = bounce(gated, start, 0.06, parameters, gated=4000.0)
    for rtol, allowed in ((1e-6, 1e-5), (1e-11, 1e-9)):
        tried = {}
        for kinks in ("located", "stepped-over"):
            solution = gated.simulate(
                duration=0.06, method=method, rtol=rtol, kinks=kinks, initial=start, parameters=parameters, outputs=[]
            )
            run = solution.statistics
            tried[kinks] = run.steps + run.rejected
            if kinks == "located":
                assert run.located == contacts == 16
                assert np.max(np.abs(solution.x[-1] - expected) / run.magnitudes) < allowed
        assert tried["located"] < tried["stepped-over"]


@pytest.mark.parametrize("family", list(FAMILY_ORDERS))
@pytest.mark.parametrize("above", [0.0, 1e-20, -1e-20, 1e-15, -1e-15, 1e-12, -1e-12, 1e-9])
def test_grazing_ends(gated: Model, family: str, above: float) -> None:
    """A ring thrown so high that it touches a ball at rest, or stops just before or behind."""
    pull = LOAD / MASS
    start = np.array([0.0, 0.0, -np.sqrt(2.0 * pull * (0.5 * CLEARANCE + above)), 0.0])
    given = {"method": family, "overrides": {"bearing.clearance": CLEARANCE}, "max_steps": 20_000}
    located, over = (
        call(gated, stepper, start, 2.5 * -start[2] / pull, **given)[0]  # type: ignore[arg-type]
        for stepper in (gated.locating_stepper, gated.stepper)
    )
    assert located.end.name == "DONE"
    assert located.steps + located.rejected <= 1.5 * (over.steps + over.rejected) + 20


@pytest.mark.parametrize("family", list(FAMILY_ORDERS))
@pytest.mark.parametrize("load", [LOAD, -LOAD, 0.0])
def test_a_start_on_the_kink_ends(gated: Model, family: str, load: float) -> None:
    for place in (0.5 * CLEARANCE, -0.5 * CLEARANCE, np.nextafter(0.5 * CLEARANCE, 1.0)):
        overrides = {"bearing.clearance": CLEARANCE, "load.force.x": load}
        given = {"method": family, "overrides": overrides, "max_steps": 20_000}
        start = np.array([place, 0.0, 0.0, 0.0])
        located, x = call(gated, gated.locating_stepper, start, 5e-3, **given)  # type: ignore[arg-type]
        over, expected = call(gated, gated.stepper, start, 5e-3, **given)  # type: ignore[arg-type]
        assert located.end.name == "DONE"
        assert located.steps + located.rejected <= 1.5 * (over.steps + over.rejected) + 20
        assert np.abs(x - expected).max() < 1e-6 * np.abs(expected).max() + 1e-15


@pytest.mark.parametrize("family", list(FAMILY_ORDERS))
def test_a_ring_at_rest_does_not_chatter(preloaded: Model, family: str) -> None:
    """Rates are rounding, or what an explicit method at the limit of its stability makes of it: work stays bounded."""
    rest = preloaded.static_equilibrium(0.0).x
    overrides = {"shaft.speed": 0.0}
    located, x = call(preloaded, preloaded.locating_stepper, rest, 0.2, method=family, overrides=overrides)
    over, _ = call(preloaded, preloaded.stepper, rest, 0.2, method=family, overrides=overrides)
    assert located.end.name == "DONE"
    assert located.steps + located.rejected <= 3 * (over.steps + over.rejected) + 20
    assert np.abs(x - rest)[:2].max() < 1e-12


def test_balls_that_meet_their_raceway_at_once_are_one_kink(hertz: Model) -> None:
    """The load points between two balls, which stay each other's mirror image."""
    overrides = {"bearing.clearance": CLEARANCE, "bearing.ball_angle": np.pi / 8.0}
    outcome, x = call(hertz, hertz.locating_stepper, np.zeros(4), 2.5e-3, overrides=overrides)
    assert outcome.kinks == 1
    assert abs(x[1]) < 1e-9 * abs(x[0])


@pytest.mark.long
def test_smoothed_laws_have_no_kinks_and_pay_for_none(make_model: Make, tmp_path: Path) -> None:
    smoothing = ("[bearing.contact]\n", '[bearing.contact]\nsmoothing = "0.05 um"\n')
    model = make_model("varying_compliance", smoothing)
    assert all(name != "switches.h" for name, _ in model.manifest.files)
    located, plain = (model.simulate(2, transient=0, kinks=kinks) for kinks in ("located", None))
    assert np.array_equal(located.x, plain.x)
    assert (located.statistics.kinks, located.statistics.located) == ("located", 0)


@pytest.mark.long
def test_opposite_balls_take_the_kink_of_one_sided_damping_out_of_the_motion(make_model: Make) -> None:
    """Preloaded, eight balls have nothing to locate, seven do."""
    changes = (*STANDING[1:], ONE_SIDED, ('clearance = "0 um"', 'clearance = "-20 um"'))
    found = {}
    for count in (8, 7):
        model = make_model("varying_compliance", *changes, ("balls = 8", f"balls = {count}"))
        found[count] = model.simulate(duration=0.02, kinks="located").statistics.located
    assert found[8] == 0
    assert found[7] > 50


def test_runs_say_what_they_did_at_kinks(gated: Model, tmp_path: Path) -> None:
    given = {"duration": 0.01, "parameters": {"bearing.clearance": CLEARANCE}}
    over, located = (gated.simulate(**given, rtol=1e-5, kinks=kinks) for kinks in ("stepped-over", "located"))  # type: ignore[arg-type]
    assert (over.statistics.kinks, over.statistics.located) == ("stepped-over", None)
    assert located.statistics.located is not None
    assert located.statistics.located > 0
    read = load_solution(located.save(tmp_path / "located.nc"))
    assert read.statistics == located.statistics
    summary = summarize(gated, located)
    assert summary["located_kinks"] == {"value": located.statistics.located, "unit": "1"}
    assert f"{located.statistics.located} kinks located" in str(render_summary(summary, gated.manifest)[0].caption)
    assert "located_kinks" not in summarize(gated, over)
    assert gated.simulate(**given, method="cvodes").statistics.kinks is None  # type: ignore[arg-type]


def test_kinks_are_located_by_default_where_the_tolerance_is_tight(gated: Model, make_model: Make) -> None:
    """At the default tolerance of scenes; methods named by hand step over, and ensembles too unless a law jumps."""
    tight = 1e-6
    for model, lanes in ((gated, "located"), (make_model("varying_compliance"), "stepped-over")):
        many = model.simulate_many(
            {"bearing.clearance": [CLEARANCE]}, "max:inner.y", duration=0.01, transient=0, rtol=tight
        )
        assert many.statistics.kinks == lanes
        for method, rtol, expected in (
            ("auto", tight, "located"),
            ("stepper", tight, "located"),
            ("stepper", 3.5 * tight, "stepped-over"),
            ("stepper-dop853", tight, "stepped-over"),
        ):
            run = model.simulate(duration=0.01, method=method, rtol=rtol)
            assert run.statistics.kinks == expected, (method, rtol)
            named = model.simulate(duration=0.01, method=method, rtol=rtol, kinks=expected)  # type: ignore[arg-type]
            assert np.array_equal(run.x, named.x)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"kinks": "locate"}, "Did you mean 'located'"),
        ({"kinks": "located", "method": "cvodes"}, "Take one of these, or leave kinks stepped-over"),
        ({"kinks": "located", "method": "cvodes"}, "stepper-dp54"),
        ({"kinks": "located", "error": 0.01}, "Leave kinks out"),
    ],
)
def test_what_cannot_locate_is_refused_with_a_remedy(gated: Model, given: dict[str, object], said: str) -> None:
    with pytest.raises(RequestError, match=said):
        gated.simulate(duration=0.01, **given)  # type: ignore[arg-type]
