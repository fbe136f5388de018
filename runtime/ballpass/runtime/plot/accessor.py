"""``solution.plot``: a run drawn on matplotlib's axes, one's own or new ones, for notebooks and scripts.

In: a solution.  Out: the axes that were drawn on.  Figures with titles and captions are those of `gallery`.
"""

from __future__ import annotations

from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.extras import need
from ballpass.runtime.contract.units import table_unit
from ballpass.runtime.plot.animate import animation_page, write_animation
from ballpass.runtime.ratings.of_bearing import bearing_words
from ballpass.runtime.show import html
from ballpass.runtime.vibration.spectrum import Window, amplitude_spectrum

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes

    from ballpass.runtime.plot.record import Record
    from ballpass.runtime.point.point_model import PointModel
    from ballpass.runtime.solution.solution import Solution

#: Most lines of a legend, and names on an axis.
_LEGEND, _NAMED = 12, 3


class SolutionPlot:
    """Draws a solution: ``solution.plot.orbit()``; call it for time series, ``solution.plot("inner.x")``.

    What is drawn is the steady part of the run.  Each method takes ``ax``, matplotlib axes to draw on, and returns
    them; without, it draws on new axes.  Of several bearings ``bearing`` names one; the default is the first.

    Examples
    --------
    >>> solution = model.simulate(cycles=3, transient=1)
    >>> axes = solution.plot("inner.y")
    >>> axes.get_xlabel()
    'time [s]'
    """

    def __init__(self, solution: Solution) -> None:
        self._solution = solution

    def __repr__(self) -> str:
        return "solution.plot: orbit, spectrum, ball_loads, outputs, animate"

    def __call__(self, *names: str, ax: Axes | None = None) -> Axes:
        """As `outputs`."""
        return self.outputs(*names, ax=ax)

    def outputs(self, *names: str, ax: Axes | None = None) -> Axes:
        """Outputs and states over time, all of one unit; displacements in µm, their rates in mm/s.

        Parameters
        ----------
        names : default: the displacements of the inner ring, or the first output where there is no bearing

        Raises
        ------
        RequestError
            An unknown name, or names of different units.

        Examples
        --------
        >>> axes = model.simulate(cycles=3).plot.outputs("inner.y", "outer.y")
        >>> axes.get_xlabel()
        'time [s]'
        """
        steady = self._solution.steady()
        chosen = names or self._displacements() or tuple(steady.outputs)[:1]
        units = dict.fromkeys(self._unit(name) for name in chosen)
        if len(units) != 1:
            raise RequestError(
                f"plot: the units of {', '.join(chosen) or 'no output'} are {', '.join(units) or 'none'}. Allowed: "
                "outputs of one unit. Draw others on axes of their own."
            )
        (unit,) = units
        factor, shown = _read_in(unit)
        with _axes(ax) as axes:
            for name in chosen:
                lines = axes.plot(steady.t, factor * steady[name], linewidth=1.0)
                count = len(lines)
                noun = bearing_words("ball", steady.manifest.bearings, name)
                for number, line in enumerate(lines, start=1):
                    line.set_label(name if count == 1 else f"{name}, {noun} {number}")
            axes.set_xlabel("time [s]")
            axes.set_ylabel(f"{', '.join(chosen) if len(chosen) <= _NAMED else 'outputs'} [{shown}]")
            if 1 < len(axes.get_lines()) <= _LEGEND:
                axes.legend(fontsize="small")
        return axes

    def orbit(self, *, relative: bool = False, bearing: str | None = None, ax: Axes | None = None) -> Axes:
        """Path of the inner ring's centre: the last turn dark, the steady turns before it light.

        Parameters
        ----------
        relative : to an elastic outer ring, which loads the balls; a circle shows the radial gap

        Raises
        ------
        RequestError
            The run has no displacements of the rings.

        Examples
        --------
        >>> axes = model.simulate(cycles=3, transient=1).plot.orbit()  # of matplotlib
        """
        need("matplotlib")
        from ballpass.runtime.plot.motion import draw_orbit

        rings = ("inner", "outer") if relative else ("inner",)
        record = self._record(bearing, *(f"{ring}.{axis}" for ring in rings for axis in "xy"))
        with _axes(ax) as axes:
            draw_orbit(axes, record, relative=relative)
        return axes

    def spectrum(self, name: str | None = None, *, window: Window = "hann", ax: Axes | None = None) -> Axes:
        """Amplitude spectrum of an output or state, whole turns of the steady part, on a logarithmic scale.

        Parameters
        ----------
        name : default: the displacement of the inner ring along x
        window : see `ballpass.runtime.vibration.spectrum`

        Raises
        ------
        RequestError
            An unknown name, an output of each ball, or samples at unequal steps.

        Examples
        --------
        >>> axes = model.simulate(cycles=3, transient=1).plot.spectrum("inner.y")
        >>> axes.get_xlabel()
        'frequency [Hz]'
        """
        steady = self._solution.steady()
        chosen = name or next(iter(self._displacements()), None)
        if chosen is None or steady[chosen].ndim > 1:
            raise RequestError(
                f"plot.spectrum: {chosen or 'no name'} was given. Allowed: an output or state with one value at a "
                "time: solution.plot.spectrum('drive_torque')."
            )
        factor, shown = _read_in(self._unit(chosen))
        from ballpass.runtime.plot.motion import shown_range

        found = amplitude_spectrum(steady.t, factor * steady[chosen], cycle_length=steady.period, window=window)
        with _axes(ax) as axes:
            axes.semilogy(found.frequency[1:], found.amplitude[1:], linewidth=1.0, label=chosen)
            axes.set_xlim(0.0, shown_range([found], shaft=0.0 if steady.period is None else 1.0 / steady.period))
            axes.set_xlabel("frequency [Hz]")
            axes.set_ylabel(f"amplitude of {chosen} [{shown}]")
        return axes

    def ball_loads(self, *, turns: int = 2, bearing: str | None = None, ax: Axes | None = None) -> Axes:
        """Contact load of every ball over the last turns, a strip for each ball, all at one scale.

        Parameters
        ----------
        turns : how many; the whole record where nothing turns

        Raises
        ------
        RequestError
            The run has no forces of the balls.

        Examples
        --------
        >>> axes = model.simulate(cycles=3, transient=1).plot.ball_loads()
        """
        record = self._record(bearing)
        if not (record.has("ball.force") or record.has("ball.elastic_force")):
            raise RequestError(_lacks("ball.force or ball.elastic_force"))
        window = record.last_turns(turns)
        force = record.ball_force()[1][window]
        along, label = record.along(window)
        top = max(float(np.max(force)), 1e-12)
        balls = force.shape[1]
        with _axes(ax) as axes:
            for ball in range(balls):
                foot = balls - ball  # ball 1 above
                height = foot + 0.9 * force[:, ball] / top
                axes.fill_between(along, foot, height, linewidth=0.0, alpha=0.35, color="C0")
                axes.plot(along, height, linewidth=0.8, linestyle="-", color="C0")
            axes.set_yticks(range(balls, 0, -1), [f"{record.noun} {ball}" for ball in range(1, balls + 1)])
            axes.set_xlim(float(along.min()), float(along.max()))
            axes.set_xlabel(label)
            axes.set_ylabel(f"contact load, highest {top:.4g} N")
        return axes

    def animate(self, *, turns: float = 1.0, bearing: str | None = None) -> Animation:
        """The last turns in motion: linkage, bearings, forces and signals, with a slider; see `Animation`.

        Parameters
        ----------
        turns : of driver or shaft; where nothing turns, the whole run is shown
        bearing : the one that a movie shows and a page opens with; default: the first

        Raises
        ------
        RequestError
            The steady part is shorter, there is nothing to draw, an unknown bearing, or the solution was read from a
            file, without the model that places links.

        Examples
        --------
        >>> moving = model.simulate(cycles=3, transient=1).plot.animate(turns=0.1)
        """
        if self._solution.model is None:
            raise RequestError(
                "plot.animate: this solution was read from a file or sent by another process, without its model. Give "
                "it back: dataclasses.replace(solution, model=ballpass.runtime.load(folder)).plot.animate()."
            )
        return Animation(cast("PointModel", self._solution.model), self._solution, turns, bearing)

    def _record(self, bearing: str | None, *names: str) -> Record:
        """Data of the run for figures of the bearing that these outputs belong to."""
        from ballpass.runtime.plot.record import bearing_named, gather

        named = None if bearing is None else bearing_named(self._solution.manifest, bearing)
        model = cast("PointModel", self._solution.model)  # figures of samples alone do not need it
        record = gather(model, self._solution, named)
        if not record.has(*names):
            raise RequestError(_lacks(", ".join(names)))
        return record

    def _displacements(self) -> tuple[str, ...]:
        names = [f"{bearing.prefix}inner.{axis}" for bearing in self._solution.manifest.bearings[:1] for axis in "xy"]
        return tuple(name for name in names if name in self._solution)

    def _unit(self, name: str) -> str:
        self._solution[name]  # for its error
        infos = (*self._solution.manifest.outputs, *self._solution.manifest.states)
        return next(info.unit for info in infos if info.name == name)


