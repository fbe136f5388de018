"""``ballpass select``: which bearings of the tables last long enough in a scene, the smallest first.

In: a scene, what is asked of one of its bearings.  Out: a row for each bearing of the tables: life, static safety,
highest force, and what it lacks.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from ballpass.runtime.contract.errors import BallpassError, RequestError
from ballpass.runtime.contract.options import Cycles, Option, Rtol, Transient
from ballpass.runtime.questions import option_names
from ballpass.runtime.questions.question import AnyModel, Question
from ballpass.runtime.ratings.of_bearing import why_no_life
from ballpass.runtime.report.numbers import rounded
from ballpass.runtime.report.report import Report, ReportTable
from ballpass.runtime.report.reported import Reported
from ballpass.runtime.show.progress import Progress, shown
from ballpass.runtime.time.timeline import shaft_speed

if TYPE_CHECKING:
    from ballpass.derive.scene.designations import BearingType
    from ballpass.runtime.contract.manifest import BearingInfo
    from ballpass.runtime.life.text import LifeReport

Of = Annotated[
    Sequence[str] | None,
    Option(
        words="Further quantity of a run with each bearing, as `rms:inner.y`. May be repeated.",
        shown="Q",
        names=option_names.quantities,
    ),
]
Designations = Annotated[
    Sequence[str] | None,
    Option(
        words="Designations and patterns to choose from, as `62*,NU204`. May be repeated. Default: all of the tables.",
        shown="PATTERN",
        flags=("--designation",),
    ),
]
Bore = Annotated[
    str | None,
    Option(words="Bores to choose from.", example='"20 mm:30 mm"', shown="A:B"),
]
Life = Annotated[
    float | None,
    Option(
        words="Time that 90 % of the bearings must reach: by L_nmr where the scene says oil and dirt, else by L_10r.",
        example='"20000 h"',
        shown="TIME",
        unit="s",
        above=0.0,
    ),
]
Safety = Annotated[float, Option(words="Static safety s_0 that the bearing must have.", shown="S", least=0.0)]
At = Annotated[str | None, Option(words="Name of the bearing to choose, of several.", shown="NAME")]

#: Keys of a bearing, and of its contact, that a designation gives.
SIZES = ("element", "balls", "ball_diameter", "pitch_diameter", "dynamic_rating", "static_rating", "fatigue_limit")
GROOVES = ("inner_groove_radius", "outer_groove_radius", "length", "stiffness")


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A bearing of the tables in the place of the scene's.

    Attributes
    ----------
    designation, bore, outside_diameter, width : of the bearing [m]
    of : further quantities, by name [SI]
    hours : of the modified life where the scene says oil and dirt, else of the reference life; NaN where there is none
    static_safety, peak_force : s_0 [1], highest force on an element [N]
    lacks : what it has not of what is asked for, or why it was not computed; empty where it has all
    """

    designation: str
    bore: float
    outside_diameter: float
    width: float
    hours: float = math.nan
    static_safety: float = math.nan
    peak_force: float = math.nan
    lacks: str = ""
    of: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Selection(Reported):
    """Bearings of the tables in a scene.

    Attributes
    ----------
    title : of the scene
    candidates : by bore, then by the room that they take
    """

    title: str
    candidates: tuple[Candidate, ...]

    @property
    def chosen(self) -> tuple[Candidate, ...]:
        """Those that lack nothing."""
        return tuple(one for one in self.candidates if not one.lacks)

    def _report(self) -> Report:
        def cell(value: float) -> str:
            return "" if math.isnan(value) else rounded(value, 3)

        columns: dict[str, Callable[[Candidate], str]] = {
            "bearing": lambda one: one.designation,
            ">d": lambda one: f"{1e3 * one.bore:g}",
            ">D": lambda one: f"{1e3 * one.outside_diameter:g}",
            ">B": lambda one: f"{1e3 * one.width:g}",
            ">life [h]": lambda one: cell(one.hours),
            ">s_0": lambda one: cell(one.static_safety),
            ">peak force [N]": lambda one: cell(one.peak_force),
        }
        for name in dict.fromkeys(name for one in self.candidates for name in one.of if f">{name}" not in columns):
            columns[f">{name}"] = lambda one, name=name: rounded(one.of[name]) if name in one.of else ""  # type: ignore[misc]
        columns["~lacks"] = lambda one: one.lacks
        first = min(self.chosen, key=_room, default=None)
        words = "No bearing of these has all that is asked for."
        if first is not None:
            words = f"{len(self.chosen)} of {len(self.candidates)} have all that is asked for. "
            words += f"{first.designation} takes least room."
        return Report(
            title=f"{self.title}: bearings of the tables",
            parts=(
                ReportTable.of(
                    self.candidates,
                    columns,
                    caption="d, D, B in mm. Each bearing was run in the scene with the clearance of its group, and all "
                    "else as the scene has it, also the masses of rings.",
                ),
                words,
            ),
            facts={"title": self.title, "candidates": [asdict(one) for one in self.candidates]},
            records=[asdict(one) for one in self.candidates],
            index=("designation",),
        )


