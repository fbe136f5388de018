"""Scenes that are one machine described in two ways, and what is asked of both.

`TWINS` has the pairs, `ASKED` the questions; `test_one_machine.py` compares their answers.
"""

from __future__ import annotations

import json
import math
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from typer.testing import CliRunner

from ballpass.derive.scene.units import looked_up_size
from ballpass.runtime import Model, RequestError
from ballpass.runtime.app.cli import app
from ballpass.runtime.contract.units import unit_size
from ballpass.runtime.plot.gallery import FIGURES
from ballpass.runtime.plot.record import gather
from ballpass.runtime.quantity.registry import KINDS
from ballpass.runtime.report.report import Report, ReportTable

# scenes: damped and preloaded, so that no motion is chaotic.  The cage makes 0.375 * 0.8 turns of the shaft, and its
# nine balls stand as before after ten of them, so that no peak has an equal in the turns of a run without a length.

BEARING = """
[bearing]
joint = "A"
share = 0.5
balls = 9
ball_diameter = "7.9375 mm"
pitch_diameter = "31.75 mm"
clearance = "-10 um"
ball_angle = "7 deg"
dynamic_rating = "13 kN"
static_rating = "6 kN"
[bearing.contact]
stiffness = "8e9 N/m^1.5"
[bearing.damping]
law = "tangent"
ratio = "4e-5 s"
[bearing.cage]
slip = 0.2
[bearing.inner_ring]
mass = "1 kg"
damping = "900 N*s/m"
[bearing.outer_ring]
support = "fixed"
"""
#: No length: the default one is compared as well.
RUN = "[run]\nrtol = 1e-9\n"

SHAFT = f"""
[shaft]
speed = "1200 rpm"
[loads.weight]
type = "constant"
force = ["40 N", "-300 N"]
[loads.push]
type = "table"
angle = ["20 deg", "130 deg", "250 deg", "330 deg"]
x = ["0 N", "60 N", "90 N", "10 N"]
y = ["20 N", "-90 N", "30 N", "0 N"]
[loads.unbalance]
type = "unbalance"
mass = "5 g"
eccentricity = "20 mm"
angle = "30 deg"
[loads.blow]
type = "constant"
force = ["100 N", "50 N"]
window = {{ start = "237 deg", end = "267 deg" }}
{BEARING.replace('joint = "A"', "")}"""

#: A crank and what it moves; the one-way bearing also has a load of its own.
DRIVER = """
[mechanism.driver]
joint = "A"
speed = "600 rpm"
start_angle = "10 deg"
"""
CRANK = f"""
[mechanism]
gravity = ["0 m/s^2", "-9.81 m/s^2"]
{DRIVER}
[mechanism.frame.points]
A = "origin"
guide = ["2 mm", "1 mm"]
[mechanism.bodies.crank]
mass = "1 kg"
inertia = "600 kg*mm^2"
center_of_mass = ["1 mm", "0.5 mm"]
points = {{ A = "origin", B = "8 mm" }}
[mechanism.joints.A]
type = "revolute"
bodies = ["frame", "crank"]
"""
LINKAGE = f"""{CRANK}
[mechanism.bodies.rod]
mass = "0.6 kg"
inertia = "1500 kg*mm^2"
center_of_mass = ["40 mm", "2 mm"]
points = {{ B = "origin", C = "100 mm" }}
[mechanism.bodies.slider]
mass = "1.5 kg"
center_of_mass = "origin"
points = {{ C = "origin" }}
[mechanism.joints.B]
type = "revolute"
bodies = ["crank", "rod"]
[mechanism.joints.C]
type = "revolute"
bodies = ["rod", "slider"]
branch = "ahead"
[mechanism.joints.D]
type = "prismatic"
bodies = ["frame", "slider"]
points = ["guide", "C"]
direction = "270 deg"
[mechanism.forces.punch]
body = "slider"
point = "C"
force = ["0 N", "900 N"]
window = {{ start = "237 deg", end = "267 deg" }}
[mechanism.forces.work]
body = "slider"
point = "C"
direction = "90 deg"
[mechanism.forces.work.table]
angle = ["30 deg", "140 deg", "230 deg", "300 deg"]
force = ["0 N", "120 N", "300 N", "40 N"]
"""
CARRIED = '[load]\ntype = "constant"\nforce = ["40 N", "-300 N"]\n'
MOTOR = 'torque = { law = "linear", no_load_speed = "620 rpm", stall_torque = "60 N*m" }\n'
FLYWHEEL = '[mechanism.driver.flywheel]\ninertia = "0.05 kg*m^2"\n'


