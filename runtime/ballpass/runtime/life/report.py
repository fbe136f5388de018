"""Strength and life of the bearings of a scene, over its duty cycle where it has one.

In: a model, overrides, a request.  Out: a `LifeReport`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.contract.manifest import BearingInfo, DutyInfo
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.life.combined_load import combined_load
from ballpass.runtime.life.limits import limits_of
from ballpass.runtime.life.load_history import LoadHistory, load_history
from ballpass.runtime.life.records import BearingStrength, DutyLife, RingStrength, StateStrength
from ballpass.runtime.life.text import LifeReport
from ballpass.runtime.life.wear import LoadSamples, load_samples, wear_field
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.native.reduction_rows import SECTORS
from ballpass.runtime.point.model_limits import limits_of_fit
from ballpass.runtime.ratings import life
from ballpass.runtime.ratings.elements import RATED
from ballpass.runtime.ratings.lubrication import contamination_of_class, contamination_of_code, viscosity
from ballpass.runtime.ratings.of_bearing import (
    RacewayContact,
    Ratings,
    contacts_of,
    geometry_of,
    radial_gap,
    rated_element,
    ratings_of,
    why_no_life,
)
from ballpass.runtime.ratings.oscillation import Oscillation, oscillation
from ballpass.runtime.ratings.tilt import Tilt, free_tilt, shaft_slope
from ballpass.runtime.ratings.wear import COEFFICIENTS
from ballpass.runtime.request.request import Request
from ballpass.runtime.time import timeline
from ballpass.runtime.time.turning import TURN


def life_report(
    model: LoadedModel, parameters: Mapping[str, float], request: Request, reliability: float
) -> LifeReport:
    """Run the scene, in every state of its duty cycle, and judge its bearings.

    Parameters
    ----------
    reliability : share of bearings that lives of the text are reached by, one of `RELIABILITY` [1]

    Raises
    ------
    RequestError
        The scene has no bearing, or one that no standard rates, or a wrong request.
    SimulationError
        The computation failed.
    """
    manifest = model.manifest
    for info in manifest.bearings:  # before the run
        geometry_of(info, model.numbers(parameters).values)
    states = manifest.duty or (DutyInfo(name="", share=1.0, parameters=()),)
    judged = [_state(model, {**parameters, **dict(state.parameters)}, state, request) for state in states]
    return LifeReport(
        scene=manifest.scene,
        title=manifest.title,
        states=tuple(judged),
        duty=tuple(_over_duty(info, judged) for info in manifest.bearings) if manifest.duty else (),
        reliability=reliability,
    )


def _state(model: LoadedModel, parameters: Mapping[str, float], state: DutyInfo, request: Request) -> StateStrength:
    numbers = model.numbers(parameters)
    moving = model.numbers({**parameters, **timeline.set_moving(model.manifest, numbers.values)})
    if state.name and timeline.shaft_speed(model.manifest, moving.values) == 0.0:
        return StateStrength(
            name=state.name, share=state.share, bearings=(), turns=None, change=0.0, settled=True, samples=0
        )
    history = load_history(model, numbers, request)
    samples = load_samples(history.run, history.turns)
    return StateStrength(
        name=state.name,
        share=state.share,
        bearings=tuple(
            _bearing(model, numbers, moving.values, info, history, samples[info.prefix])
            for info in model.manifest.bearings
        ),
        turns=history.turns,
        change=history.change,
        settled=history.settled,
        samples=len(next(iter(samples.values())).time),
    )


def _bearing(
    model: LoadedModel,
    numbers: Numbers,
    moving: Mapping[str, float],
    info: BearingInfo,
    history: LoadHistory,
    samples: LoadSamples,
) -> BearingStrength:
    """Strength of one bearing; `moving` are its numbers with the driver at speed."""
    manifest, values = model.manifest, numbers.values
    ratings = ratings_of(info, values)
    peak = history.peaks[info.prefix]
    force, nominal = max(peak.maximum, 0.0), float(geometry_of(info, values).nominal_cosine)
    turning = timeline.shaft_speed(manifest, moving)
    why = why_no_life(info, moving, turning)
    # of a shaft that carries the outer ring, `ring_speed` is that ring's
    sense = -moving[info.ring_speed] if info.inner_stands and not info.joint else moving[info.ring_speed]
    speed = 0.0 if why else math.copysign(history.speeds[info.prefix], sense)
    powers, balls = history.powers[info.prefix], (ratings.inner_ball, ratings.outer_ball)
    turns = None if why else float(life.raceway_life(balls, powers, ratings.life))
    load = samples.equivalent_load(float(ratings.life.basic))
    tilt = _tilt(info, values, load, samples.tilt)
    combined = combined_load(info, values, ratings, samples, tilt.total, turns=not why)
    found, heaviest = (turns, force) if combined is None else (combined.life, max(force, combined.peak_force))
    ratio, contamination, factor, modified = _modified(info, values, ratings, speed, found)
    inner, outer = _rings(info, values, ratings, samples, powers, force, turns=not why)
    strength = BearingStrength(
        name=info.name,
        element=info.element,
        dynamic_rating=float(ratings.dynamic),
        static_rating=float(ratings.static),
        fatigue_limit=float(ratings.fatigue_limit),
        given=ratings.given,
        assumed=rated_element(info).is_assumed(geometry_of(info, values)),
        peak_force=force,
        peak_time=peak.maximum_time,
        peak_ball=int(peak.maximum_ball or 0),
        peak_angle=None if timeline.is_free(manifest) else timeline.crank_angle(manifest, values, peak.maximum_time),
        static_safety=static_safety(info.balls, float(ratings.static), heaviest * nominal),
        inner=inner,
        outer=outer,
        speed=speed,
        why_no_life=why,
        equivalent_load=load,
        basic_life=None if why else _basic(ratings, load),
        life=turns,
        viscosity_ratio=ratio,
        contamination=contamination,
        factor=factor,
        modified_life=modified,
        combined=combined,
    )
    warned = (tilt.beyond, "" if combined is None else combined.beyond)
    return replace(
        strength,
        beyond=(
            *limits_of(info, moving, strength, history.fastest),
            *filter(None, warned),
            *limits_of_fit(info, values),
        ),
        oscillation=_oscillation(info, values, ratings, samples, load, force) if why and turning else None,
        tilt=tilt,
    )


def _oscillation(
    info: BearingInfo,
    values: Mapping[str, float],
    ratings: Ratings,
    samples: LoadSamples,
    load: float,
    force: float,
) -> Oscillation | None:
    """What a hand formula says of rings that swing; None where they do not."""
    amplitude = 0.5 * float(np.ptp(np.unwrap(samples.in_outer) - np.unwrap(samples.in_inner)))
    if not amplitude > 0.0:
        return None
    geometry = geometry_of(info, values)
    lengths = [float(contact.semi_axes(force)[1]) for contact in contacts_of(info, values)]
    across = float(geometry.cosine * geometry.diameter)  # the circles of contacts are so far apart, less at an angle
    inner, outer = (
        (length, 0.5 * (float(geometry.pitch) - sign * across))
        for length, sign in zip(lengths, (1.0, -1.0), strict=True)
    )
    return oscillation(
        amplitude,
        load,
        dynamic_rating=float(ratings.dynamic),
        exponent=float(ratings.life.basic),
        balls=info.balls,
        gamma=float(geometry.gamma),
        contacts=(inner, outer),
    )


def _tilt(info: BearingInfo, values: Mapping[str, float], load: float, shaft: float | None) -> Tilt:
    """Tilt of the rings by what the scene says of shaft and housing, and what the clearance leaves free.

    `shaft` is that of a rigid one in its bearings, largest of the run.
    """
    said, geometry = info.alignment, geometry_of(info, values)
    free, keys = None, ("inner_groove_radius", "outer_groove_radius")
    if all(key in geometry.contact for key in keys):
        inner, outer = (float(geometry.contact[key]) for key in keys)
        free = free_tilt(
            float(geometry.diameter), float(geometry.pitch), (inner, outer), 2.0 * radial_gap(info, values)
        )
    bending = None
    if said is not None and said.span is not None and said.shaft_diameter is not None:
        bending = shaft_slope(load, said.span, said.shaft_diameter)
    return Tilt(misalignment=None if said is None else said.misalignment, bending=bending, free=free, shaft=shaft)


def static_safety(balls: int, static_rating: float, force: float) -> float:
    """s_0 of the load of which the heaviest ball bears `force` radially [N]: Z/5 of it, as in ISO 76."""
    return float(life.static_safety(static_rating, balls * force / 5.0)) if force > 0.0 else math.inf


def _basic(ratings: Ratings, load: float) -> float:
    return float(life.basic_life(ratings.dynamic, load, ratings.life)) if load > 0.0 else math.inf


def _rings(
    info: BearingInfo,
    values: Mapping[str, float],
    ratings: Ratings,
    samples: LoadSamples,
    powers: NDArray[np.float64],
    force: float,
    *,
    turns: bool,
) -> tuple[RingStrength, RingStrength]:
    """Inner and outer ring."""
    loads = life.raceway_loads(powers, ratings.life)
    root, standing = float(1 / ratings.life.turning), float(ratings.life.standing)
    fields = (powers[1], powers[0])
    # (Q_e/Q_c) of a ring, to the exponent of a standing one, is the mean of this over its places
    damage = [
        (life.KILO * field**root / float(rating)) ** standing
        for field, rating in zip(fields, (ratings.inner_ball, ratings.outer_ball), strict=True)
    ]
    total = float(sum(np.sum(part) for part in damage))

    def ring(k: int, contact: RacewayContact, place: NDArray[np.float64]) -> RingStrength:
        wide, narrow = contact.semi_axes(force)
        across, rate = wear_field(samples, place, contact)
        sector, off = np.unravel_index(int(np.argmax(rate)), rate.shape)
        return RingStrength(
            peak_pressure=float(contact.peak_pressure(force)),
            major_axis=float(wide),
            minor_axis=float(narrow),
            equivalent_load=float(loads[k]) if turns else None,
            damage=tuple((damage[k] / total).tolist()) if turns and total > 0.0 else (),
            worst_angle=TURN * int(np.argmax(fields[k])) / SECTORS,
            wear=(COEFFICIENTS[0] * float(rate[sector, off]), COEFFICIENTS[1] * float(rate[sector, off])),
            wear_angle=TURN * (int(sector) + 0.5) / SECTORS,
            wear_across=float(across[off]),
        )

    inner, outer = contacts_of(info, values)
    return ring(0, inner, samples.in_inner), ring(1, outer, samples.in_outer)


def _modified(
    info: BearingInfo, values: Mapping[str, float], ratings: Ratings, speed: float, found: float | None
) -> tuple[float | None, float | None, float | None, float | None]:
    """κ, e_C, a_ISO and L_nmr; None where the scene gives no film."""
    film = info.lubrication
    if film is None or found is None:
        return None, None, None, None
    ratio, pitch = film.viscosity_ratio, values[f"{info.path}.pitch_diameter"]
    if ratio is None:  # the scene gives one of three
        thick = film.viscosity
        if film.oil_grade is not None and film.temperature_celsius is not None:
            thick = viscosity(film.oil_grade, film.temperature_celsius)
        assert thick is not None
        ratio = life.viscosity_ratio(thick, speed, pitch)
    contamination = film.contamination
    if film.cleanliness is not None:
        contamination = contamination_of_class(film.cleanliness, pitch)
    elif film.oil_code is not None:
        contamination = contamination_of_code(film.oil_code, film.filter or "off line", ratio, pitch)
    assert contamination is not None
    load = life.equivalent_load(ratings.dynamic, found, ratings.life)
    limit = contamination * ratings.fatigue_limit / load if load > 0.0 else math.inf
    factor = life.MOST_MODIFIED if math.isinf(limit) else float(life.life_factor(ratio, limit, ratings.life.factor))
    return ratio, contamination, factor, float(life.modified_life(found, factor))


def _over_duty(info: BearingInfo, states: list[StateStrength]) -> DutyLife:
    """Miner's rule over the states of a duty cycle, by shares of time: damage an hour adds up."""
    turning = [(state, _of(state, info.name)) for state in states if state.bearings]
    lasting = [(state, bearing) for state, bearing in turning if not bearing.why_no_life]
    if not lasting:
        why = turning[0][1].why_no_life if turning else "Nothing turns in any state."
        return DutyLife(name=info.name, why_no_life=why)
    shares = [state.share for state, _ in lasting]

    def together(of: list[float]) -> tuple[float, float]:
        """Life in hours and in turns, from that of each state in turns."""
        spent = [bearing.hours(turns) for (_, bearing), turns in zip(lasting, of, strict=True)]
        damage = sum(share / each for share, each in zip(shares, spent, strict=True))
        total = 1.0 / damage if damage > 0.0 else math.inf
        speed = sum(share * abs(bearing.speed) for share, (_, bearing) in zip(shares, lasting, strict=True))
        return total, total * 3600.0 * speed / TURN

    basics, lives = (
        [each for each in kind if each is not None]
        for kind in zip(*(bearing.rated_lives for _, bearing in lasting), strict=True)
    )
    (spent, turns), basic = together(lives), together(basics)
    first = lasting[0][1]
    films = [bearing.modified_life for _, bearing in lasting]
    modified = None if None in films else together([each for each in films if each is not None])
    damage = {state.name: 0.0 for state in states}
    for (state, bearing), each in zip(lasting, lives, strict=True):
        damage[state.name] = state.share * spent / bearing.hours(each)
    return DutyLife(
        name=info.name,
        hours=spent,
        turns=turns,
        modified_hours=None if modified is None else modified[0],
        modified_turns=None if modified is None else modified[1],
        mean_load=float(life.equivalent_load(first.dynamic_rating, basic[1], RATED[first.element].life)),
        basic_hours=basic[0],
        basic_turns=basic[1],
        damage=damage,
    )


def _of(state: StateStrength, name: str) -> BearingStrength:
    return next(bearing for bearing in state.bearings if bearing.name == name)
