"""Angle of the balls: pure rolling between two rings that turn, or a cage that slips as the scene says.

In: a bearing and how its rings turn.  Out: a `Cage`: angle and rate of ball 1, and what they are made of.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import sympy as sp

from ballpass.derive.bearing.cage_slip import excess_slip, lag_at_rows, lag_coordinate, lag_names
from ballpass.derive.bearing.contact_direction import ball_turns, contact_cosine
from ballpass.derive.bearing.effects import EFFECTS
from ballpass.derive.bearing.effects.effect import Passing
from ballpass.derive.drive import Drive, KnownDrive
from ballpass.derive.mechanism.kinematics import Ledger
from ballpass.derive.mechanism.swing import STILL, Swing
from ballpass.derive.scene.bearing_records import Bearing
from ballpass.derive.terms import TIME, Definition, Names, names_of, symbol_of
from ballpass.derive.variables import Coordinate, Input, Terms, turned
from ballpass.runtime.contract.manifest import TurningInfo


@dataclass(frozen=True, slots=True, kw_only=True)
class Cage(Terms):
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
    share: sp.Expr
    spin: sp.Expr | None = None
    ring_rate: sp.Symbol | None = None
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
    drive: KnownDrive,
    slip: _Slip | None,
    each: sp.Expr = sp.S.One,
) -> _Known:
    """Angle of ball 1, or of its material, that makes `turns` turns in one of the driver.

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
    if slip is not None or not drive.even:
        each_turn = names.define(
            names.constant(f"{part}_turns"), turns, "1", f"Turns of {part.replace('_', ' ')} in one of the driver", "N"
        )
        constants = (each_turn,)
        turning = replace(
            turning,
            turns=each_turn.symbol.name,
            times=drive.turning.times,
            speeds=drive.turning.speeds,
        )
    angle = speed * TIME if drive.even else turns * drive.passed
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
        angle -= rolling * slip.excess.symbol * drive.passed
    start = turned(turning, names.words(words), names.latex(latex))
    return _Known(angle=start.symbol + angle, turning=turning, input=start, constants=constants)


#: What the angle of a ball's spin is.
SPIN = "Angle of a ball's material that meets the outer raceway"


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