def edited(text: str, *changes: tuple[str, str]) -> str:
    """The text with replacements, each of something that stands in it once."""
    for old, new in changes:
        assert text.count(old) == 1, f"{old!r} occurs {text.count(old)} times"
        text = text.replace(old, new)
    return text


def two_way(text: str) -> str:
    return edited(
        text,
        ("share = 0.5", 'coupling = "two-way"\ncount = 2'),
        ('[bearing.inner_ring]\nmass = "1 kg"\ndamping = "900 N*s/m"\n', ""),
    )


BASES: Mapping[str, str] = {
    "shaft": SHAFT,
    "one-way": LINKAGE + CARRIED + BEARING,
    "two-way": LINKAGE + two_way(BEARING),
    "motor": edited(LINKAGE, (DRIVER, DRIVER + MOTOR + FLYWHEEL)) + two_way(BEARING),
}
LINKAGES = ("one-way", "two-way", "motor")


# pairs


@dataclass(frozen=True, slots=True, kw_only=True)
class Machine:
    """A scene, and numbers that replace some of its own; `changed` finds them from the scene's."""

    text: str
    changed: Callable[[Mapping[str, float], Mapping[str, str]], Mapping[str, float]] = lambda values, units: {}


def unscaled(_unit: str) -> float:
    return 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Twin:
    """One machine described in two ways.

    Attributes
    ----------
    pair, base : what is described in two ways, and on which machine
    renamed : a name of the first as the second has it
    scale : by which numbers of a unit are larger in the second
    signs : whether numbers have the same sign in both
    but : where answers are of something else in both, a pattern of paths
    more : whether the second may have more, being several bearings
    questions : that are asked; all for none
    """

    pair: str
    base: str
    first: Machine
    second: Machine
    renamed: Callable[[str], str] = lambda text: text
    scale: Callable[[str], float] = unscaled
    signs: bool = True
    but: str = "(?!)"
    more: bool = False
    questions: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"{self.pair}, {self.base}"


SLIPS = 'slip = { time = ["0 s", "0.07 s", "3 s"], value = [0.2, 0.2, 0.2] }'
EVEN = """
[mechanism.driver]
joint = "A"
start_angle = "10 deg"
[mechanism.driver.table]
time = ["0 s", "0.13 s"]
speed = ["600 rpm", "600 rpm"]
"""
#: The force of the unbalance is mass * eccentricity * speed^2.
OMEGA = 1200.0 * math.pi / 30.0
HARMONIC = f"""type = "harmonic"
mean = ["0 N", "0 N"]
amplitude = ["{0.005 * 0.02 * OMEGA**2!r} N", "{0.005 * 0.02 * OMEGA**2!r} N"]
frequency = "20 Hz"
phase = ["30 deg", "-60 deg"]
"""
UNBALANCE = 'type = "unbalance"\nmass = "5 g"\neccentricity = "20 mm"\nangle = "30 deg"\n'
STEADY_LOAD = 'type = "constant"\nforce = ["40 N", "-300 N"]\n'
ROWS = 'type = "table"\ntime = ["0 s", "0.11 s", "2.9 s"]\nx = ["40 N", "40 N", "40 N"]\n'
ROWS += 'y = ["-300 N", "-300 N", "-300 N"]\n'
TABLE = 'angle = ["30 deg", "140 deg", "230 deg", "300 deg"]\nforce = ["0 N", "120 N", "300 N", "40 N"]\n'
TWICE = (
    'angle = ["30 deg", "140 deg", "230 deg", "300 deg", "390 deg", "500 deg", "590 deg", "660 deg"]\n'
    'force = ["0 N", "120 N", "300 N", "40 N", "0 N", "120 N", "300 N", "40 N"]\nturns = 2\n'
)


