"""Write a moving picture of a run: an HTML page, a GIF or an MP4."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.contract.extras import need
from ballpass.runtime.contract.folders import replace_file
from ballpass.runtime.plot import MOVING
from ballpass.runtime.plot.animation import check_turns, choose_frames, to_plain
from ballpass.runtime.plot.html_page import page
from ballpass.runtime.plot.record import Record, bearing_named, gather

if TYPE_CHECKING:
    from ballpass.runtime.point.point_model import PointModel
    from ballpass.runtime.solution.solution import Solution


def animation_page(model: PointModel, solution: Solution, *, turns: float = 1.0, bearing: str | None = None) -> str:
    """Text of an HTML page that animates the last turns of a run, without other files.

    Parameters
    ----------
    turns : of driver or shaft, at the end of the run; where nothing turns, the page shows the whole run
    bearing : the one that it opens with; default: the first

    Raises
    ------
    RequestError
        The steady part is shorter, there is nothing to draw, or no such bearing.
    """
    return page(to_plain(choose_frames(records_of(model, solution, bearing), turns)))


def write_animation(
    model: PointModel,
    solution: Solution,
    path: str | Path,
    *,
    turns: float = 1.0,
    bearing: str | None = None,
    pictures: int | None = None,
    progress: Callable[[float], None] = lambda done: None,
) -> Path:
    """Write the last turns of a run as a page, ``.html``, or as a movie, ``.gif`` or ``.mp4``.

    Parameters
    ----------
    path : its ending gives the kind
    turns : of driver or shaft, at the end of the run; where nothing turns, the whole run is shown
    bearing : the one that a movie shows and a page opens with; default: the first
    pictures : of a movie, 72 a turn if None; a page has up to 1000 positions
    progress : called with the part that is done, 0 to 1

    Raises
    ------
    RequestError
        Another ending; the steady part is shorter; there is nothing to draw; an unknown bearing; a movie without
        matplotlib, an MP4 without ffmpeg on PATH.

    Examples
    --------
    >>> from ballpass.runtime.plot.animate import write_animation
    >>> write_animation(model, model.simulate(cycles=4), "press.html").name
    'press.html'
    """
    target = Path(path)
    if target.suffix.removeprefix(".") not in MOVING:
        raise RequestError(f"{target}: {target.suffix!r} is not a kind of animation. Allowed: .{', .'.join(MOVING)}.")
    if target.suffix == ".html":
        replace_file(target, animation_page(model, solution, turns=turns, bearing=bearing).encode())
        return target
    count = count_pictures(target.suffix, turns, pictures)
    from ballpass.runtime.plot.movie import write_movie

    return write_movie(choose_frames(records_of(model, solution, bearing), turns, count), target, progress=progress)


def count_pictures(suffix: str, turns: float, pictures: int | None) -> int:
    """Pictures of a movie of a kind, ``.gif`` or ``.mp4``, that can be made here; errors as for `write_animation`."""
    check_turns(turns)
    need("matplotlib")
    from ballpass.runtime.plot.movie import PICTURES, writer_of

    writer_of(suffix)
    count = round(PICTURES * turns) if pictures is None else pictures
    if count < 2:
        raise RequestError(f"A movie of {count} pictures does not move. Allowed: 2 or more.")
    return count


def records_of(model: PointModel, solution: Solution, name: str | None) -> list[Record]:
    """Records of all bearings, that of the named one first."""
    records = [gather(model, solution, bearing) for bearing in model.manifest.bearings or (None,)]
    if name is not None:
        named = bearing_named(model.manifest, name)
        records.sort(key=lambda record: record.bearing is not named)
        if not records[0].can_draw_bearing:
            raise RequestError(
                f"Bearing {name} cannot be drawn: {name}.inner.x, {name}.inner.y and {name}.ball.force are not all "
                "among the outputs. Name them in run.outputs of the scene."
            )
    if model.manifest.mechanism is None and not any(record.can_draw_bearing for record in records):
        raise RequestError(
            "There is nothing to draw: the scene has no linkage, and no bearing of it has both inner.x, inner.y and "
            "ball.force among the outputs. Name them in run.outputs of the scene."
        )
    return records
