"""The report on strength and life of a scene's bearings: as text, HTML, JSON and table."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from typing import TYPE_CHECKING, Any

from ballpass.runtime.ask.life_records import BearingStrength, DutyLife, StateStrength
from ballpass.runtime.contract.extras import need
from ballpass.runtime.contract.json_text import finite
from ballpass.runtime.ratings.life import MILLION
from ballpass.runtime.ratings.wear import COEFFICIENTS
from ballpass.runtime.show import html

if TYPE_CHECKING:
    import pandas

#: Beside the reading that gives the shortest life.
GOVERNS = "  <- governs"

#: A line of a report, or a row of a table: head, two cells, mark.
_Part = str | tuple[str, str, str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class LifeReport:
    """Strength and life of all bearings of a scene; see `ballpass.runtime.Model.life`.

    Attributes
    ----------
    scene, title : of the model
    states : of the duty cycle, one for a scene without
    duty : life of each bearing over the cycle; empty for a scene without

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

    @property
    def bearings(self) -> tuple[BearingStrength, ...]:
        """The bearings in the first state."""
        return self.states[0].bearings

    @property
    def unsettled(self) -> tuple[str, ...]:
        """Sentences about lives that more turns would change."""
        return tuple(
            f"{f'State {state.name}: ' if state.name else ''}{_turns_words(state)} Take more: --cycles."
            for state in self.states
            if not state.settled
        )

    def to_json(self) -> dict[str, Any]:
        """Plain data, SI; what is infinite becomes None.

        Examples
        --------
        >>> sorted(model.life(cycles=4, transient=2).to_json())
        ['duty', 'scene', 'states', 'title', 'wear_coefficients']
        """
        found: dict[str, Any] = finite(asdict(self))
        for state, plain in zip(self.states, found["states"], strict=True):
            for bearing, entry in zip(state.bearings, plain["bearings"], strict=True):
                entry["governing"] = bearing.governing
                entry["hours"] = {name: finite(bearing.hours(life)) for name, life in bearing.lives.items()}
        for life, plain in zip(self.duty, found["duty"], strict=True):
            plain["governing"] = life.governing
        found["wear_coefficients"] = list(COEFFICIENTS)
        return found

    def to_pandas(self) -> pandas.DataFrame:
        """Table indexed by ``state``, ``bearing`` and ``reading``: lives in turns and hours, loads, SI.

        A bearing without rating life has a row of its own, without a reading.

        Raises
        ------
        RequestError
            pandas is not installed.

        Examples
        --------
        >>> table = model.life(cycles=4, transient=2).to_pandas()
        >>> list(table.index.names), list(table.columns[:3])
        (['state', 'bearing', 'reading'], ['life', 'hours', 'governs'])
        """
        rows = [
            {
                "state": state.name,
                "bearing": bearing.name,
                "reading": reading,
                "life": turns,
                "hours": bearing.hours(turns),
                "governs": reading != "" and reading == bearing.governing,
                "peak_force": bearing.peak_force,
                "static_safety": bearing.static_safety,
                "peak_pressure": max(bearing.inner.peak_pressure, bearing.outer.peak_pressure),
            }
            for state in self.states
            for bearing in state.bearings
            for reading, turns in (bearing.lives or {"": math.nan}).items()
        ]
        return need("pandas").DataFrame(rows).set_index(["state", "bearing", "reading"])

    def __str__(self) -> str:
        return "\n".join(line for part in self._parts() for line in _text(part))

    def _repr_html_(self) -> str:
        head, *others = self._parts()
        found = [html.title(str(head))]
        for rows, group in groupby(others, key=lambda part: isinstance(part, tuple)):
            parts = list(group)
            found += [_table(parts)] if rows else [html.paragraph(str(part).strip()) for part in parts if part]
        return html.block(*found)

    def _parts(self) -> list[_Part]:
        """What there is to read, in order."""
        lines: list[_Part] = [f"{self.title}: strength and life of its bearings"]
        for state in self.states:
            if state.name:
                lines += ["", f"State {state.name}, {100.0 * state.share:.3g} % of the time"]
            if not state.bearings:
                lines.append("  nothing turns: no damage")
                continue
            lines.append(f"  {_turns_words(state)}")
            for bearing in state.bearings:
                lines += ["", *_bearing_parts(bearing)]
            lines += ["", f"  Wear and P: means of {state.samples} samples; angles from each ring's x axis."]
        for life in self.duty:
            lines += ["", *_duty_parts(life)]
        return lines

    def __repr__(self) -> str:
        parts = []
        for found in self.duty or self.bearings:
            name = f"{found.name}: " if found.name else ""
            if found.why_no_life:
                parts.append(f"{name}no life")
            elif isinstance(found, DutyLife):
                parts.append(f"{name}{_hours(found.hours[found.governing])} by {found.governing}")
            else:
                parts.append(f"{name}{_million(found.life)} by {found.governing}, s_0 {found.static_safety:.3g}")
        return f"LifeReport({self.scene}: {'; '.join(parts)})"


def _turns_words(state: StateStrength) -> str:
    run = "The run" if state.turns is None else f"{state.turns:.4g} steady turns"
    if state.settled:
        return f"{run}, settled: the second half moved lives and peaks by at most {100.0 * state.change:.2g} %."
    return f"{run}, not settled: the second half moved a life or a peak by {100.0 * state.change:.2g} %."