def _texts(pair: str, bases: tuple[str, ...], *changes: tuple[str, str], **more: Any) -> Iterator[Twin]:
    for base in bases:
        second = Machine(text=edited(BASES[base], *changes))
        yield Twin(pair=pair, base=base, first=Machine(text=BASES[base]), second=second, **more)


def _numbers(
    pair: str,
    changed: Callable[..., Mapping[str, float]],
    renamed: Callable[[str, str], str] = lambda text, base: text,
    **more: Any,
) -> Iterator[Twin]:
    for base, text in BASES.items():
        second = Machine(text=text, changed=changed)
        yield Twin(
            pair=pair, base=base, first=Machine(text=text), second=second, renamed=partial(renamed, base=base), **more
        )


def _a_turn_on(values: Mapping[str, float], _units: Mapping[str, str]) -> dict[str, float]:
    return {name: value + math.tau for name, value in values.items() if ".window." in name}


def _turned(values: Mapping[str, float], _units: Mapping[str, str]) -> dict[str, float]:
    """Numbers of the frame turned by half a turn; angles of a shaft are counted from where it is at t = 0."""
    linkage = "mechanism.driver.start_angle" in values
    angles = r".*(direction|start_angle|ball_angle|unbalance\.angle)"
    angles += r"|.*(window\..*|table\.angle\.\d+)" if linkage else ""
    vectors = r"(loads?|.*\.(force|gravity)|mechanism\.gravity|mechanism\.frame|.*initial)\b.*\.[xy](\.\d+)?"
    return {
        name: value + math.pi if re.fullmatch(angles, name) else -value
        for name, value in values.items()
        if re.fullmatch(f"{angles}|{vectors}", name)
    }


def _mirrored(values: Mapping[str, float], _units: Mapping[str, str]) -> dict[str, float]:
    """Numbers of the machine in a mirror: y and angles have the other sign, and a window is passed from its end."""
    found = {}
    for name, value in values.items():
        window = re.fullmatch(r"(.*\.window\.)(start|end)", name)
        row = re.fullmatch(r"(.*(?:table|push)\.)(angle|force|x|y)\.(\d)", name)
        if window:
            found[window[1] + ("end" if window[2] == "start" else "start")] = -value
        elif row:
            sign = -1.0 if row[2] in ("angle", "y") else 1.0
            found[f"{row[1]}{row[2]}.{5 - int(row[3])}"] = sign * value
        elif re.fullmatch(r".*(\.y|angle|direction|driver\.speed|shaft\.speed|driver\.torque\..*)", name):
            found[name] = -value
    return found


_SWAPPED = {"max": "min", "min": "max", "peak_time": "min_time", "min_time": "peak_time"}


def _extremes(channels: str, text: str) -> str:
    """The largest value of a channel that changes its sign is the least."""
    text = re.sub(rf"\b({'|'.join(_SWAPPED)})(:(?:{channels}))", lambda found: _SWAPPED[found[1]] + found[2], text)
    return re.sub(
        rf"(/(?:{channels})[^/]*/(?:searched/)?)(max|min)$", lambda found: found[1] + _SWAPPED[found[2]], text
    )


def _degrees(change: Callable[[int], int], text: str) -> str:
    return re.sub(r"@(\d+)deg", lambda found: f"@{change(int(found[1])) % 360}deg", text)


def _as_turned(text: str, base: str) -> str:
    text = _extremes("inner|load|reaction", text)
    return text if base == "shaft" else _degrees(lambda angle: angle + 180, text)


