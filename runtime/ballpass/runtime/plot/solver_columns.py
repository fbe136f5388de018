"""Where a page with the solver in it finds what it draws: columns of a sample, places of numbers, signs.

In: the manifest and the plain numbers of `animation.to_plain`, which name what is drawn.  Out: plain numbers for JSON.

A row of ``ballpass_rows`` has the columns of `columns_of`, then points, cage angles and inputs.
Numbers are named by their place among parameters and, behind these, derived constants.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ballpass.runtime.contract.manifest import BearingInfo, Manifest, UsualInfo, force_components, table_direction
from ballpass.runtime.contract.plausible_ranges import usual_template
from ballpass.runtime.contract.status import Status
from ballpass.runtime.export.scene_numbers import columns_of, speed_table
from ballpass.runtime.export.web_assembly import drawn_columns
from ballpass.runtime.native.reduction_rows import DEFLECTION, HEAD, SECTORS, TURNED, ReductionRows, reduction_rows
from ballpass.runtime.plot.animation import shown_points
from ballpass.runtime.plot.record import FRAME, Record
from ballpass.runtime.ratings.of_bearing import inner_ring_mass, rated_element
from ballpass.runtime.ratings.result_limits import FLATTENED, MOST_DEFLECTION, limit_templates
from ballpass.runtime.time.timeline import speed_name


def solver_columns(record: Record, numbers: Mapping[str, Any]) -> dict[str, Any]:
    """What the page's script needs to make `numbers` of another run, and how long that run is."""
    manifest = record.manifest
    names = [name for name, _ in columns_of(manifest)]
    known = [*(info.name for info in manifest.parameters), *(info.name for info in manifest.constants)]
    place = {name: k for k, name in enumerate(known)}
    column = {name: k for k, name in enumerate(names)}
    run, mechanism = manifest.run, manifest.mechanism
    speed = speed_name(manifest)
    drawn = [info for one in numbers["bearings"] for info in manifest.bearings if info.name == one["name"]]
    return {
        "columns": names,
        "units": [unit for _, unit in columns_of(manifest)],
        "drawn": drawn_columns(manifest),
        "places": len(place),
        "run": {
            "cycles": run.cycles,
            "duration": run.duration,
            "transient": run.transient_cycles,
            "samples": run.samples_per_cycle,
        },
        "speed": None if speed is None else place[speed],
        "start": None if mechanism is None else place[mechanism.start_angle],
        "shown": record.cycle_turns,
        "rows": [[place[name] for name in names] for names in speed_table(manifest)[::-1] if names] or None,
        "angle": column[mechanism.angle] if mechanism is not None and mechanism.angle else None,
        "windows": [[place[start], place[end]] for start, end in record.load_window_edges()],
        "torque": column.get("drive_torque"),
        "linkage": None if mechanism is None else _linkage(record, numbers["linkage"]["forces"], place, column),
        "bearings": [_bearing(record, info, place, column) for info in drawn],
        "reduction": {"size": reduction_rows(manifest).size} | {name: HEAD.index(name) for name in HEAD},
        "usual": [_usual(manifest, info, place) for info in manifest.usual],
        "limits": {"void": Status.VOID.value, "flattened": FLATTENED, "deflected": MOST_DEFLECTION},
    }


def _usual(manifest: Manifest, info: UsualInfo, place: Mapping[str, int]) -> dict[str, Any]:
    """A range that numbers usually lie in, and the sentence where they do not."""
    return {
        "at": [place[name] for name in info.names],
        "of": place[info.of] if info.of else None,
        "each": info.each,
        "least": info.least,
        "most": info.most,
        "words": "".join(usual_template(manifest, info)),
    }


def _linkage(
    record: Record, forces: list[dict[str, Any]], place: Mapping[str, int], column: Mapping[str, int]
) -> dict[str, Any]:
    mechanism = record.mechanism
    shown = shown_points(mechanism)
    every = [(info.body, info.point) for info in mechanism.points]
    sources: dict[str, dict[str, Any]] = {}
    for name, _, _, _, second, _ in mechanism.joints:
        if f"reaction.{name}.x" in column:
            sign = -1 if second == FRAME else 1
            columns = [column[f"reaction.{name}.{axis}"] for axis in "xy"]
            sources[f"reaction.{name}"] = {"columns": columns, "sign": sign}
    for name, _, _, given in mechanism.forces:
        sources[f"force.{name}"] = _applied(record, name, given, place)
    for label, *ends in mechanism.springs:
        known = next((name for name in (f"{label}.tension", f"{label}.force") if name in column), None)
        if known is not None:
            points = [shown.index((ends[0], ends[1])), shown.index((ends[2], ends[3]))]
            for key, way in ((ends[0], points), (ends[2], points[::-1])):
                sign = 1 if known.endswith("tension") else -1
                sources[f"{label}.{key}"] = {"tension": column[known], "sign": sign, "between": way}
    return {"points": [every.index(key) for key in shown], "forces": [sources[force["name"]] for force in forces]}