def _bearing_parts(bearing: BearingStrength) -> list[_Part]:
    rings = (bearing.inner, bearing.outer)
    at = f"{bearing.peak_time:.5g} s"
    if bearing.peak_angle is not None:
        at += f", {math.degrees(bearing.peak_angle):.1f} deg of crank or shaft"
    lines: list[_Part] = [
        f"Bearing {bearing.name}".rstrip() + (" (grooves 0.52 and 0.53, steel: assumed)" if bearing.assumed else ""),
        f"  C_r {_force(bearing.dynamic_rating)} ({_source(bearing, 'dynamic_rating', 'ISO 281')}), "
        f"C_0r {_force(bearing.static_rating)} ({_source(bearing, 'static_rating', 'ISO 76')}), "
        f"C_u {_force(bearing.fatigue_limit)} ({_source(bearing, 'fatigue_limit', 'C_0r/22')})",
        f"  highest ball force {_force(bearing.peak_force)}: ball {bearing.peak_ball}, {at}",
        f"  static safety s_0 {bearing.static_safety:.3g}",
        "",
        _row("", "inner ring", "outer ring"),
        _row("  peak pressure", *(f"{ring.peak_pressure / 1e6:.0f} MPa" for ring in rings)),
        _row("  ellipse, a x b", *(f"{1e3 * ring.major_axis:.3f} x {1e3 * ring.minor_axis:.3f} mm" for ring in rings)),
    ]
    for reading in bearing.lives:
        lines.append(_row(f"  Q_e, {reading}", *(_force(ring.equivalent_loads[reading]) for ring in rings)))
    if bearing.lives:
        lines.append(
            _row("  place of the most damage", *(f"{math.degrees(ring.worst_angle):.0f} deg" for ring in rings))
        )
        shares = (100.0 * sum(ring.damage) for ring in rings)
        lines.append(_row("  share of the damage", *(f"{share:.0f} %" for share in shares)))
    lines.append(_row("  wear, deepest, least k", *(_wear(ring.wear[0]) for ring in rings)))
    lines.append(_row("                 most k", *(_wear(ring.wear[1]) for ring in rings)))
    places = (f"{math.degrees(ring.wear_angle):.0f} deg, {1e3 * ring.wear_across:.2f} mm" for ring in rings)
    lines += [_row("  there: angle, off the middle", *places), ""]
    if bearing.why_no_life:
        return [*lines, f"  No rating life. {bearing.why_no_life}"]
    lines.append(_row("", "million turns", "hours"))
    lines.append(_life_row(bearing, f"  L_10, P = {_force(bearing.equivalent_load)}", bearing.basic_life))
    for reading, life in bearing.lives.items():
        mark = GOVERNS if reading == bearing.governing else ""
        lines.append(_life_row(bearing, f"  L_10r, {reading}", life, mark))
    if bearing.factor is not None:
        words = f"  L_nmr, a_ISO {bearing.factor:.3g}, kappa {bearing.viscosity_ratio:.3g}"
        lines.append(_life_row(bearing, words, bearing.modified_life))
    return lines


def _duty_parts(life: DutyLife) -> list[_Part]:
    lines: list[_Part] = [f"Duty cycle, bearing {life.name}".rstrip() + ", Miner's rule over the states"]
    if life.why_no_life:
        return [*lines, f"  No rating life. {life.why_no_life}"]
    lines.append(_row("", "million turns", "hours"))
    for reading in life.hours:
        mark = GOVERNS if reading == life.governing else ""
        lines.append(_row(f"  L_10r, {reading}", *_life(life.turns[reading], life.hours[reading]), mark))
    if life.modified_hours is not None and life.modified_turns is not None:
        lines.append(_row("  L_nmr", *_life(life.modified_turns, life.modified_hours)))
    shares = ", ".join(f"{name} {100.0 * share:.3g} %" for name, share in life.damage.items())
    return [*lines, f"  Damage: {shares}."]


def _text(part: _Part) -> list[str]:
    """Lines of a terminal of 80 columns."""
    if isinstance(part, tuple):
        head, first, second, mark = part
        return [f"{head:<32}{first:>18}{second:>18}{mark}".rstrip()]
    lead = "  " if part.startswith("  ") else ""
    return textwrap.wrap(part.strip(), 78, initial_indent=lead, subsequent_indent=lead) or [""]


def _table(rows: Sequence[Any]) -> str:
    """Rows as HTML, the first of them heads."""
    heads, *others = rows
    return html.table(heads, others, right=heads[1:3])


def _row(head: str, first: str, second: str, mark: str = "") -> _Part:
    return head, first, second, mark


def _life_row(bearing: BearingStrength, head: str, life: float | None, mark: str = "") -> _Part:
    assert life is not None  # the bearing turns
    return _row(head, *_life(life, bearing.hours(life)), mark)


def _life(turns: float, spent: float) -> tuple[str, str]:
    if math.isinf(turns):
        return "unlimited", "unlimited"
    return f"{turns / MILLION:.4g}", f"{spent:.4g}" if spent < 1e4 else f"{spent:.0f}"


def _million(turns: float | None) -> str:
    return "" if turns is None else f"{turns / MILLION:.4g} million turns"


def _hours(spent: float) -> str:
    return f"{spent:.4g} h"


def _force(value: float) -> str:
    return f"{value:.0f} N" if value < 9999.5 else f"{value / 1e3:.4g} kN"


def _source(bearing: BearingStrength, rating: str, otherwise: str) -> str:
    return "given" if rating in bearing.given else otherwise


def _wear(rate: float) -> str:
    """Depth a second as depth an hour."""
    return f"{1e6 * 3600.0 * rate:.2g} um/h"