def _as_mirrored(text: str, base: str) -> str:
    """Balls are counted the other way round, from the first one on."""
    text = re.sub(r"\[([2-9])\]", lambda found: f"[{11 - int(found[1])}]", text)
    text = re.sub(r"(window\.)(start|end)", lambda found: found[1] + {"start": "end", "end": "start"}[found[2]], text)
    return _degrees(lambda angle: -angle, _extremes(r"[\w.]*\.v?y\b|drive_torque|driver\.speed", text))


#: Angles, and what is drawn or counted over them: another in another frame.
_PLACES = r"angle|cage\.in_|phase|damage|parameter_value|dimensionless"
_PLACES += r"|peak_moment|load_curve|parameters/|/state$|least|largest|words/\d+/"

#: What is in the order of the balls.
_BALLS = r"|/ball$|ball/|peak_ball|/ball\.\w+$|ball_loads|jacobian/|orbit/|contacts/order|words/\d+$"

#: Powers of four of the units of length, mass and time, so that roots are exact as well.
LENGTH, MASS, TIME = 4.0, 0.25, 16.0


def scaled(unit: str, length: float, mass: float, time: float) -> float:
    """By which a number of a unit grows."""
    sizes = {"meter": length, "gram": mass, "second": time}
    return math.prod(sizes.get(name, 1.0) ** float(power) for name, power in unit_size(unit, looked_up_size).base)


def _in_other_units(length: float, mass: float, time: float) -> dict[str, Any]:
    def changed(values: Mapping[str, float], units: Mapping[str, str]) -> dict[str, float]:
        return {name: value * scaled(units[name], length, mass, time) for name, value in values.items()}

    return {"changed": changed, "scale": lambda unit: scaled(unit, length, mass, time)}


#: Words with prefixes of units, lists of numbers of several units, and a condition number whose scaling has no limit.
_WORDS = "words|warn|said|unit|/points|/state$|/shape|(mass|damping)/value|reaction_condition"


def _two_bearings(text: str) -> str:
    head, tail = text.split("\n[bearing]\n")
    both = "".join(
        f"\n[bearings.{name}]\n" + tail.replace("[bearing.", f"[bearings.{name}.").replace("count = 2", "")
        for name in ("left", "right")
    )
    return head + both


def _of_left(text: str) -> str:
    """Names of the first of two bearings."""
    text = re.sub(r"(?<![\w.])(inner|outer|ball|load|cage|ring_force)\.", r"left.\1.", text)
    text = re.sub(r"\b(life|static_safety)\b", r"left.\1", text)
    text = re.sub(r"\bstatic_(?!safety)", "static_left_", text)
    return re.sub(r"\bbearing\.", "bearings.left.", text)


def _crank(bearing: str) -> str:
    force = '[mechanism.forces.push]\nbody = "crank"\npoint = "A"\nforce = ["40 N", "-300 N"]\n'
    window = force.replace("push", "blow").replace(
        "force = [", 'window = { start = "237 deg", end = "267 deg" }\nforce = ['
    )
    return edited(CRANK, ('gravity = ["0 m/s^2", "-9.81 m/s^2"]', 'gravity = "0 m/s^2"')) + force + window + bearing


#: Of a model with states more.
_STATES = "outputs|states|/state$|channels|coordinates|(mass|damping|stiffness)/value|modes|words|multipliers|start"