def cage_of(bearing: Bearing, rings: tuple[Swing, Swing], drive: Drive) -> Cage:
    """Balls between two rings: ``theta_0`` plus the angles of both since the start, each with its weight, Eq. (7).

    Parameters
    ----------
    rings : how inner and outer ring turn
    drive : what turns them; where a torque drives, constant speeds are initial ones
    """
    names, ledger = names_of(bearing), Ledger()
    inner, outer = rings
    known = drive if isinstance(drive, KnownDrive) else None
    evenly = known is not None and inner.swing == outer.swing == 0
    steady = known is not None and known.even and evenly and bearing.coupling == "one-way"
    around, relative = inner.turns - outer.turns, inner.rate - outer.rate
    apart = inner.swing - inner.at_start - outer.swing + outer.at_start
    constants, share = [_ratio(bearing, names)], cage_ratio(names)
    if bearing.cage is not None and bearing.cage.slipping:
        constants.append(_slipping(bearing, names, about_inner=inner is STILL))
        share = constants[-1].symbol
    # of the last row, as are all angles less the lag
    weights = (share, 1 - share)
    swung = sum((w * (s.swing - s.at_start) for w, s in zip(weights, rings, strict=True)), start=sp.S.Zero)
    turns = sum((w * s.turns for w, s in zip(weights, rings, strict=True)), start=sp.S.Zero)
    rolling = cage_ratio(names) - (1 if inner is STILL else 0)
    slip, share_now = _slip(bearing, names, rolling * around), share
    if slip is not None:
        share_now = ledger.define(
            f"{bearing.prefix}cage.share",
            share - rolling * slip.excess.symbol,
            "1",
            "share of the inner ring's speed in that of the cage",
            names.latex(r"\kappa_c(t)"),
        )
        constants += slip.constants
    if bearing.coupling == "two-way" or {inner.turns, outer.turns} - {0, 1}:  # else it is that of driver or shaft
        words = "Mean speed of the inner ring relative to the outer one"
        ring_speed = names.constant("ring_speed")
        constants.append(names.define(ring_speed, around * drive.first_speed, "rad/s", words, r"\omega_{io}"))
    speed = names.constant("cage_speed")
    constants.append(names.define(speed, turns * drive.first_speed, "rad/s", "Mean speed of the cage", r"\omega_c"))
    rate = speed
    if slip is not None or not steady:
        rate = ledger.define(
            f"{bearing.prefix}cage.rate",
            share_now * inner.rate + (1 - share_now) * outer.rate,
            "rad/s",
            names.words("speed of the balls about the bearing's axis"),
            names.latex(r"\dot\psi"),
        )
    # a lag between rings that turn with a known driver is known; else it is a state
    lag = None if slip is None or evenly else lag_coordinate(bearing, names)
    behind = sp.S.Zero if lag is None else lag.velocity
    angles: list[_Known] = []

    def ball(part: str, turns: sp.Expr, swung: sp.Expr, each: sp.Expr = sp.S.One) -> sp.Expr:
        """Angle of ball 1, or of its material, of which so many turns go with the driver's."""
        swung -= each * behind
        if known is None:
            start = sp.S.Zero if part == "spin" else symbol_of(bearing.ball_angle)
            return start + turns * (drive.angle - drive.first_angle) + swung
        angles.append(_known(bearing, names, part, turns, known, slip if evenly else None, each))
        return angles[-1].angle + swung

    angle = ball("cage", turns, swung)
    seen = {"outer": angle}
    for ring, turning, its in (("outer", outer, share), ("inner", inner, share - 1)):
        if ring == "inner" or turning is not STILL:  # an outer ring that stands sees the angle itself
            seen[ring] = ball(f"{ring}_pass", its * around, its * apart)
            constants.append(_pass(names, ring, speed - turning.turns * drive.first_speed))
    ring_rate: sp.Symbol | None = None
    if (bearing.effects or lag is not None) and not steady:
        ring_rate = ledger.define(
            f"{bearing.prefix}cage.ring_rate",
            relative,
            "rad/s",
            "speed of the inner ring relative to the outer one",
            names.latex(r"\omega_{io}"),
        )
    rolls, spin = ball_turns(bearing), None
    if any(EFFECTS[e.kind].spins(e) for e in bearing.effects):
        constants += _spin_constants(bearing, names, speed if outer is STILL else names.constant("outer_pass_speed"))
        spin = ball("spin", rolls * share * around, rolls * share * apart, rolls)
    moving = relative if ring_rate is None else ring_rate
    turnings = {one.turning.name.removeprefix(bearing.prefix).removesuffix("_pass"): one.turning for one in angles}
    passes = Passing(
        outer=(seen["outer"], share_now * moving),
        inner=(seen["inner"], (share_now - 1) * moving),
        spin=None if spin is None else (spin, rolls * share_now * moving),
        turnings={"outer": turnings["cage"]} | turnings if evenly else None,
    )
    met = [EFFECTS[e.kind].edges(e, bearing, names, passes) for e in bearing.effects]
    constants += [c for one in angles for c in one.constants]
    constants += [c for e in bearing.effects for c in EFFECTS[e.kind].constants(e, bearing, names)]
    return Cage(
        angle=angle,
        rate=rate,
        in_outer=seen["outer"],
        in_inner=seen["inner"],
        inputs=(
            *(one.input for one in angles),
            *(() if slip is None else (slip.excess,)),
            *(i for one in met for i in one.inputs),
        ),
        constants=tuple(constants),
        definitions=(*ledger.definitions, *(d for one in met for d in one.definitions)),
        spin=spin,
        share=share_now,
        ring_rate=ring_rate,
        switches=tuple(switch for one in met for switch in one.switches),
        lag=None if lag is None or slip is None else (lag, rolling * slip.excess.symbol * moving),
    )


def _slipping(bearing: Bearing, names: Names, *, about_inner: bool) -> Definition:
    """Share of the inner ring's speed in that of a cage that lags: seen from the ring that stands, or the outer one."""
    assert bearing.cage is not None  # it slips
    kept = 1 - symbol_of(bearing.cage.slip or bearing.cage.slips[-1])
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
