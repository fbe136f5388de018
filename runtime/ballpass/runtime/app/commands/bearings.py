"""``ballpass bearings``: the table of bearings that a scene can name by designation."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from fnmatch import fnmatchcase
from typing import Annotated, Any

from ballpass.runtime.app.commands import options
from ballpass.runtime.app.commands.messages import show_json, show_parts
from ballpass.runtime.app.commands.shared import command
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.options import Option
from ballpass.runtime.ratings import tolerances
from ballpass.runtime.report.report import ReportTable, Words
from ballpass.runtime.report.units import with_units


def bearings(
    pattern: Annotated[
        str, Option(shown="PATTERN", words="Designations wanted: 6204, 63*, 61?/*.", positional=True)
    ] = "*",
    shaft: Annotated[
        str | None, Option(shown="CLASS", words="Class of shafts whose interference to show, as k6.")
    ] = None,
    housing: Annotated[str | None, Option(shown="CLASS", words="Class of housings, likewise, as H7.")] = None,
    json_: options.Json = False,
) -> None:
    """Print the bearings that a scene can name by designation: dimensions, balls, ratings and normal clearance; with
    `--shaft` and `--housing` the interference of fits by class."""
    with command():
        from ballpass.derive.scene.designations import bearing_types

        types = bearing_types()
        for given, allowed in ((shaft, tolerances.SHAFTS), (housing, tolerances.HOUSINGS)):
            if given is not None and given not in allowed:
                raise RequestError(f"No class of the tables of fits is {given!r:.60}. Allowed: {', '.join(allowed)}.")
        found = [_row(kind) for name, kind in types.items() if fnmatchcase(name, pattern)]
        for row in found:
            sizes = {shaft: row["bore"], housing: row["outside_diameter"]}
            row["interference"] = _interferences({name: size for name, size in sizes.items() if name is not None})
        if not found:
            raise RequestError(
                f"No bearing of the table is called {pattern!r:.60}. Allowed: designations and patterns, as 6204, 63*. "
                f"There are {len(types)}, from {next(iter(types))} to {list(types)[-1]}: `ballpass bearings`."
            )
        if json_:
            show_json(with_units({"bearings": found}))
            return
        fits: dict[str, Callable[[dict[str, Any]], Words]] = {
            f">{name}": lambda row, name=name: _ends(row["interference"].get(name))  # type: ignore[misc]
            for name in (shaft, housing)
            if name is not None
        }
        table = ReportTable.of(
            found,
            {
                "bearing": lambda row: row["designation"],
                ">d": lambda row: f"{1e3 * row['bore']:g}",
                ">D": lambda row: f"{1e3 * row['outside_diameter']:g}",
                ">B": lambda row: f"{1e3 * row['width']:g}",
                ">balls": lambda row: str(row["balls"]),
                ">D_w": lambda row: f"{1e3 * row['ball_diameter']:.4g}",
                ">D_pw": lambda row: f"{1e3 * row['pitch_diameter']:.4g}",
                ">C_r": lambda row: f"{1e-3 * row['dynamic_rating']:.3g}",
                ">C_0r": lambda row: f"{1e-3 * row['static_rating']:.3g}",
                ">C_u": lambda row: f"{1e-3 * row['fatigue_limit']:.3g}",
                ">CN": lambda row: "–".join(f"{1e6 * end:.0f}" for end in row["clearance"]["CN"]),
                **fits,
            },
            title="Bearings (mm, kN; clearance in µm)",
            caption="d: bore, D: outside diameter, B: width; D_w: ball diameter, D_pw: pitch diameter.\n"
            "C_r, C_0r: dynamic and static load rating, C_u: fatigue limit; CN: normal clearance, diametral.\n"
            "Balls or rollers, D_w, D_pw: derived from ratings of a catalogue.\n"
            "C_r, C_0r, C_u: from these, by ISO 281 and ISO 76."
            + "\nClasses of fits: interference by ISO 286 with rings of class Normal, ISO 492, µm; play is negative."
            * bool(fits),
        )
        show_parts(table)


def _interferences(sizes: dict[str, float]) -> dict[str, tuple[float, float]]:
    """Least and largest interference by class, of its diameter [m]; none where the tables of fits have not that one."""
    found = {}
    for name, diameter in sizes.items():
        with suppress(ValueError):
            spread = tolerances.seat_interference(name, diameter)
            found[name] = spread.least, spread.largest
    return found


def _ends(ends: tuple[float, float] | None) -> str:
    return "" if ends is None else " to ".join(f"{1e6 * end:.3g}" for end in ends)


def _row(kind: Any) -> dict[str, Any]:
    """A bearing in SI."""
    from ballpass.derive.scene.designations import GROUPS
    from ballpass.runtime.ratings.elements import RATED, ElementGeometry

    ball, pitch = float(kind.ball_diameter) / 1e3, float(kind.pitch_diameter) / 1e3
    length = {} if kind.length is None else {"length": float(kind.length) / 1e3}
    element = RATED[kind.element]
    geometry = ElementGeometry(balls=kind.balls, diameter=ball, pitch=pitch, contact=length)
    static = element.static_rating(geometry)
    groups = {group: kind.clearance(group) for group in GROUPS}
    return {
        "designation": kind.designation,
        "bore": float(kind.bore) / 1e3,
        "outside_diameter": float(kind.outside) / 1e3,
        "width": float(kind.width) / 1e3,
        "element": kind.element,
        "balls": kind.balls,
        "ball_diameter": ball,
        "pitch_diameter": pitch,
        **length,
        "dynamic_rating": element.dynamic_rating(geometry),
        "static_rating": static,
        "fatigue_limit": element.fatigue_limit(static, pitch),
        "clearance": {group: [end / 1e6 for end in span] for group, span in groups.items() if span is not None},
        "catalogues": {
            rating.maker: {"dynamic": rating.dynamic, "static": rating.static}
            | ({"fatigue_limit": rating.limit} if rating.limit is not None else {})
            for rating in kind.catalogues
        },
    }