TWINS = [
    # a driver whose speed changes has outputs of its own
    *_texts("constant speed and a table of it", ("one-way", "two-way"), (DRIVER, EVEN), more=True, but="outputs"),
    *_texts("slip and a table of it", ("shaft", "one-way", "two-way"), ("slip = 0.2", SLIPS)),
    # a torque turns the rings, so that the lag of the cage is a state
    *_texts("slip and a table of it", ("motor",), ("slip = 0.2", SLIPS), more=True, but=_STATES),
    *_texts("table and the same twice over two turns", LINKAGES, (TABLE, TWICE)),
    *_texts("unbalance and harmonic load", ("shaft",), (UNBALANCE, HARMONIC)),
    *_numbers("windows a turn on", _a_turn_on),
    *_texts("load and equal rows over time", ("shaft", "one-way"), (STEADY_LOAD, ROWS)),
    *(
        Twin(
            pair="a bearing and two of half the load",
            base=base,
            first=Machine(text=BASES[base]),
            second=Machine(text=_two_bearings(BASES[base])),
            renamed=_of_left,
            more=True,
            questions=("quantities", "samples", "reductions", "passages"),
        )
        for base in BASES
    ),
    Twin(
        pair="one-way and two-way with a crank alone",
        base="crank",
        first=Machine(text=_crank(edited(BEARING, ("share = 0.5", "share = 1"), ('\ndamping = "900 N*s/m"', "")))),
        second=Machine(text=_crank(edited(two_way(BEARING), ("\ncount = 2", "")))),
        but="load|reaction|drive_|outputs|peak_moment|m_ei",  # the linkage feels the bearing
    ),
    *_numbers("frame turned", _turned, renamed=_as_turned, signs=False, but=_PLACES),
    *_numbers("frame mirrored", _mirrored, renamed=_as_mirrored, signs=False, but=_PLACES + _BALLS),
    # words have other prefixes of units, and ratings are no powers of lengths
    *_numbers("other units", **_in_other_units(LENGTH, MASS, TIME), but=f"{_WORDS}|life|safety|bearings/"),
    *_numbers("other units of mass and time", **_in_other_units(1.0, TIME**2, TIME), but=_WORDS),
]


# what is asked


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """A machine's model, its other numbers, and how names of the first machine are written for it."""

    model: Model
    numbers: Mapping[str, float]
    renamed: Callable[[str], str]
    scale: Callable[[str], float]

    @property
    def instant(self) -> float:
        """A time at which something is asked [s]."""
        return 0.013 * self.scale("s")

    def names(self, *names: str) -> list[str]:
        return [self.renamed(name) for name in names]

    def set_(self) -> list[str]:
        units = {info.name: info.unit for info in self.model.manifest.parameters}
        return [f"--set={name}={value!r} {units[name]}" for name, value in self.numbers.items()]

    def vary(self, share: float = 0.1) -> str:
        """A range of the clearance."""
        name = self.renamed("bearing.clearance")
        here = {**self.model.parameters, **self.numbers}[name]
        return f"{name}={here * (1.0 + share)!r} m:{here!r} m"


PLACES = {
    "value": ("value:inner.y@240deg",),
    "amplitude": tuple(f"amplitude:inner.y@{place}" for place in ("2x", "shaft", "cage", "bpfo", "bpfi", "bsf")),
    "drive_work": ("drive_work",),
    "static_deflection": ("static_deflection@250deg",),
    "static_peak_ball_force": ("static_peak_ball_force@250deg",),
    "peak_ball": ("peak_ball:ball.force",),
}
MORE = (
    "max:inner.x",
    "max:ball.force",
    "mean:ball.force[3]",
    "rms:load.y",
    "max:load.x",
    "max:drive_torque",
    "rms:reaction.A.y",
)


def quantity_names() -> list[str]:
    """Of every kind, and of channels of every sort."""
    own = ("bearing", "nothing", "bearing at rest")
    each = (PLACES.get(n, (n if kind.takes in own else f"{n}:inner.y",)) for n, kind in KINDS.items())
    return [*(name for names in each for name in names), *MORE]


