"""Angle of the balls: pure rolling between two rings that turn, or a cage that slips as the scene says.

In: a bearing and how its rings turn.  Out: a `Cage`: angle and rate of ball 1, and what they are made of.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import sympy as sp

from ballpass.derive.bearing.cage_slip import excess_slip, kept_share, lag_at_rows, lag_coordinate, lag_names
from ballpass.derive.bearing.contact_direction import ball_turns, contact_cosine
from ballpass.derive.bearing.effects import EFFECTS
from ballpass.derive.bearing.effects.effect import Passing
from ballpass.derive.drive import Drive, KnownDrive, OverAngle
from ballpass.derive.mechanism.kinematics import Ledger, Pose
from ballpass.derive.mechanism.swing import STILL, Swing
from ballpass.derive.scene.bearing_records import Bearing
from ballpass.derive.scene.records import Driver
from ballpass.derive.terms import TIME, Definition, Names, names_of, symbol_of
from ballpass.derive.variables import Coordinate, Input, StateSwitch, turned
from ballpass.runtime.contract.manifest import TurningInfo


@dataclass(frozen=True, slots=True, kw_only=True)
class Cage:
    """How the balls turn.

    Attributes
    ----------
    angle, rate : of ball 1 [rad], [rad/s]
    in_outer, in_inner : angle of ball 1 as the outer and the inner ring see it, which stood along x at the start [rad]
    inputs : the parts of these angles that turn with a known driver, at the reference time; and what effects need
    constants, definitions : of the symbols in these
    spin : angle of a ball's own material that meets the outer raceway, None where no effect asks for it [rad]
    share : of the inner ring's speed in that of the cage, slip included; the rest is that of the outer ring's; a
        function of time where the slip changes
    ring_rate : of the inner ring relative to the outer one [rad/s]; None where effects do not need it: without any, and
        where rings that are loaded one-way turn evenly
    switches : places of the motion at which a ball enters or leaves a spall, where these times are not known before
    lag : coordinate whose velocity is the angle by which the cage lags, and the rate of that [rad/s]; None where the
        slip does not change, and where the rings turn with a known driver
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


@dataclass(frozen=True, slots=True, kw_only=True)
class _Slip:
    """A slip that changes, and turns of the balls over the ring that it is seen from, in one of the driver."""

    excess: Input
    rolling: sp.Symbol
    constants: tuple[Definition, ...]


def _slip(bearing: Bearing, names: Names, rolled: sp.Expr) -> _Slip | None:
    """None where the slip does not change."""
    excess = excess_slip(bearing, names)
    if excess is None:
        return None
    words = "Turns of the balls over the ring that slip is seen from, in one of the driver, if they rolled"
    turns = names.define(names.constant("rolling_turns"), rolled, "1", words, "N_c")
    return _Slip(excess=excess, rolling=turns.symbol, constants=(*lag_at_rows(bearing, names), turns))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Known:
    """An angle that turns with a known driver [rad]: it, its turning, and the constants of that."""

    angle: sp.Expr
    turning: TurningInfo
    input: Input
    constants: tuple[Definition, ...]


