"""Spalls of raceways and balls: where a ball meets one it is pressed less by as much as it sinks in.

A spall has a chord L and a middle at an angle of its raceway or ball; half of it is the angle w, sin w = L/2 over the
radius.  How deep a ball sinks is its profile:

rectangular  the depth between the edges; the deflection jumps at both
half-sine    depth cos(pi s/L), s along the chord from the middle
path         the ball turns about one edge, then about the other; their circles meet at the sagitta of the ball less
             (outer raceway) or plus (inner raceway) that of the raceway; where a depth is given, not below it

Each edge is a window of the angle that grows by a turn with every ball.  Where the rings turn evenly all entries and
exits are known before a run; else steps end where the angle, a function of the state, passes the edge.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import sympy as sp

from ballpass.derive.bearing.contact_direction import contact_cosine
from ballpass.derive.bearing.effects.effect import Effect, GenericBall, Passing
from ballpass.derive.drive import OverAngle
from ballpass.derive.drive.angle_state import window_gate
from ballpass.derive.scene.bearing_records import MOST_BALLS, BallEffect, Bearing
from ballpass.derive.scene.checker import Checker
from ballpass.derive.scene.keys import ChoiceKey, WholeKey
from ballpass.derive.scene.quantity import SceneNumber, UsualRange
from ballpass.derive.scene.read_keys import keys_of, not_negative, positive, quantity, read_record
from ballpass.derive.scene.table import Table
from ballpass.derive.terms import Definition, Names, symbol_of
from ballpass.derive.variables import Input, gate_of
from ballpass.runtime.contract.manifest import TurningInfo

PROFILES = ("rectangular", "half-sine", "path")
PLACES = ("outer", "inner", "ball")
BALL = WholeKey(words="Number of the ball", lowest=1, highest=MOST_BALLS, example=1, when="required on a ball")


@dataclass(frozen=True, slots=True, kw_only=True)
class Spall:
    """A spall of a raceway or of a ball."""

    name: str
    on: str = ChoiceKey(words="What it is on", choices=PLACES, note="a raceway or a ball").declared()
    ball: int = BALL.declared()
    profile: str = ChoiceKey(words="How deep a ball sinks over it", choices=PROFILES).declared()
    angle: SceneNumber = quantity(
        "rad", "Angle of the middle of NAME", r"\alpha_d", "270 deg", note="in axes of that raceway or ball"
    )
    chord: SceneNumber = positive(
        "m",
        "Chord of NAME",
        "L_d",
        "1 mm",
        usual=UsualRange(
            most=0.5, of="ball_diameter", hint="Spalls are shorter than the balls are thick: check the unit."
        ),
        note="from edge to edge, shorter than the room between balls",
    )
    depth: SceneNumber | None = not_negative(
        "m",
        "Depth of NAME",
        "h_d",
        "20 um",
        optional=True,
        when='required, except for `"path"`',
        usual=UsualRange(
            most=0.1, of="ball_diameter", hint="Spalls are some hundredths of a millimetre deep: check the unit."
        ),
    )

    @property
    def shape(self) -> str:
        """Its profile; "deep path" where a ball meets no bottom."""
        return "deep path" if self.profile == "path" and self.depth is None else self.profile


class Defects(Effect):
    """Local defects."""

    name = "defects"
    words = "local defects of raceways and balls"
    tables = MappingProxyType({("*",): keys_of(Spall, {"NAME": "<name>"})})

    def read(self, table: Table, balls: int) -> BallEffect:
        with table:
            spalls = []
            for name in table.names("defect"):
                with table.table(name, "on, angle, chord, depth and profile") as data:
                    spalls.append(_read_spall(data, name, balls))
        return BallEffect(kind=self.name, parts=tuple(spalls))

    def check(self, effect: BallEffect, checker: Checker, bearing: Bearing) -> None:
        ball = bearing.ball_diameter
        for spall in effect.parts:
            widest = ball.value / _room(spall, bearing)
            if spall.chord.value >= widest > 0.0:
                checker.fault(
                    spall.chord.path,
                    "the chord is as long as the balls are apart",
                    checker.show(spall.chord),
                    f"a chord below {widest:.9g} m",
                    "check its unit: spalls are some millimetres long; give several defects for a longer one",
                )

    def relations(self, effect: BallEffect, bearing: Bearing) -> list[tuple[str, float, str]]:
        ball = bearing.ball_diameter.path
        return [(ball, _room(spall, bearing), spall.chord.path) for spall in effect.parts]

    def spins(self, effect: BallEffect) -> bool:
        return any(spall.on == "ball" for spall in effect.parts)

    def edges(self, effect: BallEffect, bearing: Bearing, names: Names, passes: Passing) -> OverAngle:
        several = [one for spall in effect.parts for one in _contacts(spall, bearing, names)]
        if passes.turnings is not None:
            gates = (gate for one in several for gate in one.gates(passes.turnings))
            return OverAngle(value=sp.S.Zero, inputs=tuple(gates))
        found = [gate for one in several for gate in one.switched(passes)]
        return OverAngle(
            value=sp.S.Zero,
            inputs=tuple(i for gate in found for i in gate.inputs),
            definitions=tuple(d for gate in found for d in gate.definitions),
            switches=tuple(switch for gate in found for switch in gate.switches),
        )

    def constants(self, effect: BallEffect, bearing: Bearing, names: Names) -> tuple[Definition, ...]:
        contacts = (one for spall in effect.parts for one in _contacts(spall, bearing, names))
        return tuple(d for one in contacts for d in one.constants())

    def term(self, effect: BallEffect, bearing: Bearing, names: Names, ball: GenericBall) -> sp.Expr:
        taken = sp.S.Zero
        for spall in effect.parts:
            for one in _contacts(spall, bearing, names):
                if spall.on == "ball":
                    assert ball.spin is not None  # `spins`
                    turned = ball.spin - one.middle
                    taken += ball.only(spall.ball, one.depth(sp.cos(turned), sp.sin(turned), sp.true))
                else:
                    turned = (ball.on_outer if spall.on == "outer" else ball.on_inner) - one.middle
                    near = sp.cos(turned) > sp.cos(sp.pi / bearing.balls)
                    taken += one.depth(sp.cos(turned), sp.sin(turned), near)
        return taken

    def describe(self, effect: BallEffect) -> str:
        parts = []
        for spall in effect.parts:
            where = f"ball {spall.ball}" if spall.on == "ball" else f"the {spall.on} raceway"
            parts.append(f"{spall.name} on {where}, {spall.shape}")
        return "local defects: " + "; ".join(parts)


def _read_spall(data: Table, name: str, balls: int) -> Spall:
    number = 0
    if data.data.get("on") == "ball":
        number = replace(BALL, highest=balls).read(data, "ball")
    found = read_record(Spall, data, {"NAME": name}, name=name, ball=number)
    if found.depth is None and found.profile != "path":
        data.take("depth", keys_of(Spall)["depth"].sample)
    return found


def _room(spall: Spall, bearing: Bearing) -> float:
    """Times the chord that a ball's diameter must exceed, so that two balls never are in one spall."""
    return 1.0 / (1.0 - math.sin(math.pi / bearing.balls)) if spall.on == "inner" else 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _SpallContact:
    """A spall as one kind of contact meets it: once with every ball, or, on a ball, with one of the two raceways.

    Attributes
    ----------
    ring : the raceway of the contact
    middle : angle at which it is met [rad]
    """

    spall: Spall
    bearing: Bearing
    names: Names
    ring: str
    middle: sp.Expr

    @property
    def _label(self) -> str:
        return f"{self.spall.name}.{self.ring}" if self.spall.on == "ball" else self.spall.name

    def _symbol(self, name: str) -> sp.Symbol:
        return self.names.constant(f"defects.{self._label}.{name}")

    @property
    def _edges(self) -> tuple[tuple[str, str, str], ...]:
        """Name of each gate, and of the edges of its window."""
        if self.spall.shape == "path":
            return (
                ("", "begin", "bottom_begin"),
                ("_bottom", "bottom_begin", "bottom_end"),
                ("_out", "bottom_end", "end"),
            )
        if self.spall.shape == "deep path":
            return (("", "begin", "middle"), ("_out", "middle", "end"))
        return (("", "begin", "end"),)

    def gates(self, turnings: Mapping[str, TurningInfo]) -> tuple[Input, ...]:
        """One while a ball is within a part of the spall."""
        on_ball, latex = self.spall.on == "ball", self.names.latex("g_d")
        turning, parts = (turnings["spin"], 1) if on_ball else (turnings[self.ring], self.bearing.balls)
        return tuple(
            gate_of(f"gate.{name}", words, latex, turning, (window,), parts) for name, words, window in self._windows
        )

    def switched(self, passes: Passing) -> Iterator[OverAngle]:
        """The same where the angle is a function of the state."""
        if self.spall.on == "ball":
            assert passes.spin is not None  # `spins`
            angle, rate = passes.spin
        else:
            balls, seen = self.bearing.balls, passes.outer if self.ring == "outer" else passes.inner
            angle, rate = balls * seen[0], balls * seen[1]
        for name, words, window in self._windows:
            yield window_gate(name, words, self.names.latex("g_d"), angle=(angle, rate), windows=[window])

    @property
    def _windows(self) -> Iterator[tuple[str, str, tuple[str, str]]]:
        """Name and words of each gate, and the edges of its window."""
        of = f" of {self.bearing.name}" if self.bearing.name else ""
        for part, begin, end in self._edges:
            words = f"Whether a ball{of} is in {self._label}{part.replace('_', ', ')}"
            window = self._symbol(begin).name, self._symbol(end).name
            yield f"{self.names.prefix}defects.{self._label}{part}", words, window

    def _gate(self, part: str) -> sp.Symbol:
        return sp.Symbol(f"gate.{self.names.prefix}defects.{self._label}{part}", real=True)

    @property
    def _radii(self) -> tuple[sp.Expr, sp.Expr]:
        """Of the ball, and of the circle of contacts on the raceway."""
        ball, pitch = symbol_of(self.bearing.ball_diameter), symbol_of(self.bearing.pitch_diameter)
        inwards = contact_cosine(self.bearing) * ball
        return ball / 2, (pitch + inwards) / 2 if self.ring == "outer" else (pitch - inwards) / 2

    def constants(self) -> Iterator[Definition]:
        """Half angle, and the edges of the windows: of a raceway's spall times the number of balls."""
        spall, define, balls = self.spall, self.names.define, sp.Integer(self.bearing.balls)
        ball, raceway = self._radii
        own = ball if spall.on == "ball" else raceway
        half, chord, words = self._symbol("half_angle"), symbol_of(spall.chord), self._label
        angle = sp.atan2(chord / 2, sp.sqrt(own**2 - chord**2 / 4))
        yield define(half, angle, "rad", f"Half the angle of {words}", "w_d")
        each, what = (sp.S.One, "Angle") if spall.on == "ball" else (balls, "Angle, times the number of balls,")
        edges = {"begin": -half, "end": half}
        if spall.shape == "deep path":
            edges["middle"] = sp.S.Zero
        if spall.depth is not None and spall.shape == "path":
            # where the circle about the edge is down at the depth; chords are shorter than a ball's diameter
            deep = sp.Min(symbol_of(spall.depth), ball)
            centre = (raceway - ball + deep) if self.ring == "outer" else (raceway + ball - deep)
            gap = deep * (2 * ball - deep)
            if spall.on == "ball":
                gap = deep * (2 * raceway + deep if self.ring == "outer" else 2 * raceway - deep)
            sine = sp.Min(sp.sqrt(gap / (4 * centre * own)), sp.sin(angle / 2))
            down = self._symbol("bottom_angle")
            yield define(
                down,
                2 * sp.atan2(sine, sp.sqrt(1 - sine**2)),
                "rad",
                f"Angle from edge to bottom of {words}",
                r"\beta_d",
            )
            edges |= {"bottom_begin": down - half, "bottom_end": half - down}
        for name, past in edges.items():
            place = name.replace("_", " ")
            latex = rf"\eta_{{\mathrm{{{place}}}}}"
            yield define(
                self._symbol(name), each * (self.middle + past), "rad", f"{what} of the {place} of {words}", latex
            )

    def depth(self, c: sp.Expr, s: sp.Expr, near: sp.logic.boolalg.Boolean) -> sp.Expr:
        """How deep a ball sinks, over cosine and sine of the angle past the middle."""
        half, one_half = self._symbol("half_angle"), sp.Rational(1, 2)
        across, along = sp.sin(half), sp.cos(half)
        depth = sp.S.Zero if self.spall.depth is None else symbol_of(self.spall.depth)
        if self.spall.shape == "rectangular":
            sunk: tuple[sp.Expr, ...] = (depth,)
        elif self.spall.shape == "half-sine":
            sunk = (depth * sp.cos(sp.pi * one_half * s / across),)
        else:
            into = self._about_edge(along * c - across * s, across * c + along * s)
            out = self._about_edge(along * c + across * s, across * c - along * s)
            sunk = (into, out) if self.spall.depth is None else (into, depth, out)
        return sp.Add(
            *(
                sp.Piecewise((value, sp.And(near, self._gate(part) > one_half)), (sp.S.Zero, True))
                for value, (part, _, _) in zip(sunk, self._edges, strict=True)
            )
        )

    def _about_edge(self, cosine: sp.Expr, sine: sp.Expr) -> sp.Expr:
        """How deep a ball sinks that touches the edge, over cosine and sine of the angle past it."""
        ball, raceway = self._radii
        own, other = (ball, raceway) if self.spall.on == "ball" else (raceway, ball)
        aside = sp.sqrt(other**2 - (own * sine) ** 2)
        if self.ring == "inner":
            return raceway + ball - own * cosine - aside
        return ball - raceway + (aside - own * cosine if self.spall.on == "ball" else own * cosine - aside)


def _contacts(spall: Spall, bearing: Bearing, names: Names) -> Iterator[_SpallContact]:
    angle = symbol_of(spall.angle)
    rings = [("outer", sp.S.Zero), ("inner", sp.pi)] if spall.on == "ball" else [(spall.on, sp.S.Zero)]
    for ring, opposite in rings:
        yield _SpallContact(spall=spall, bearing=bearing, names=names, ring=ring, middle=angle + opposite)
