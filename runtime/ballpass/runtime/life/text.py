"""The report on strength and life of a scene's bearings."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass

from ballpass.runtime.life.records import BearingStrength, DutyLife, FitSpread, RingStrength, StateStrength
from ballpass.runtime.ratings.elements import RATED
from ballpass.runtime.ratings.life import MILLION, RELIABILITY
from ballpass.runtime.ratings.wear import COEFFICIENTS
from ballpass.runtime.report.numbers import rounded
from ballpass.runtime.report.report import Report, ReportTable, Words
from ballpass.runtime.report.reported import Reported

_Parts = list[Words | ReportTable]


@dataclass(frozen=True, slots=True, kw_only=True)
class LifeReport(Reported):
    """Strength and life of all bearings of a scene; see `ballpass.runtime.Model.life`.

    Attributes
    ----------
    scene, title : of the model
    states : of the duty cycle, one for a scene without
    duty : life of each bearing over the cycle; empty for a scene without
    reliability : share of bearings that reach the lives of the text; all others are those of 90 % [1]
    fits : of each bearing with a fit by class, over the clearances that it leaves, in the first state that turns

    Examples
    --------
    >>> report = model.life(cycles=4, transient=2)
    >>> [f"{bearing.life / 1e6:.0f} million turns" for bearing in report.bearings]
    ['225 million turns']
    """

    scene: str
    title: str
    states: tuple[StateStrength, ...]
    duty: tuple[DutyLife, ...]
    reliability: float = 0.9
    fits: tuple[FitSpread, ...] = ()

    @property
    def bearings(self) -> tuple[BearingStrength, ...]:
        """The bearings in the first state."""
        return self.states[0].bearings

    @property
    def unsettled(self) -> tuple[str, ...]:
        """Sentences about lives that more turns would change."""
        return tuple(
            f"{f'State {state.name}: ' if state.name else ''}{_turns_words(state)} "
            "Take more: --cycles; of a load or speed over time those of a whole cycle of work."
            for state in self.states
            if not state.settled
        )

    @property
    def beyond(self) -> tuple[str, ...]:
        """Limits of these numbers that bearings are beyond, sentences."""
        return tuple(
            f"{' '.join(filter(None, ('Bearing', bearing.name, state.name and f'in state {state.name}')))}: {words}"
            for state in self.states
            for bearing in state.bearings
            for words in bearing.beyond
        )

    @property
    def has_lives(self) -> bool:
        """Whether the rings turn against each other, in any state."""
        return any(bearing.life is not None for state in self.states for bearing in state.bearings)

    def _report(self) -> Report:
        facts, records = asdict(self), []
        for state, plain in zip(self.states, facts["states"], strict=True):
            for bearing, entry in zip(state.bearings, plain["bearings"], strict=True):
                entry["hours"] = None if bearing.life is None else bearing.hours(bearing.life)
                lives = {name: math.nan if entry[name] is None else entry[name] for name in ("life", "hours")}
                if bearing.oscillation is not None:
                    entry["oscillation"]["units"] = {"life": "1", "load": "N", "amplitude": "rad"}
                forces = {name: entry[name] for name in ("peak_force", "static_safety")}
                pressure = max(bearing.inner.peak_pressure, bearing.outer.peak_pressure)
                names = {"state": state.name, "bearing": bearing.name}
                records.append(names | lives | forces | {"peak_pressure": pressure})
        facts["wear_coefficients"] = list(COEFFICIENTS)
        swinging = [bearing.why_no_life for state in self.states for bearing in state.bearings if bearing.why_no_life]
        return Report(
            title=f"{self.title}: strength and life of its bearings",
            parts=[*(part for state in self.states for part in _state_parts(state, self.reliability))]
            + [part for life in self.duty for part in _duty_parts(life, self.reliability)]
            + [part for fit in self.fits for part in ("", _fit_table(fit, self.reliability))]
            + self._meanings(),
            facts=facts,
            records=records,
            index=("state", "bearing"),
            warnings=(
                *(words for fit in self.fits for words in fit.failed),
                *self.unsettled,
                *self.beyond,
                *dict.fromkeys(swinging),
            ),
        )

    def _meanings(self) -> _Parts:
        """What the lives are."""
        if not self.has_lives:
            return []
        lives = f"  Lives: what {_percent(self.reliability)} of such bearings reach. basic: from P alone (ISO 281); "
        lives += "reference: from the load of every ball or roller at every place of both raceways (ISO 16281)"
        if any(bearing.factor is not None for state in self.states for bearing in state.bearings):
            lives += "; modified: with a factor a_ISO for oil film (viscosity ratio κ) and dirt (contamination e_C)"
        return [f"{lives}."]

    def __repr__(self) -> str:
        parts = []
        for found in self.duty or self.bearings:
            name = f"{found.name}: " if found.name else ""
            if found.why_no_life:
                parts.append(f"{name}no life")
            elif isinstance(found, DutyLife):
                parts.append(f"{name}{found.hours:.4g} h")
            else:
                parts.append(f"{name}{_million(found.life)}, s_0 {found.static_safety:.3g}")
        return f"LifeReport({self.scene}: {'; '.join(parts)})"


def _turns_words(state: StateStrength) -> str:
    run = "The run" if state.turns is None else f"{state.turns:.4g} steady turns"
    if state.settled:
        return f"{run}, settled: the second half moved lives and peaks by at most {rounded(100.0 * state.change, 2)} %."
    return f"{run}, not settled: the second half moved a life or a peak by {rounded(100.0 * state.change, 2)} %."


def _state_parts(state: StateStrength, reliability: float) -> _Parts:
    parts: _Parts = []
    if state.name:
        parts += ["", f"State {state.name}, {100.0 * state.share:.3g} % of the time"]
    if not state.bearings:
        return [*parts, "  nothing turns: no damage"]
    parts.append(f"  {_turns_words(state)}")
    parts.append("")  # behind a table there is one
    for bearing in state.bearings:
        parts += _bearing_parts(bearing, reliability)
    what = "Wear and P" if any(bearing.life is not None for bearing in state.bearings) else "Wear"
    return [*parts, f"  {what}: means of {state.samples} samples; angles from each ring's x axis."]


def _bearing_parts(bearing: BearingStrength, reliability: float) -> _Parts:
    rings, element = (bearing.inner, bearing.outer), RATED[bearing.element]
    at = f"{bearing.peak_time:.5g} s"
    if bearing.peak_angle is not None:
        at += f", {math.degrees(bearing.peak_angle):.1f} deg of crank or shaft"
    rows: dict[str, Callable[[RingStrength], str]] = {
        "peak pressure": lambda ring: f"{ring.peak_pressure / 1e6:.0f} MPa",
        element.contact_words: lambda ring: f"{1e3 * ring.major_axis:.3f} x {1e3 * ring.minor_axis:.3f} mm",
    }
    if not bearing.why_no_life:
        rows |= {
            f"equivalent {element.noun} load": lambda ring: _force(ring.equivalent_load),
            "place of the most damage": lambda ring: f"{math.degrees(ring.worst_angle):.0f} deg",
            "share of the damage": lambda ring: f"{100.0 * sum(ring.damage):.0f} %",
        }
    if any(ring.wear[1] > 0.0 for ring in rings):  # a straight roller does not slip
        rows |= {
            "deepest wear, lowest wear coefficient": lambda ring: _wear(ring.wear[0]),
            "deepest wear, highest wear coefficient": lambda ring: _wear(ring.wear[1]),
            "deepest wear, angle": lambda ring: f"{math.degrees(ring.wear_angle):.0f} deg",
            f"deepest wear, distance from the {element.middle}": lambda ring: f"{1e3 * ring.wear_across:.2f} mm",
        }
    parts: _Parts = [
        f"Bearing {bearing.name}".rstrip() + (" (grooves 0.52 and 0.53, steel: assumed)" if bearing.assumed else ""),
        f"  {_verdict(bearing, reliability)}",
        f"  load ratings: dynamic C_r {_force(bearing.dynamic_rating)} "
        f"({_source(bearing, 'dynamic_rating', 'ISO 281')}), "
        f"static C_0r {_force(bearing.static_rating)} ({_source(bearing, 'static_rating', 'ISO 76')}), "
        f"fatigue limit C_u {_force(bearing.fatigue_limit)} ({_source(bearing, 'fatigue_limit', element.limit_words)})",
        f"  highest {element.noun} force {_force(bearing.peak_force)}: {element.noun} {bearing.peak_ball}, {at}",
        ReportTable.of(
            rows.items(),
            {
                "~": lambda row: row[0],
                ">inner ring": lambda row: row[1](bearing.inner),
                ">outer ring": lambda row: row[1](bearing.outer),
            },
        ),
    ]
    if bearing.tilt is not None:
        parts.append(f"  {bearing.tilt.words}")
    if bearing.combined is not None:
        parts.append(f"  {bearing.combined.words}")
    if bearing.why_no_life:
        parts.append(f"  No rating life. {bearing.why_no_life}")
        return [*parts, f"  {bearing.oscillation.words}"] if bearing.oscillation is not None else parts
    lives = {
        f"basic L_10, equivalent load P {_force(bearing.equivalent_load)}": bearing.basic_life,
        "reference L_10r": bearing.life,
    }
    if bearing.combined is not None:
        if bearing.combined.basic_life is not None:
            axial = f"basic L_10, P = X F_r + Y F_a {_force(bearing.combined.equivalent_load)}"
            lives[axial] = bearing.combined.basic_life
        lives["reference L_10r, axial force and tilt"] = bearing.combined.life
    if bearing.factor is not None:
        film = f"κ {bearing.viscosity_ratio:.3g}, e_C {bearing.contamination:.2g}"
        words = f"modified L_nmr, a_ISO {bearing.factor:.3g}, {film}"
        lives[words] = bearing.modified_life
    known = {name: life for name, life in lives.items() if life is not None}
    return [*parts, _lives({name: (life, bearing.hours(life)) for name, life in known.items()}, reliability)]


def _verdict(bearing: BearingStrength, reliability: float) -> str:
    """What the numbers mean."""
    held = "bears its highest load" if bearing.static_safety >= 1.0 else "brinells at its highest load"
    verdict = f"It {held}: static safety s_0 {bearing.static_safety:.3g}."
    shortest = bearing.reached
    if shortest is None:
        return verdict
    hours = RELIABILITY[reliability] * bearing.hours(shortest)
    spent = f"{hours:.0f} h or longer" if hours < MILLION else "more than a million hours"
    return (
        f"{verdict} {_percent(reliability)} of such bearings run {'without limit' if math.isinf(shortest) else spent}."
    )


def _duty_parts(life: DutyLife, reliability: float) -> _Parts:
    head = f"Duty cycle, bearing {life.name}".rstrip() + ", Miner's rule over the states"
    if life.hours is None or life.turns is None or life.basic_hours is None or life.basic_turns is None:
        return ["", head, f"  No rating life. {life.why_no_life}"]
    basic = f"basic L_10, mean load P_m {_force(life.mean_load)}"
    lives = {basic: (life.basic_turns, life.basic_hours), "reference L_10r": (life.turns, life.hours)}
    if life.modified_hours is not None and life.modified_turns is not None:
        lives["modified L_nmr"] = life.modified_turns, life.modified_hours
    shares = ", ".join(f"{name} {100.0 * share:.3g} %" for name, share in life.damage.items())
    return ["", head, _lives(lives, reliability), f"  Damage: {shares}."]


def _fit_table(fit: FitSpread, reliability: float) -> ReportTable:
    """Interferences, clearance, life and peak over the spread of the fits."""
    factor, run = RELIABILITY[reliability], "the scene's length" if fit.turns is None else f"{fit.turns:.4g} turns"
    columns: dict[str, Callable[[int], str]] = {
        "": lambda k: ("least", "probable", "mean", "probable", "largest")[k],
        ">clearance\n[µm]": lambda k: f"{1e6 * fit.clearance[k]:.1f}",
    }
    for seat, pressed in ((fit.fit.shaft, fit.fit.inner), (fit.fit.housing, fit.fit.outer)):
        if pressed:  # the largest with the least clearance
            columns[f">{seat}\n[µm]"] = lambda k, pressed=pressed: f"{1e6 * pressed[-1 - k]:.1f}"  # type: ignore[misc]
    if fit.lives:
        columns[">life\n[million turns]"] = lambda k: _life(factor * fit.lives[k], 0.0)[0]
    columns[">peak ball force\n[N]"] = lambda k: f"{fit.peak_forces[k]:.0f}"
    where = ", ".join(filter(None, (fit.name and f"bearing {fit.name}", fit.state and f"state {fit.state}")))
    return ReportTable.of(
        range(len(fit.clearance)),
        columns,
        title="Over the clearance in operation" + (where and f", {where}"),
        caption=f"{run} each. Interferences of shaft and housing by class, the largest with the least clearance; each "
        "column has limits of its own. Probable: within three standard deviations.",
    )


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %"


def _lives(lives: Mapping[str, tuple[float, float]], reliability: float) -> ReportTable:
    """Lives in turns and hours; those of more than 90 % of the bearings are a_1 times as long."""
    factor = RELIABILITY[reliability]
    if factor < 1.0:
        failed = f"L_{100.0 * (1.0 - reliability):.0f}"
        lives = {
            name.replace("L_10", failed).replace("L_n", failed): (factor * turns, factor * spent)
            for name, (turns, spent) in lives.items()
        }
    columns = {"~life": lambda row: row[0], ">million turns": lambda row: row[1][0], ">hours": lambda row: row[1][1]}
    return ReportTable.of([(name, _life(*life)) for name, life in lives.items()], columns)


def _life(turns: float, spent: float) -> tuple[str, str]:
    if math.isinf(turns):
        return "unlimited", "unlimited"
    return rounded(turns / MILLION), f"{spent:.0f}" if 1e4 <= spent < MILLION else rounded(spent)


def _million(turns: float | None) -> str:
    return "" if turns is None else f"{rounded(turns / MILLION)} million turns"


def _force(value: float | None) -> str:
    assert value is not None
    return f"{value:.0f} N" if value < 9999.5 else f"{value / 1e3:.4g} kN"


def _source(bearing: BearingStrength, rating: str, otherwise: str) -> str:
    return "given" if rating in bearing.given else otherwise


def _wear(rate: float) -> str:
    """Depth a second as depth an hour."""
    return f"{rounded(1e6 * 3600.0 * rate, 2)} µm/h"