def _known(
    bearing: Bearing,
    names: Names,
    part: str,
    turns: sp.Expr,
    drive: KnownDrive | None,
    slip: _Slip | None,
    each: sp.Expr = sp.S.One,
) -> _Known:
    """Angle of ball 1, or of its material, that makes `turns` turns in one of the driver (`drive` is None: none).

    Parameters
    ----------
    part : "cage", "outer_pass" or "inner_pass" for it as a ring sees it, "spin" for its material
    each : how much the slip of the cage counts
    """
    speed = names.constant(f"{part}_speed")
    of = f" of {bearing.name}" if bearing.name else ""
    spins = part == "spin"
    seen = f", as the {part.partition('_')[0]} ring sees it" if part.endswith("_pass") else ""
    words = f"Angle of ball 1{of} at the reference time{seen}"
    latex = rf"\psi_{{0,{part[0]}}}" if seen else r"\psi_0"
    if spins:
        words, latex = f"{SPIN}{of}, at the reference time", r"\chi_0"
    turning = TurningInfo(
        name=f"{bearing.prefix}{part}",
        kind="spin" if spins else "cage" if part == "cage" else "pass",
        words=f"the cage of {names.path}",
        offset=names.constant("spin_start").name if spins else bearing.ball_angle.path,
        rate=speed.name,
        parts=1 if spins else bearing.balls,
    )
    constants: tuple[Definition, ...] = ()
    even = drive is None or drive.even
    if slip is not None or not even:
        each_turn = names.define(
            names.constant(f"{part}_turns"), turns, "1", f"Turns of {part.replace('_', ' ')} in one of the driver", "N"
        )
        constants = (each_turn,)
        turning = replace(
            turning,
            turns=each_turn.symbol.name,
            times=() if drive is None else drive.turning.times,
            speeds=() if drive is None else drive.turning.speeds,
        )
    passed = sp.S.Zero if drive is None else drive.passed
    angle = speed * TIME if even else turns * passed
    if slip is not None:
        assert bearing.cage is not None  # its slip changes
        assert bearing.cage.lag is not None
        rolling, lag = slip.rolling, symbol_of(bearing.cage.lag)
        if each != 1:
            more = (
                names.define(names.constant(f"{part}_rolling"), each * rolling, "1", f"{rolling.name}, of {part}", "N"),
                names.define(names.constant(f"{part}_lag"), each * lag, "rad", f"{lag.name}, of {part}", r"\lambda"),
            )
            constants, rolling, lag = (*constants, *more), more[0].symbol, more[1].symbol
        turning = replace(
            turning,
            rolling=rolling.name,
            lag=lag.name,
            lag_times=tuple(q.path for q in bearing.cage.time),
            lags=tuple(symbol.name for symbol in lag_names(bearing, names)),
        )
        angle -= rolling * slip.excess.symbol * passed
    start = turned(turning, names.words(words), names.latex(latex))
    return _Known(angle=start.symbol + angle, turning=turning, input=start, constants=constants)


def cage_on_shaft(bearing: Bearing, drive: KnownDrive | None, *, outer: bool = False) -> Cage:
    """A ring at constant speed, the inner one or the `outer`; the other stands, Eq. (7).  A cage may lag."""
    names = names_of(bearing)
    shaft_speed = sp.S.Zero if drive is None else drive.speed
    ring, share = ("outer", 1 - cage_ratio(names)) if outer else ("inner", cage_ratio(names))
    speed, pass_speed = names.constant("cage_speed"), names.constant(f"{ring}_pass_speed")
    turns, slip = kept_share(bearing) * share, _slip(bearing, names, share)
    constants: tuple[Definition, ...] = (
        _ratio(bearing, names),
        names.define(speed, turns * shaft_speed, "rad/s", "Speed of the cage", r"\omega_c"),
        _pass(names, ring, speed - shaft_speed),
        *((_pass(names, "inner", speed),) if outer else ()),
        *(() if slip is None else slip.constants),
    )
    still = _known(bearing, names, "cage", turns, drive, slip)
    moving = _known(bearing, names, f"{ring}_pass", turns - 1, drive, slip)
    over_outer, over_inner = (moving, still) if outer else (still, moving)
    known, ledger, rate = [still, moving], Ledger(), speed
    if slip is not None:
        words = names.words("speed of the balls about the bearing's axis")
        slower = speed - slip.rolling * slip.excess.symbol * shaft_speed
        rate = ledger.define(f"{bearing.prefix}cage.rate", slower, "rad/s", words, names.latex(r"\dot\psi"))
    spin: _Known | None = None
    if _spins(bearing):
        constants += _spin_constants(bearing, names, pass_speed if outer else speed)
        of_ball = ball_turns(bearing) * (turns - 1 if outer else turns)
        spin = _known(bearing, names, "spin", of_ball, drive, slip, ball_turns(bearing))
        known.append(spin)
    passes = Passing(
        outer=(over_outer.angle, speed),
        inner=(over_inner.angle, speed),
        turnings={"outer": over_outer.turning, "inner": over_inner.turning}
        | ({} if spin is None else {"spin": spin.turning}),
    )
    met = _met(bearing, names, passes)
    return Cage(
        angle=still.angle,
        rate=rate,
        in_outer=over_outer.angle,
        in_inner=over_inner.angle,
        inputs=(*(one.input for one in known), *(() if slip is None else (slip.excess,)), *met.inputs),
        constants=(*constants, *(c for one in known for c in one.constants), *met.constants),
        definitions=ledger.definitions,
        spin=None if spin is None else spin.angle,
        share=cage_ratio(names),
    )


#: What the angle of a ball's spin is.
SPIN = "Angle of a ball's material that meets the outer raceway"


