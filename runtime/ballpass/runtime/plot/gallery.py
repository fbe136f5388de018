"""List of all figures with their conditions; write them.

In: a model and its `Solution`.  Out: files, the same bytes for the same run.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.plot import CAPTIONS, loads, moment, motion, shaft
from ballpass.runtime.plot.record import Record, gather
from ballpass.runtime.plot.style import write_figures

if TYPE_CHECKING:
    from ballpass.runtime.point.point_model import PointModel
    from ballpass.runtime.solution.solution import Solution


@dataclass(frozen=True, slots=True)
class FigureKind:
    """A figure: name of its file, whether a record has its data, how it is drawn, its description.

    `whole` says whether it is of all bearings.
    """

    name: str
    possible: Callable[[Record], bool]
    draw: Callable[[Record], Figure]
    description: str
    whole: bool = False


def _has_load_curve(record: Record) -> bool:
    if record.manifest.mechanism is None or not record.turns:
        return False
    return record.ring_load() is not None or bool(loads.reaction_joints(record))


def _has_orbit(record: Record) -> bool:
    return record.has("inner.x", "inner.y")


def _has_spectra(record: Record) -> bool:
    return _has_orbit(record) and (record.cycle_length is None or bool(record.turns))


def _has_phases(record: Record) -> bool:
    return record.has("inner.x", "inner.vx")


def _has_balls(record: Record) -> bool:
    return record.has_ball_force


def _has_moment(record: Record) -> bool:
    return record.manifest.mechanism is not None or record.can_draw_bearing


FIGURES = (
    FigureKind("load_curve", _has_load_curve, loads.load_curve, "reaction and load on the ring over an angle (Fig. 4)"),
    FigureKind("orbit", _has_orbit, motion.orbit, "path of the inner ring's centre (Fig. 5)"),
    FigureKind("displacements", _has_orbit, motion.displacements, "positions of the ring's centre over angle or time"),
    FigureKind("spectra", _has_spectra, motion.spectra, "displacement amplitude spectra along x and y (Fig. 6)"),
    FigureKind("phase_portrait", _has_phases, motion.phase_portrait, "velocity over displacement along x (Fig. 7)"),
    FigureKind("ball_loads", _has_balls, loads.ball_loads, "contact load of every ball over two turns (Fig. 8)"),
    FigureKind("peak_moment", _has_moment, moment.peak_moment, "mechanism and bearing at the highest ball force"),
    FigureKind("shaft_loads", shaft.has_shaft, shaft.shaft_loads, "forces on the shaft along its axis", whole=True),
)


def draw(name: str, model: PointModel, solution: Solution) -> Figure:
    """One figure by name, as a matplotlib figure.

    Raises
    ------
    RequestError
        There is no such figure, or the run lacks the outputs or the whole turn it needs.

    Examples
    --------
    >>> figure = draw("orbit", model, model.simulate(cycles=3))  # of matplotlib
    """
    kinds = {kind.name: kind for kind in FIGURES}
    if name not in kinds:
        raise RequestError(f"figure {name!r} does not exist; allowed: {', '.join(kinds)}")
    kind, record = kinds[name], gather(model, solution)
    if not kind.possible(record):
        raise RequestError(
            f"figure {name!r} ({kind.description}) cannot be drawn of this run: it lacks the outputs or a whole steady "
            f"turn; its outputs are {', '.join(info.name for info in record.manifest.outputs)}; "
            "ask for more in run.outputs of the scene, or for more cycles"
        )
    return kind.draw(record)


def draw_all(
    model: PointModel,
    solution: Solution,
    folder: Path,
    formats: Sequence[str] = ("png",),
    longer: Solution | None = None,
) -> list[Path]:
    """Write every figure for which the outputs exist into `folder`, and their captions into ``figures.md``.

    Left out are figures whose outputs were not asked for, and, for a steady part shorter than a turn, load curve and
    spectra.  Of several bearings each has its figures, with its name in theirs.

    Parameters
    ----------
    formats : kinds of files, of png, svg and pdf
    longer : a run of more turns, for spectra and stroboscopic points

    Returns
    -------
    files written, in the order of `FIGURES`; the captions last

    Examples
    --------
    >>> solution = model.simulate(cycles=3, outputs=["inner.x", "inner.y"])
    >>> written = draw_all(model, solution, Path("figures"))
    >>> written[-1].name
    'figures.md'
    """

    def figures() -> Iterator[tuple[str, Figure]]:
        for bearing in model.manifest.bearings or (None,):
            record = gather(model, solution, bearing, longer)
            ending = f"_{bearing.name}" if bearing is not None and bearing.name else ""
            for kind in (kind for kind in FIGURES if kind.possible(record)):
                yield kind.name + ending * (not kind.whole), kind.draw(record)

    folder.mkdir(parents=True, exist_ok=True)
    return write_figures(figures(), folder, formats, CAPTIONS)