def _applied(record: Record, name: str, given: str, place: Mapping[str, int]) -> dict[str, Any]:
    """As `Record.applied_forces`: components, and what says whether or how much it acts."""
    manifest = record.manifest
    cartesian, polar = force_components(name)
    found: dict[str, Any] = {}
    if cartesian[0] in place:
        found["cartesian"] = [place[component] for component in cartesian]
    elif polar[0] in place:
        found["polar"] = [place[component] for component in polar]
    else:
        found["direction"] = place[table_direction(name)]
    inputs = [item.name for item in manifest.inputs]
    if given in inputs:
        found["input"] = inputs.index(given)
    elif given:  # the driver's angle is a state
        borders = [item.windows[0] for item in manifest.inputs if item.name.startswith(f"border.{name}.")]
        window = f"mechanism.forces.{name}.window"
        if borders:
            found["borders"] = [[place[start], place[end]] for start, end in borders]
        elif f"{window}.rise" in place:
            found["rise"] = [place[f"{window}.{key}"] for key in ("start", "end", "rise")]
        else:
            columns = [f"mechanism.forces.{name}.table.{column}" for column in ("angle", "force")]
            found["table"] = [[k for known, k in place.items() if known.startswith(one)] for one in columns]
            found["turns"] = dict(record.mechanism.turns).get(f"force.{name}", 1)
    return found


def _bearing(
    record: Record, bearing: BearingInfo, place: Mapping[str, int], column: Mapping[str, int]
) -> dict[str, Any]:
    def pair(name: str) -> list[int] | None:
        both = [f"{name}.{axis}" for axis in "xy"]
        return [column[one] for one in both] if all(one in column for one in both) else None

    def own(name: str) -> str:
        return f"{bearing.prefix}{name}"

    force = own("ball.force") if own("ball.force[1]") in column else own("ball.elastic_force")
    rows = reduction_rows(record.manifest)
    load: dict[str, Any] | None = None
    if pair(own("load")) is not None:
        load = {"columns": pair(own("load")), "sign": 1, "share": None, "count": None}
    elif record.loaded_by_joint and bearing.outer_ring and inner_ring_mass(bearing, place) is None:
        load = {"columns": None} if force.endswith("ball.force") else None
    elif record.loaded_by_joint and pair(f"reaction.{bearing.joint}") is not None:
        first = next(item[2] for item in record.mechanism.joints if item[0] == bearing.joint)
        load = {
            "columns": pair(f"reaction.{bearing.joint}"),
            "sign": -1 if first == bearing.inner_body else 1,
            "share": place.get(f"{bearing.path}.share"),
            "count": place.get(f"{bearing.path}.count"),
        }
    return {
        "cage": record.manifest.bearings.index(bearing),
        "pitch": place[f"{bearing.path}.pitch_diameter"],
        "ball": place[f"{bearing.path}.ball_diameter"],
        "clearance": place[f"{bearing.path}.clearance"],
        "force": [column[f"{force}[{k + 1}]"] for k in range(bearing.balls)],
        "top": {kind: rows.columns[kind, force] for kind in ("max_wanted", "max", "max_time")},
        "deflection": {kind: rows.columns[kind, own(DEFLECTION)] for kind in ("max_wanted", "max")},
        "cosine": place.get(f"{bearing.path}.cos_contact_angle"),
        "gap": place.get(f"{bearing.path}.radial_gap"),
        "limits": limit_templates(bearing),
        "inner": pair(bearing.inner_state("x").removesuffix(".x")),
        "outer": pair(own("outer")),
        "load": load,
        "life": _life(rows, bearing) if force.endswith("ball.force") else None,
    }


def _life(rows: ReductionRows, bearing: BearingInfo) -> dict[str, float] | None:
    """How a life depends on the loads, see `ballpass.runtime.ratings.life.ElementLife`, and where they are reduced."""
    if rated_element(bearing).unrated:
        return None
    of, turned = rated_element(bearing).life, bearing.prefix + TURNED
    return {
        "wanted": rows.columns["integral_wanted", turned],
        "turned": rows.columns["integral", turned],
        "raceways": rows.first_place(bearing.prefix),
        "standing": float(of.standing),
        "weibull": float(of.weibull),
        "sectors": SECTORS,
    }