def refusable(ask: Callable[[], Any]) -> Any:
    """The answer, or in whose words it is refused, with the warnings."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            found = ask()
        except RequestError as refused:
            found = {"refused": str(refused)}
    return {"answer": found, "warnings": sorted({str(one.message) for one in caught})}


def plain(report: Report) -> dict[str, Any]:
    """Plain data of a report, with its sentences, and heads and first column of its tables."""
    words: list[Any] = []
    for part in report.parts:
        words.append(
            [*(head for head in part.heads if head != "verdict"), *(str(row[0]) for row in part.rows)]
            if isinstance(part, ReportTable)
            else str(part)
        )
    return {"facts": dict(report.facts), "words": words, "warned": list(report.warnings), "fault": report.fault}


RTOL = 1e-9
LENGTH_OF_RUN = {"cycles": 2, "transient": 1, "rtol": RTOL}


def _quantities(a: Asked) -> Any:
    found = {}
    for name in quantity_names():
        one = a.renamed(name)

        def ask(one: str = one) -> Any:
            value = a.model.quantities(one, parameters=a.numbers, **LENGTH_OF_RUN)[one]
            return {"value": (value.value, value.unit), "time": (value.time, "s"), "ball": value.ball}

        found[one] = refusable(ask)
    return found


def _samples(a: Asked) -> Any:
    solution = a.model.simulate(parameters=a.numbers, samples_per_cycle=50, **LENGTH_OF_RUN)
    names = (*solution.states, *solution.outputs)
    return {"t": solution.t, **{name: solution[name] for name in names}, "period": (solution.period, "s")}


def _reductions(a: Asked) -> Any:
    found = a.model.reduce(parameters=a.numbers, **LENGTH_OF_RUN)
    return {n: {"max": one.maximum, "min": one.minimum, "mean": one.mean, "rms": one.rms} for n, one in found.items()}


def _settled(a: Asked) -> Any:
    found = a.model.settle(parameters=a.numbers)
    return {"turns": found.turns, "settled": found.settled, "dropped": found.dropped, "channels": sorted(found.changes)}


def _passages(a: Asked) -> Any:
    return a.model.passages(2, transient=0, parameters=a.numbers)


def _explained(a: Asked) -> Any:
    return plain(a.model.explain(a.numbers).report())


def _members(a: Asked) -> Any:
    name = a.renamed("bearing.clearance")
    here = {**a.model.parameters, **a.numbers}[name]
    table = [{**a.numbers, name: here * share} for share in (1.0, 1.2)]
    names = a.names("max:ball.force", "rms:inner.y", "range:inner.x")
    many = a.model.simulate_many(table, names, **LENGTH_OF_RUN)
    return {name: many[name] for name in names}


def _figures(a: Asked) -> Any:
    solution = a.model.simulate(3, transient=1, rtol=RTOL, parameters=a.numbers, samples_per_cycle=60)
    record, found = gather(a.model, solution), {}
    for kind in FIGURES:
        if not kind.possible(record):
            found[kind.name] = "not possible"
            continue
        figure = kind.draw(record)
        found[kind.name] = [
            {
                "words": [axes.get_title(), axes.get_xlabel(), axes.get_ylabel()],
                "legend": sorted(text.get_text() for text in getattr(axes.get_legend(), "texts", [])),
                "lines": [np.asarray(line.get_ydata(), dtype=float) for line in axes.get_lines()],
            }
            for axes in figure.axes
        ]
    return found


def _command(a: Asked, *words: str) -> Any:
    done = CliRunner().invoke(app, [words[0], str(a.model.folder), *words[1:], *a.set_(), "--json"])
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    said = sorted(line for line in done.stderr.splitlines() if re.match("note|warning|error", line))
    return {"code": done.exit_code, "facts": json.loads(done.stdout or "null"), "said": said}


def _run(a: Asked) -> Any:
    return _command(a, "run", "--no-figures", "--rtol=1e-9")


OTHERS: Mapping[str, Callable[[Asked], Any]] = {
    "quantities": _quantities,
    "samples": _samples,
    "reductions": _reductions,
    "settle": _settled,
    "passages": _passages,
    "explain": _explained,
    "members": _members,
    "figures": _figures,
    "run": _run,
}


def _fitted(a: Asked) -> Any:
    names = a.names("max:ball.force", "rms:inner.y", "mean:inner.x")
    name = a.renamed("bearing.clearance")
    here = {**a.model.parameters, **a.numbers}[name]
    found = a.model.quantities(names, parameters={**a.numbers, name: 1.05 * here}, **LENGTH_OF_RUN)
    data = {one: (value.value, 1e-3 * abs(value.value)) for one, value in found.items()}
    return a.model.fit([data], a.vary(), starts=1, parameters=a.numbers, cycles=2, transient=1)


QUESTIONS: Mapping[str, Callable[[Asked], Any]] = {
    "bifurcation": lambda a: a.model.bifurcation(
        a.vary() + ":2", a.renamed("inner.y"), readings=20, settling=5, exponent=False, parameters=a.numbers
    ),
    "fit": _fitted,
    "jacobian": lambda a: a.model.checked_jacobian(
        a.names("ball.force", "inner.vy"), a.names("inner.y", "bearing.clearance"), t=a.instant, parameters=a.numbers
    ),
    "life": lambda a: a.model.life(4, transient=2, rtol=RTOL, parameters=a.numbers),
    "linearize": lambda a: a.model.linearize(t=a.instant, parameters=a.numbers),
    "morris": lambda a: a.model.morris(
        [a.vary()], a.names("max:ball.force", "rms:inner.y"), 2, base=4, transient=1, parameters=a.numbers
    ),
    "optimize": lambda a: a.model.optimize(
        a.renamed("rms:inner.y"), a.vary(), 2, starts=1, transient=1, parameters=a.numbers
    ),
    "section": lambda a: a.model.section(
        a.renamed("inner.y"), readings=40, settling=6, rtol=RTOL, parameters=a.numbers
    ),
    "sensitivity": lambda a: a.model.sensitivity(
        a.names("max:ball.force", "rms:inner.y", "mean:ball.force", "peak_time:ball.force"),
        a.names("bearing.clearance", "bearing.ball_angle"),
        2,
        transient=1,
        parameters=a.numbers,
    ),
    "sobol": lambda a: a.model.sobol(
        [a.vary()], a.names("max:ball.force", "rms:inner.y"), 2, samples=16, transient=1, parameters=a.numbers
    ),
    "spectrum": lambda a: a.model.spectrum(
        a.renamed("inner.y"), cycles=24, transient=2, rtol=RTOL, parameters=a.numbers
    ),
    "steady": lambda a: a.model.steady(parameters=a.numbers),
}


def ask(asked: Asked, question: str) -> Any:
    """What a machine answers."""
    if question in OTHERS:
        return refusable(lambda: OTHERS[question](asked))
    return refusable(lambda: plain(QUESTIONS[question](asked).report()))


def asked(twin: Twin, machine: Machine, model: Model) -> Asked:
    units = {info.name: info.unit for info in model.manifest.parameters}
    numbers = dict(machine.changed(model.parameters, units))
    if machine is twin.second:
        return Asked(model=model, numbers=numbers, renamed=twin.renamed, scale=twin.scale)
    return Asked(model=model, numbers=numbers, renamed=lambda text: text, scale=lambda unit: 1.0)


# comparison

#: Facts that are no numbers of the machine: what it took, and by how much estimates may be off.
EFFORT = re.compile(
    "steps|seconds|wall_time|signature|evaluations|iterations|members|folder|files|certificate|uncertainty|"
    "disagreement|change|_low|_high|/left|/difference|/margin|/route"
)
_DIGITS = re.compile(r"[-+]?\d+(\.\d+)?([eE][-+]?\d+)?")

#: Greatest difference of two numbers, relative to the larger, or to the largest of an array or of a signal's extremes.
TOLERANCE = 2e-6
_OF_A_SIGNAL = ("max", "min", "mean", "rms", "size")


def flat(found: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Every number, array and text of an answer, by where it stands."""
    if isinstance(found, Mapping):
        for key, value in found.items():
            yield from flat(value, f"{path}/{key}")
    elif isinstance(found, (np.ndarray, list, tuple)):
        try:
            yield path, np.asarray(found, dtype=float)
        except (TypeError, ValueError):
            yield f"{path}#", len(found)
            for k, value in enumerate(found):
                yield from flat(value, f"{path}/{k}")
    else:
        yield path, found


