"""``ballpass jacobian`` and ``ballpass linearize``: derivatives at one instant, and small vibrations about it."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich import box
from rich.console import Console
from rich.table import Table

from ballpass.runtime.app.commands.options import Json, SceneFile, Settings
from ballpass.runtime.app.commands.shared import (
    Stages,
    complain,
    faults_of,
    load_model,
    read_asked,
    reported,
    warnings_shown,
)
from ballpass.runtime.contract.errors import RequestError

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
    scene: SceneFile,
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
    set_: Settings = None,
    check: Annotated[
        bool, typer.Option("--check/--no-check", help="Compare each derivative with extrapolated differences.")
    ] = True,
    json_: Json = False,
) -> None:
    """Derivatives of quantities at one instant, from generated code, each with a second opinion.

    Exit code 1 where the two disagree."""
    with reported(), warnings_shown(), Stages() as stages:
        if state not in ("equilibrium", "initial"):
            raise RequestError(f"--state: {state!r} is none of the choices. Allowed: equilibrium, initial.")
        stages("read")
        overrides = read_asked(scene, set_ or []).overrides
        angle, seconds = _instant(at_angle, time)
        with faults_of(scene):
            model = load_model(scene, stages, "none", overrides=overrides)
        stages("differentiate")
        result = _checked(model, overrides, of, wrt, angle, seconds, state, check=check)
    if json_:
        typer.echo(json.dumps(result.to_dict(), indent=2, allow_nan=False))
    else:
        _show(result)
    from ballpass.runtime.certify.certificate import Verdict

    if result.verdict is Verdict.DISAGREES:
        complain("the two routes disagree; both numbers are shown. " + " ".join(result.notes))
        raise typer.Exit(1)


def linearize(
    scene: SceneFile,
    at_angle: _ANGLE = None,
    time: _TIME = None,
    set_: Settings = None,
    json_: Json = False,
) -> None:
    """Matrices, natural frequencies and modes of small vibrations about the static equilibrium of an instant."""
    with reported(), warnings_shown(), Stages() as stages:
        stages("read")
        overrides = read_asked(scene, set_ or []).overrides
        angle, seconds = _instant(at_angle, time)
        with faults_of(scene):
            model = load_model(scene, stages, "none", overrides=overrides)
        stages("linearize")
        result = model.linearize(seconds, crank_angle=angle, parameters=overrides)
    if json_:
        typer.echo(json.dumps(result.to_dict(), indent=2, allow_nan=False))
        return
    from ballpass.runtime.point.linearize import render_linearization, render_matrices

    console = Console()
    console.print(render_linearization(result), highlight=False)
    console.print(render_matrices(result), highlight=False)


def _instant(at_angle: str | None, time: str | None) -> tuple[float | None, float | None]:
    """Angle [rad] and time [s] of the options, at most one of them."""
    if at_angle is not None and time is not None:
        raise RequestError("--at-angle and --time: both were given. Allowed: one of the two.")
    angle = _quantity("--at-angle", at_angle, "rad")
    # the unit was written out, so that many turns are meant as such
    return None if angle is None else math.fmod(angle, math.tau), _quantity("--time", time, "s")


def _quantity(option: str, text: str | None, unit: str) -> float | None:
    from ballpass.derive.scene.units import QuantityError, parse_quantity

    if text is None:
        return None
    try:
        value = parse_quantity(text, unit)
    except QuantityError as error:
        raise RequestError(f"{option}: {error}") from None
    if not math.isfinite(value):
        raise RequestError(f"{option}: {text!r} is no finite quantity.")
    return value


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
    """Print the table as wide as its names are, and below it what is left out and the notes."""
    console = Console()
    table, still = _render(result)
    wide = Console(width=10_000).measure(table).maximum
    Console(width=max(console.width, wide)).print(table, highlight=False)
    below = ([f"{still} more are zero."] if still else []) + list(result.notes)
    for text in below:
        console.print(text, highlight=False, markup=False)


def _render(result: CheckedJacobian) -> tuple[Table, int]:
    """Entries with their second opinion; what does not depend at all is left out, and counted."""
    from ballpass.runtime.certify.certificate import Verdict

    table = Table(
        title=f"Derivatives at t = {result.time:.6g} s: {result.verdict.value}",
        title_justify="left",
        header_style="bold",
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
    )
    for head in ("of", "wrt"):
        table.add_column(head, no_wrap=True)
    for head in ("derivative", "by differences"):
        table.add_column(head, justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    still = 0
    for entry, check in zip(
        result.to_dict()["jacobian"], (check for row in result.checks for check in row), strict=True
    ):
        if check.verdict is not Verdict.DISAGREES and entry["value"] == 0.0 and len(result.rows) > 1:
            still += 1
            continue
        second = "" if entry["second"] is None else f"{entry['second']:.7g}"
        table.add_row(
            entry["of"],
            entry["wrt"],
            "not finite" if entry["value"] is None else f"{entry['value']:.7g}",
            second,
            entry["unit"],
            entry["verdict"],
        )
    return table, still
