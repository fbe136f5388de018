"""Write a page with the solver in it: sliders for the numbers of a scene, and its pictures redrawn as they move.

In: a model.  Out: one HTML file, which needs no server, no network and no installation.
"""

from __future__ import annotations

import base64
import gzip
from collections.abc import Mapping
from typing import TYPE_CHECKING

from ballpass.runtime.export.web_assembly import web_assembly
from ballpass.runtime.plot.animate import records_of
from ballpass.runtime.plot.animation import choose_frames, to_plain
from ballpass.runtime.plot.html_page import page
from ballpass.runtime.plot.sliders import sliders
from ballpass.runtime.plot.solver_columns import solver_columns
from ballpass.runtime.time.turning import TURN

if TYPE_CHECKING:
    from ballpass.runtime.point.point_model import PointModel
    from ballpass.runtime.solution.solution import Solution


def explore_page(model: PointModel, solution: Solution, *, units: Mapping[str, str] | None = None) -> str:
    """Text of the page.

    Parameters
    ----------
    solution : a run of the scene's own numbers, which the page compares with
    units : by name of a parameter, where it is read in another unit than the usual

    Raises
    ------
    RequestError
        The compiler for WebAssembly is missing; the model has no states, or nothing that can be drawn.
    CompileError
        The compiler failed.
    """
    records = records_of(model, solution, None)
    angle = records[0].crank_angle()
    turned = abs(float(angle[-1] - angle[0])) / TURN
    turns = min(float(records[0].cycle_turns), turned) or 1.0
    numbers = to_plain(choose_frames(records, turns=turns))
    numbers["solver"] = solver_columns(records[0], numbers) | {
        "module": base64.b64encode(gzip.compress(web_assembly(model), mtime=0)).decode(),
        "parameters": sliders(model.manifest, solution.parameters, units or {}),
        "scene": model.manifest.scene,
    }
    return page(numbers, "explore")