def differences(twin: Twin, first: Any, second: Any) -> list[str]:
    """Where two answers differ."""
    one = {twin.renamed(path): value for path, value in flat(first)}
    two = dict(flat(second))
    paths = [path for path in {**one, **two} if not EFFORT.search(path) and not re.search(twin.but, path)]
    lone = [path for path in paths if path not in two or (path not in one and not twin.more)]
    found = [f"{path}: only one machine has it" for path in lone]
    for path in (path for path in paths if path in one and path in two):
        a, b = one[path], two[path]
        if isinstance(a, str) or isinstance(b, str):
            a, b = (_DIGITS.sub("#", str(text)) for text in (twin.renamed(str(a)), b))
            if twin.more:  # other names are near to one that is not there
                a, b = (text.partition(" There is no output")[0] for text in (a, b))
            same = a == b
        elif a is None or b is None or isinstance(a, bool):
            same = a == b
        else:
            a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
            unit = two.get(re.sub("(value/0|value|[^/]*)$", lambda at: {"value/0": "value/1"}.get(at[0], "unit"), path))
            same = a.shape == b.shape and _alike(twin, a * _factor(twin, a, b, unit), b, _room(path, two))
        if not same:
            apart = (
                "" if isinstance(a, (str, type(None))) or np.shape(a) != np.shape(b) else f"{_apart(a, b):.1e} apart, "
            )
            found.append(f"{path}: {apart}{a} and {b}")
    return found