@Question(stage="choosing", requires="bearings")
def select(
    model: AnyModel,
    *,
    scene: Path,
    life: Life = None,
    static_safety: Safety = 1.0,
    bore: Bore = None,
    designations: Designations = None,
    of: Of = None,
    bearing: At = None,
    cycles: Cycles = None,
    transient: Transient = None,
    rtol: Rtol = None,
    parameters: Mapping[str, float],
    progress: Progress = None,
) -> Selection:
    """Find the bearings of the tables that last in a scene: run it with each of them.

    Parameters
    ----------
    scene : its file
    parameters : overrides, SI
    progress : gets the part that is done

    Raises
    ------
    RequestError
        A life is wanted where the bearing does not turn, no bearing of the scene has the name, no bearing of the tables
        the bore or the designation, or a number of the bearing that a designation gives is overridden.
    """
    from ballpass.derive import SceneError, generate, read_scene
    from ballpass.runtime.model import load_own

    if scene.is_dir():
        raise RequestError(f"{scene} is a folder. Allowed: the scene file, whose bearing is replaced by others.")
    info = _place(model.manifest.bearings, bearing or "")
    kinds = list(_kinds(designations, bore))
    given = {*SIZES, *GROOVES, "clearance"}
    refused = [one for one in parameters if one.startswith(f"{info.path}.") and one.rpartition(".")[2] in given]
    if refused:
        raise RequestError(
            f"--set {', '.join(refused)}: bearings of the tables have their own. Allowed: numbers that no designation "
            "gives, and a group of clearance in the scene."
        )
    values = model.numbers(parameters).values
    if life is not None and not model.manifest.duty:  # whose states may turn
        _refuse_without_life(why_no_life(info, values, shaft_speed(model.manifest, values)))
    found = []
    with shown("choosing", progress) as tell:
        for done, kind in enumerate(kinds):
            if tell is not None:
                tell(done / len(kinds))
            with_it = Candidate(
                designation=kind.designation,
                bore=float(kind.bore) / 1e3,
                outside_diameter=float(kind.outside) / 1e3,
                width=float(kind.width) / 1e3,
            )
            try:
                changed = read_scene(scene, changes=_changes(info, kind), name=f"{model.manifest.scene}_candidate")
                other = load_own(generate(changed))
                report = other.life(cycles, transient=transient, parameters=parameters, rtol=rtol)
                asked = (
                    other.quantities(of, cycles, transient=transient, parameters=parameters, rtol=rtol) if of else {}
                )
            except SceneError as fault:
                found.append(replace(with_it, lacks=fault.faults[0].problem))
            except BallpassError as fault:  # of this bearing: options were refused before
                found.append(replace(with_it, lacks=str(fault).partition(". ")[0]))
            else:
                with_it = replace(with_it, of={name: one.value for name, one in asked.items()})
                found.append(_judged(with_it, report, info.name, life, static_safety))
    return Selection(
        title=model.manifest.title, candidates=tuple(sorted(found, key=lambda one: (one.bore, _room(one))))
    )