def _spins(bearing: Bearing) -> bool:
    return any(EFFECTS[e.kind].spins(e) for e in bearing.effects)


def _spin_constants(bearing: Bearing, names: Names, over_outer: sp.Expr) -> tuple[Definition, ...]:
    """Balls that roll on the outer raceway: as much of their surface passes as of the raceway.

    Parameters
    ----------
    over_outer : mean speed of the cage over the outer ring [rad/s]
    """
    start, speed = names.constant("spin_start"), names.constant("spin_speed")
    words = "Speed of the balls about their own axes, seen from the cage"
    return (
        names.define(start, sp.S.Zero, "rad", f"{SPIN} at the start, from which it is counted", r"\chi_{00}"),
        names.define(speed, ball_turns(bearing) * over_outer, "rad/s", words, r"\omega_w"),
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
    rolling = cage_ratio(names) - (1 if about_inner else 0)
    slip = _slip(bearing, names, rolling * (swings[0].turns - swings[1].turns))
    share_now = share
    if slip is not None:
        share_now = ledger.define(
            f"{bearing.prefix}cage.share",
            share - rolling * slip.excess.symbol,
            "1",
            "share of the inner ring's speed in that of the cage",
            names.latex(r"\kappa_c(t)"),
        )
        constants = (*constants, *slip.constants)
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
    known_drive = drive if isinstance(drive, KnownDrive) else None
    # a lag between rings that turn with a known driver is known; else it is a state
    evenly = known_drive is not None and all(one.swing == 0 for one in swings)
    lag = None if slip is None or evenly else lag_coordinate(bearing, names)
    behind = sp.S.Zero if lag is None else lag.velocity
    known: list[_Known] = []

    def ball(part: str, turns: sp.Expr, swung: sp.Expr) -> sp.Expr:
        """Angle of ball 1, of which so many turns go with the driver's."""
        if known_drive is None:
            return symbol_of(bearing.ball_angle) + turns * (drive.angle - start) + swung - behind
        known.append(_known(bearing, names, part, turns, known_drive, slip if evenly else None))
        return known[-1].angle + swung - behind

    angle, in_outer, over_outer = ball("cage", turns, swung), None, speed
    if outer is not STILL:
        constants += (_pass(names, "outer", share * names.constant("ring_speed")),)
        in_outer, over_outer = ball("outer_pass", share * around, share * apart), names.constant("outer_pass_speed")
    constants += (_pass(names, "inner", (share - 1) * names.constant("ring_speed")),)
    in_inner = ball("inner_pass", (share - 1) * around, (share - 1) * apart)
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
        inputs=(*(one.input for one in known), *(() if slip is None else (slip.excess,))),
        constants=(*constants, *(c for one in known for c in one.constants)),
        definitions=ledger.definitions,
        share=share_now,
        lag=None
        if lag is None or slip is None or ring_rate is None
        else (lag, rolling * slip.excess.symbol * ring_rate),
    )
    if not bearing.effects:
        return cage
    assert ring_rate is not None  # of effects
    rolls, spin, inputs = ball_turns(bearing), None, cage.inputs
    constants = cage.constants
    turnings = {one.turning.name.removeprefix(bearing.prefix).removesuffix("_pass"): one.turning for one in known}
    if evenly and outer is STILL:
        turnings["outer"] = turnings["cage"]
    if _spins(bearing):
        constants += _spin_constants(bearing, names, over_outer)
        rolled_on = share * (around * (drive.angle - start) + apart) - behind
        spin = rolls * rolled_on
        if known_drive is not None:
            over = _known(bearing, names, "spin", rolls * share * around, known_drive, slip if evenly else None, rolls)
            spin = over.angle + rolls * (share * apart - behind)
            inputs, constants = (*inputs, over.input), (*constants, *over.constants)
            turnings["spin"] = over.turning
    rates = (share_now * ring_rate, (share_now - 1) * ring_rate)
    passes = Passing(
        outer=(cage.in_outer, rates[0]),
        inner=(in_inner, rates[1]),
        spin=None if spin is None else (spin, rolls * rates[0]),
        turnings=turnings if evenly else None,
    )
    met = _met(bearing, names, passes)
    return replace(
        cage,
        inputs=(*inputs, *met.inputs),
        constants=(*constants, *met.constants),
        definitions=(*ledger.definitions, *met.definitions),
        spin=spin,
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
