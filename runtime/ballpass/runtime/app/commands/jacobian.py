"""``ballpass jacobian`` and ``ballpass linearize``: derivatives at one instant, and small vibrations about it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ballpass.runtime.app.commands import options
from ballpass.runtime.app.commands.asked import read_asked, read_quantity
from ballpass.runtime.app.commands.shared import Stages, command, complain, load_model, show, show_json
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.run.tables import show_tables, simple_table

if TYPE_CHECKING:
    from ballpass.runtime.certify.jacobian_check import CheckedJacobian
    from ballpass.runtime.model import Model

_ANGLE = Annotated[
    str | None,
    typer.Option(
        "--at-angle", "--angle", metavar="ANGLE", help='Angle of crank or shaft in the first turn, as "240 deg".'
    ),
]
_TIME = Annotated[str | None, typer.Option("--time", metavar="TIME", help='The instant as a time, as "0.08 s".')]


def jacobian(
    scene: options.SceneOrFolder,
    of: Annotated[
        list[str],
        typer.Option(help='What to differentiate: rhs, a quantity, a pattern as "reaction.A.*". May be repeated.'),
    ],
    wrt: Annotated[
        list[str],
        typer.Option(help="By what: states, a state, time, crank_angle, a number of the scene. May be repeated."),
    ],
    at_angle: _ANGLE = None,
    time: _TIME = None,
    state: Annotated[
        str, typer.Option(help="Where the rings are: equilibrium (static, under the load of that instant) or initial.")
    ] = "equilibrium",
    set_: options.Settings = None,
    check: Annotated[
        bool, typer.Option("--check/--no-check", help="Compare each derivative with extrapolated differences.")
    ] = True,
    json_: options.Json = False,
) -> None:
    """Derivatives of quantities at one instant, from generated code, each with a second opinion.

    Exit code 1 where the two disagree."""
    with command(scene) as stages:
        if state not in ("equilibrium", "initial"):
            raise RequestError(f"--state: {state!r} is none of the choices. Allowed: equilibrium, initial.")
        model, overrides, angle, seconds = _model_at(scene, stages, set_, at_angle, time)
        stages("differentiate")
        result = _checked(model, overrides, of, wrt, angle, seconds, state, check=check)
    if json_:
        show_json(result.to_dict())
    else:
        _show(result)
    from ballpass.runtime.certify.certificate import Verdict

    if result.verdict is Verdict.DISAGREES:
        complain("the two routes disagree; both numbers are shown. " + " ".join(result.notes))
        raise typer.Exit(1)


def linearize(
    scene: options.SceneOrFolder,
    at_angle: _ANGLE = None,
    time: _TIME = None,
    set_: options.Settings = None,
    json_: options.Json = False,
) -> None:
    """Matrices, natural frequencies and modes of small vibrations about the static equilibrium of an instant."""
    with command(scene) as stages:
        model, overrides, angle, seconds = _model_at(scene, stages, set_, at_angle, time)
        stages("linearize")
        result = model.linearize(seconds, crank_angle=angle, parameters=overrides)
    if json_:
        show_json(result.to_dict())
        return
    from ballpass.runtime.point.linearize import render_linearization, render_matrices

    show_tables(render_linearization(result), render_matrices(result))


def _model_at(
    scene: Path, stages: Stages, settings: list[str] | None, at_angle: str | None, time: str | None
) -> tuple[Model, dict[str, float], float | None, float | None]:
    """The model, numbers of ``--set`` [SI], and angle [rad] or time [s] of the options, at most one of the two."""
    stages("read")
    overrides = read_asked(scene, settings).overrides
    if at_angle is not None and time is not None:
        raise RequestError("--at-angle and --time: both were given. Allowed: one of the two.")
    angle, seconds = read_quantity("--at-angle", at_angle, "rad"), read_quantity("--time", time, "s")
    if angle is not None:
        angle = math.fmod(angle, math.tau)  # the unit was written out, so that many turns are meant as such
    return load_model(scene, stages, "none", overrides=overrides), overrides, angle, seconds


def _checked(
    model: Model,
    overrides: dict[str, float],
    of: list[str],
    wrt: list[str],
    angle: float | None,
    seconds: float | None,
    state: str,
    *,
    check: bool,
) -> CheckedJacobian:
    from ballpass.runtime.certify.jacobian_check import checked_jacobian
    from ballpass.runtime.point.equilibrium import instant, static_equilibrium
    from ballpass.runtime.point.jacobian import directions_of, rows_of

    model.check_assembly(overrides)
    numbers = model.numbers(overrides)
    t = instant(model, numbers, seconds, angle)
    # names first, and all wrong ones at once, before anything is computed
    faults = []
    for look in (lambda: rows_of(model, of), lambda: directions_of(model, numbers, wrt, t)):
        try:
            look()
        except RequestError as error:
            faults.append(str(error))
    if faults:
        raise RequestError("\n".join(faults))
    x: Any = None
    if model.states and state == "equilibrium":
        x = static_equilibrium(model, numbers, t=t).x
    return checked_jacobian(model, numbers, of, wrt, t=t, x=x, check=check)


def _show(result: CheckedJacobian) -> None:
    """Entries with their second opinion, and the notes; what does not depend at all is left out, and counted."""
    from ballpass.runtime.certify.certificate import Verdict

    entries = result.to_dict()["jacobian"]
    shown = [
        entry
        for entry in entries
        if entry["verdict"] == Verdict.DISAGREES.value
        or entry["value"] != 0.0
        or entry["sides"]
        or len(result.rows) == 1
    ]
    table = simple_table(
        f"Derivatives at t = {result.time:.6g} s: {result.verdict.value}",
        ("of", "wrt", "derivative", "by differences", "unit", "verdict"),
        right=("derivative", "by differences"),
    )
    for entry in shown:
        value, second = (None if entry[key] is None else f"{entry[key]:z.7g}" for key in ("value", "second"))
        if entry["sides"]:
            value = "{:z.7g} or {:z.7g}".format(*entry["sides"])
        table.add_row(entry["of"], entry["wrt"], value or "not finite", second or "", entry["unit"], entry["verdict"])
    show_tables(table)
    still = len(entries) - len(shown)
    for text in ([f"{still} more {'is' if still == 1 else 'are'} zero."] if still else []) + list(result.notes):
        show(text)