def _refuse_without_life(why: str) -> None:
    if why:
        raise RequestError(f"{why.partition(':')[0]}. Allowed: a bearing that turns, or static safety without --life.")


def _room(one: Candidate) -> float:
    return one.outside_diameter**2 * one.width


def _judged(candidate: Candidate, report: LifeReport, name: str, life: float | None, safety: float) -> Candidate:
    """What a bearing has, over a duty cycle and in its worst state, and lacks."""
    states = [one for state in report.states for one in state.bearings if one.name == name]
    why = [one.why_no_life for one in states if one.why_no_life]
    if not states or (life is not None and len(why) == len(states)):  # of the motion, so with each bearing
        _refuse_without_life(why[0] if why else "Nothing turns in any state")
    reached = states[0].reached
    lives = [one.modified_hours or one.hours for one in report.duty if one.name == name]
    (hours,) = lives or [None if reached is None else states[0].hours(reached)]
    least = min(one.static_safety for one in states)
    lacks = []
    if life is not None and (hours is None or hours < life / 3600.0):
        lacks.append(f"life: {rounded(hours or 0.0, 3)} of {rounded(life / 3600.0, 3)} h")
    if least < safety:
        lacks.append(f"s_0: {rounded(least, 3)} of {rounded(safety, 3)}")
    return replace(
        candidate,
        hours=math.nan if hours is None else hours,
        static_safety=least,
        peak_force=max(max(one.peak_force, one.combined.peak_force if one.combined else 0.0) for one in states),
        lacks="; ".join(lacks),
    )


def _place(bearings: Sequence[BearingInfo], name: str) -> BearingInfo:
    """The bearing that is replaced."""
    names = [one.name for one in bearings]
    if name in names:
        return bearings[names.index(name)]
    if not name:
        raise RequestError(f"The scene has several bearings. Allowed: --bearing with one of {', '.join(names)}.")
    raise RequestError(f"--bearing {name!r:.60}: the scene has no such bearing. Allowed: {', '.join(names) or 'none'}.")


def _kinds(patterns: Sequence[str] | None, bore: str | None) -> Iterator[BearingType]:
    """Bearings of the tables with a designation and a bore that are asked for."""
    from ballpass.derive.scene.designations import bearing_types
    from ballpass.runtime.app.commands.load_scene import read_value

    ends = [read_value("--bore", end, "m") for end in bore.split(":")] if bore else [0.0, math.inf]
    wanted = [one.strip() for text in patterns or ("*",) for one in text.split(",")]
    found = [
        kind
        for name, kind in bearing_types().items()
        if any(fnmatchcase(name, one) for one in wanted) and ends[0] <= float(kind.bore) / 1e3 * (1 + 1e-9)
        if float(kind.bore) / 1e3 <= ends[-1] * (1 + 1e-9)
    ]
    if not found:
        raise RequestError(
            f"No bearing of the tables is called {', '.join(wanted):.60}{f' with a bore of {bore}' if bore else ''}. "
            "Allowed: designations, patterns and bores of `ballpass bearings`."
        )
    yield from found


def _changes(info: BearingInfo, kind: BearingType) -> dict[str, Any]:
    """Changes of a scene that put a bearing of the tables in the place of one of its own."""
    said = "" if info.catalogue is None else info.catalogue.clearance_group
    said = said if said and kind.clearance(said) else "CN"
    bearing: dict[str, Any] = dict.fromkeys(SIZES)
    bearing |= {"designation": kind.designation, "clearance": said, "contact": dict.fromkeys(GROOVES)}
    return {"bearings": {info.name: bearing}} if info.name else {"bearing": bearing}
