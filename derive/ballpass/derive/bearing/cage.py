"""Angle of the balls: pure rolling between two rings that turn, or a cage that slips as the scene says.

In: a bearing and how its rings turn.  Out: a `Cage`: angle and rate of ball 1, and what they are made of.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import sympy as sp

from ballpass.derive.bearing.cage_slip import kept_share, lag_of, lag_state
from ballpass.derive.bearing.contact_direction import ball_turns, contact_cosine
from ballpass.derive.bearing.effects import EFFECTS
from ballpass.derive.bearing.effects.effect import Passing
from ballpass.derive.drive import Drive, OverAngle
from ballpass.derive.mechanism.kinematics import Ledger, Pose
from ballpass.derive.mechanism.swing import STILL, Swing
from ballpass.derive.scene.bearing_records import Bearing
from ballpass.derive.scene.records import Driver
from ballpass.derive.terms import TIME, Definition, Names, names_of, symbol_of
from ballpass.derive.variables import Coordinate, Input, StateSwitch, phase


@dataclass(frozen=True, slots=True, kw_only=True)
class Cage:
    """How the balls turn.

    Attributes
    ----------
    angle, rate : of ball 1 [rad], [rad/s]
    in_outer, in_inner : angle of ball 1 as the outer and the inner ring see it, which stood along x at the start [rad]
    inputs : the parts of these angles that grow evenly, at the reference time, none where the driver's angle is a
        coordinate; and what effects need
    constants, definitions : of the symbols in these
    spin : angle of a ball's own material that meets the outer raceway, None where no effect asks for it [rad]
    share : of the inner ring's speed in that of the cage, slip included; the rest is that of the outer ring's; a
        function of time where the slip changes
    ring_rate : of the inner ring relative to the outer one [rad/s]; None where effects do not need it: without any, and
        where rings that are loaded one-way turn evenly
    switches : places of the motion at which a ball enters or leaves a spall, where these times are not known before
    lag : coordinate whose velocity is the angle by which the cage lags, and the rate of that [rad/s]; None where the
        slip does not change, and where rings that are loaded one-way turn evenly
    """

    angle: sp.Expr
    rate: sp.Symbol
    in_outer: sp.Expr
    in_inner: sp.Expr
    inputs: tuple[Input, ...]
    constants: tuple[Definition, ...]
    share: sp.Expr
    definitions: tuple[Definition, ...] = ()
    spin: sp.Expr | None = None
    ring_rate: sp.Symbol | None = None
    switches: tuple[StateSwitch, ...] = ()
    lag: tuple[Coordinate, sp.Expr] | None = None


def cage_ratio(names: Names) -> sp.Symbol:
    """Share of the inner ring's speed in that of the cage; the rest is that of the outer ring's."""
    return names.constant("cage_ratio")


def cage_on_shaft(bearing: Bearing, shaft_speed: sp.Expr, *, outer: bool = False) -> Cage:
    """A ring at constant speed [rad/s], the inner one or the `outer`; the other stands, Eq. (7).  A cage may lag."""
    names = names_of(bearing)
    turning, share = ("outer", 1 - cage_ratio(names)) if outer else ("inner", cage_ratio(names))
    speed, even = names.constant("cage_speed"), _phase(bearing, names)
    pass_speed, passing = names.constant(f"{turning}_pass_speed"), _phase(bearing, names, turning)
    rolling = share * shaft_speed
    constants: tuple[Definition, ...] = (
        _ratio(bearing, names),
        names.define(speed, kept_share(bearing) * rolling, "rad/s", "Speed of the cage", r"\omega_c"),
        _pass(names, turning, speed - shaft_speed),
        *((_pass(names, "inner", speed),) if outer else ()),
    )
    lag = lag_of(bearing, names, rolling)
    behind, ledger, rate = sp.S.Zero, Ledger(), speed
    if lag is not None:
        behind, constants = lag.angle, (*constants, *lag.constants)
        words = names.words("speed of the balls about the bearing's axis")
        rate = ledger.define(f"{bearing.prefix}cage.rate", speed - lag.rate, "rad/s", words, names.latex(r"\dot\psi"))
    angle = even.symbol + speed * TIME - behind
    over_turning = passing.symbol + pass_speed * TIME - behind
    still, moving = (angle, speed), (over_turning, pass_speed)
    passes = Passing(outer=moving, inner=still, even=True) if outer else Passing(outer=still, inner=moving, even=True)
    spin = _spin(bearing, names, passes.outer[1], -ball_turns(bearing) * behind) if _spins(bearing) else None
    met = _met(bearing, names, passes)
    return Cage(
        angle=angle,
        rate=rate,
        in_outer=passes.outer[0],
        in_inner=passes.inner[0],
        inputs=(
            even,
            passing,
            *(() if spin is None else spin.inputs),
            *(() if lag is None else lag.inputs),
            *met.inputs,
        ),
        constants=(*constants, *(() if spin is None else spin.constants), *met.constants),
        definitions=ledger.definitions,
        spin=None if spin is None else spin.angle,
        share=cage_ratio(names),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Spin:
    angle: sp.Expr
    rate: sp.Expr
    inputs: tuple[Input, ...]
    constants: tuple[Definition, ...]


def _spins(bearing: Bearing) -> bool:
    return any(EFFECTS[e.kind].spins(e) for e in bearing.effects)


def _spin(bearing: Bearing, names: Names, over_outer: sp.Expr, swung: sp.Expr) -> _Spin:
    """Balls that roll on the outer raceway: as much of their surface passes as of the raceway.

    Parameters
    ----------
    over_outer : mean speed of the cage over the outer ring [rad/s]
    swung : angle that a ball turns beyond the mean [rad]
    """
    start, speed = names.constant("spin_start"), names.constant("spin_speed")
    words = "Angle of a ball's material that meets the outer raceway"
    turned = phase(
        f"{bearing.prefix}spin",
        f"{words}{f' of {bearing.name}' if bearing.name else ''}, at the reference time",
        names.latex(r"\chi_0"),
        offset=start.name,
        rate=speed.name,
    )
    return _Spin(
        angle=turned.symbol + speed * TIME + swung,
        rate=speed,
        inputs=(turned,),
        constants=(
            names.define(start, sp.S.Zero, "rad", f"{words} at the start, from which it is counted", r"\chi_{00}"),
            names.define(
                speed,
                ball_turns(bearing) * over_outer,
                "rad/s",
                "Speed of the balls about their own axes, seen from the cage",
                r"\omega_w",
            ),
        ),
    )


def _met(bearing: Bearing, names: Names, passes: Passing) -> OverAngle:
    """What effects bring besides their terms: constants, and where balls enter and leave spalls."""
    found = [EFFECTS[e.kind].edges(e, bearing, names, passes) for e in bearing.effects]
    return OverAngle(
        value=sp.S.Zero,
        constants=tuple(d for e in bearing.effects for d in EFFECTS[e.kind].constants(e, bearing, names, passes)),
        inputs=tuple(i for one in found for i in one.inputs),
        definitions=tuple(d for one in found for d in one.definitions),
        switches=tuple(switch for one in found for switch in one.switches),
    )


def cage_between(
    bearing: Bearing, bodies: tuple[Pose, Pose], swings: tuple[Swing, Swing], driver: Driver, drive: Drive
) -> Cage:
    """Rings that turn with two bodies: ``theta_0`` plus both angles since the start, each with its weight.

    Parameters
    ----------
    bodies, swings : of the bodies that carry inner and outer ring
    driver, drive : the driver of the scene, and how it moves; where a torque drives, constant speeds are initial ones
    """
    names = names_of(bearing)
    ledger = Ledger()
    driver_speed, start = symbol_of(driver.speed), symbol_of(driver.start_angle)
    speed, share = names.constant("cage_speed"), cage_ratio(names)
    constants: tuple[Definition, ...] = (_ratio(bearing, names),)
    about_inner = swings[0] is STILL
    if bearing.cage is not None and bearing.cage.slipping:
        slipping = _slipping(bearing, names, about_inner=about_inner)
        constants, share = (*constants, slipping), slipping.symbol
    # of the last row, as are all angles less the lag
    weights = (share, 1 - share)
    swung = sum((w * (s.swing - s.at_start) for w, s in zip(weights, swings, strict=True)), start=sp.S.Zero)
    turns = sum((w * s.turns for w, s in zip(weights, swings, strict=True)), start=sp.S.Zero)
    lag, share_now, behind = lag_state(bearing, names), share, sp.S.Zero
    rolling = cage_ratio(names) - (1 if about_inner else 0)
    if lag is not None:
        share_now = ledger.define(
            f"{bearing.prefix}cage.share",
            share - rolling * lag.excess.symbol,
            "1",
            "share of the inner ring's speed in that of the cage",
            names.latex(r"\kappa_c(t)"),
        )
        behind, constants = lag.coordinate.velocity, (*constants, *lag.constants)
        words = "Turns of the balls over the ring that slip is seen from, in one of the driver, if they rolled"
        rolled = rolling * (swings[0].turns - swings[1].turns)
        constants += (names.define(names.constant("rolling_turns"), rolled, "1", words, "N_c"),)
    rate = ledger.define(
        f"{bearing.prefix}cage.rate",
        sum((w * body.rate for w, body in zip((share_now, 1 - share_now), bodies, strict=True)), start=sp.S.Zero),
        "rad/s",
        names.words("speed of the balls about the bearing's axis"),
        names.latex(r"\dot\psi"),
    )
    words = "Mean speed of the balls about the bearing's axis"
    constants += (
        names.define(
            names.constant("ring_speed"),
            (swings[0].turns - swings[1].turns) * driver_speed,
            "rad/s",
            "Mean speed of the inner ring relative to the outer one",
            r"\omega_{io}",
        ),
        names.define(speed, turns * driver_speed, "rad/s", words, r"\omega_c"),
    )
    inner, outer = swings
    apart = inner.swing - inner.at_start - outer.swing + outer.at_start
    around = inner.turns - outer.turns
    free = drive.coordinate is not None
    inputs: list[Input] = []

    def ball(part: str, turns: sp.Expr, swung: sp.Expr) -> sp.Expr:
        """Angle of ball 1, of which so many turns go with the driver's."""
        if free:
            return symbol_of(bearing.ball_angle) + turns * (drive.angle - start) + swung - behind
        inputs.append(_phase(bearing, names, part))
        speed = names.constant(f"{part}_pass_speed" if part else "cage_speed")
        return inputs[-1].symbol + speed * TIME + swung - behind

    angle, in_outer, over_outer = ball("", turns, swung), None, speed
    if outer is not STILL:
        constants += (_pass(names, "outer", share * names.constant("ring_speed")),)
        in_outer, over_outer = ball("outer", share * around, share * apart), names.constant("outer_pass_speed")
    constants += (_pass(names, "inner", (share - 1) * names.constant("ring_speed")),)
    in_inner = ball("inner", (share - 1) * around, (share - 1) * apart)
    ring_rate: sp.Symbol | None = None
    if bearing.effects or lag is not None:
        ring_rate = ledger.define(
            f"{bearing.prefix}cage.ring_rate",
            bodies[0].rate - bodies[1].rate,
            "rad/s",
            "speed of the inner ring relative to the outer one",
            names.latex(r"\omega_{io}"),
        )
    cage = Cage(
        angle=angle,
        rate=rate,
        in_outer=angle if in_outer is None else in_outer,
        in_inner=in_inner,
        inputs=(*inputs, *(() if lag is None else (lag.excess,))),
        constants=constants,
        definitions=ledger.definitions,
        share=share_now,
        lag=None if lag is None or ring_rate is None else (lag.coordinate, rolling * lag.excess.symbol * ring_rate),
    )
    if not bearing.effects:
        return cage
    assert ring_rate is not None  # of effects
    rolls, spin = ball_turns(bearing), None
    if _spins(bearing):
        spin = _spin(bearing, names, over_outer, rolls * (share * apart - behind))
        constants += spin.constants
        if free:
            turned = share * (around * (drive.angle - start) + apart) - behind
            spin = replace(spin, angle=rolls * turned, inputs=())
    even = not free and lag is None and all(one.swing == 0 for one in swings)
    known = (over_outer, names.constant("inner_pass_speed"))
    if not even:
        known = (share_now * ring_rate, (share_now - 1) * ring_rate)
    passes = Passing(
        outer=(cage.in_outer, known[0]),
        inner=(in_inner, known[1]),
        spin=None if spin is None else (spin.angle, spin.rate if even else rolls * known[0]),
        even=even,
    )
    met = _met(bearing, names, passes)
    return replace(
        cage,
        inputs=(*cage.inputs, *(() if spin is None else spin.inputs), *met.inputs),
        constants=(*constants, *met.constants),
        definitions=(*ledger.definitions, *met.definitions),
        spin=None if spin is None else spin.angle,
        ring_rate=ring_rate,
        switches=met.switches,
    )