def _apart(a: Any, b: Any) -> float:
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    return float(np.nanmax(np.abs(a - b), initial=0.0) / max(np.nanmax(np.abs(b), initial=0.0), 1e-300))


def _room(path: str, answer: Mapping[str, Any]) -> float:
    """What a number may differ by beside its own digits: its stated uncertainty, or digits of its signal's extremes or
    of the other component of its vector."""
    parent, _, name = path.rpartition("/")
    beside = [f"{parent}/{other}" for other in _OF_A_SIGNAL if name in _OF_A_SIGNAL]
    beside += [re.sub(r"\.[xy]\b", other, one) for one in (path, *beside) for other in (".x", ".y")]
    numbers = [
        np.max(np.abs(answer[one]), initial=0.0) for one in beside if isinstance(answer.get(one), (float, np.ndarray))
    ]
    coarse = [share * np.max(answer[path]) for part, share in COARSE.items() if name == part]
    return float(max([TOLERANCE * max(numbers, default=0.0), *coarse, answer.get(f"{parent}/uncertainty") or 0.0]))


def _factor(twin: Twin, a: np.ndarray, b: np.ndarray, unit: Any) -> float:
    """By which a number is larger in the second machine: as its unit says, and for any of several a power of two."""
    if twin.scale is unscaled:
        return 1.0
    if isinstance(unit, str):
        return twin.scale(unit)
    sizes = [float(np.max(np.abs(one), initial=0.0, where=np.isfinite(one))) for one in (a, b)]
    return 2.0 ** round(math.log2(sizes[1] / sizes[0])) if all(sizes) else 1.0


#: Damage by the place on a raceway is counted from step to step.
COARSE = {"damage": 1e-3}


def _alike(twin: Twin, a: np.ndarray, b: np.ndarray, room: float) -> bool:
    if not twin.signs:
        a, b = np.abs(a), np.abs(b)
    size = np.max(np.abs(b), initial=0.0, where=np.isfinite(b))
    return bool(np.allclose(a, b, rtol=TOLERANCE, atol=max(TOLERANCE * size, room, 1e-100), equal_nan=True))