class Animation:
    """A run in motion.  A notebook shows the page that `save` writes, with its slider, in a frame of its own.

    Examples
    --------
    >>> model.simulate(cycles=3, transient=1).plot.animate(turns=0.1)
    Animation(punching_press, 0.1 turns; save(path) writes it)
    """

    def __init__(self, model: PointModel, solution: Solution, turns: float, bearing: str | None = None) -> None:
        self._run, self._turns, self._bearing = (model, solution), turns, bearing
        self._page = animation_page(model, solution, turns=turns, bearing=bearing)

    def __repr__(self) -> str:
        return f"Animation({self._run[1].manifest.scene}, {self._turns:g} turns; save(path) writes it)"

    def _repr_html_(self) -> str:
        return html.framed_page(self._page)

    def save(self, path: str | Path, *, pictures: int | None = None) -> Path:
        """Write a page, ``.html``, or a movie of so many pictures, ``.gif`` or ``.mp4``; see `write_animation`.

        Examples
        --------
        >>> moving = model.simulate(cycles=3, transient=1).plot.animate(turns=0.1)
        >>> moving.save("press.html").name
        'press.html'
        """
        return write_animation(*self._run, path, turns=self._turns, bearing=self._bearing, pictures=pictures)


def _lacks(names: str) -> str:
    return f"plot: the run has no {names}: name them in run.outputs of the scene, or in simulate(outputs=...)."


def _read_in(unit: str) -> tuple[float, str]:
    """Factor from SI, and the unit that an axis shows."""
    need("matplotlib")
    from ballpass.runtime.plot.style import unit_words

    factor, shown = table_unit(unit)
    return factor, unit_words(shown)


@contextmanager
def _axes(given: Axes | None) -> Iterator[Axes]:
    """The axes given, in their own style; else new ones of pyplot, which notebooks show, in the figures' style."""
    if given is not None:
        yield given
        return
    pyplot = need("matplotlib.pyplot")
    from ballpass.runtime.plot.style import settings, use

    figure = pyplot.figure(layout="constrained")  # outside: loading a notebook's backend changes settings
    with settings():
        use()
        yield figure.add_subplot()