def _slipping(bearing: Bearing, names: Names, *, about_inner: bool) -> Definition:
    """Share of the inner ring's speed in that of a cage that lags: seen from the ring that stands, or the outer one."""
    kept = kept_share(bearing)
    share = 1 - kept * (1 - cage_ratio(names)) if about_inner else kept * cage_ratio(names)
    words = "Share of the inner ring's speed in that of the cage, slip included"
    return names.define(names.constant("cage_share"), share, "1", words, r"\kappa_c")


def _pass(names: Names, ring: str, speed: sp.Expr) -> Definition:
    """Mean speed of the balls over a ring."""
    words = f"Mean speed of the balls over the {ring} ring"
    return names.define(names.constant(f"{ring}_pass_speed"), speed, "rad/s", words, rf"\omega_{{c,{ring[0]}}}")


def _ratio(bearing: Bearing, names: Names) -> Definition:
    ball_diameter, pitch_diameter = symbol_of(bearing.ball_diameter), symbol_of(bearing.pitch_diameter)
    given = None if bearing.cage is None else bearing.cage.ratio
    return names.define(
        cage_ratio(names),
        (1 - contact_cosine(bearing) * ball_diameter / pitch_diameter) / 2 if given is None else symbol_of(given),
        "1",
        "Speed of the cage over speed of the inner ring, " + ("r_b/(R_b + r_b), Eq. (7)" if given is None else "given"),
        r"\omega_c/\omega",
    )


def _phase(bearing: Bearing, names: Names, ring: str = "") -> Input:
    """Angle of ball 1 at the reference time, as a ring sees it; "" in axes that stand still."""
    seen = f", as the {ring} ring sees it" if ring else ""
    return phase(
        f"{bearing.prefix}{f'{ring}_pass' if ring else 'cage'}",
        names.words(f"Angle of ball 1{f' of {bearing.name}' if bearing.name else ''} at the reference time{seen}"),
        names.latex(rf"\psi_{{0,{ring[0]}}}" if ring else r"\psi_0"),
        offset=bearing.ball_angle.path,
        rate=f"{bearing.path}.{f'{ring}_pass' if ring else 'cage'}_speed",
    )
