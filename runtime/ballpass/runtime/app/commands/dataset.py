"""``ballpass dataset``: thousands of labelled signals, made by this process or a cluster of Dask.

In: a specification (see `data_set_spec`).  Out: a data set in Zarr or NetCDF.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ballpass.runtime.app.commands import options
from ballpass.runtime.app.commands.messages import complain, show, show_json, warn
from ballpass.runtime.app.commands.shared import Stages, check_folder, command
from ballpass.runtime.contract.options import Option
from ballpass.runtime.report.units import with_units

if TYPE_CHECKING:
    from ballpass.runtime.app.commands.data_set_spec import ClassSpec
    from ballpass.runtime.many.data_set import SignalClass
    from ballpass.runtime.many.signals import Signals

#: Failures that the terminal names; all are in the data set.
NAMED = 5


def dataset(
    spec: Annotated[
        Path,
        Option(
            shown="SPEC",
            words="What the data set is made of (TOML); `ballpass new bearing-faults` copies one.",
            positional=True,
        ),
    ],
    out: Annotated[
        Path | None,
        Option(shown="PATH", words="Zarr folder, or NetCDF file NAME.nc; `results/<spec>.zarr` if not given."),
    ] = None,
    scheduler: options.Scheduler = None,
    workers: options.Workers = None,
    json_: options.Json = False,
) -> None:
    """Make a data set of labelled signals, or its missing part: a second call continues where the first one ended.

    A member that fails is named and has NaN for samples; the others are kept. Exit code 1 if all fail.
    """
    with command() as stages:
        stages("reading the scene")
        from ballpass.runtime.app.commands.data_set_spec import read_spec
        from ballpass.runtime.contract.extras import need
        from ballpass.runtime.many.cluster import connected
        from ballpass.runtime.many.data_set import make_data_set
        from ballpass.runtime.native.compilers import need_compiler

        need("zarr")
        need_compiler("ballpass dataset")
        read = read_spec(spec)
        path = out if out is not None else Path("results") / f"{spec.stem}.zarr"
        check_folder(path.parent)
        with connected(scheduler, workers) as client:
            classes = [_signal_class(one, read.signals, stages) for one in read.classes]
            stages("simulating")
            report = make_data_set(
                path,
                classes,
                read.signals,
                seed=read.seed,
                title=read.title,
                client=client,
                chunk=read.chunk,
                progress=stages.fraction,
            )
    failed = [{"member": one.member, "status": one.status, "message": one.message} for one in report.failures]
    if json_:
        made = {"path": str(report.path), "members": report.members, "made": report.made, "failures": failed}
        show_json(with_units(made))
    else:
        show(f"{report.path}: {report.members} members, {report.made} made now, {len(failed)} without a signal")
    for one in report.failures[:NAMED]:
        warn(f"member {one.member}: {one.status}: {one.message}")
    if len(failed) > NAMED:
        warn(f"and {len(failed) - NAMED} more members without a signal; failure in the data set names all.")
    if len(failed) == report.members:
        complain(f"none of the {report.members} members has a signal: {report.failures[0].message}")
        raise typer.Exit(1)


def _signal_class(spec: ClassSpec, signals: Signals, stages: Stages) -> SignalClass:
    """A class with its model, derived and compiled where that is stale."""
    from ballpass.derive.emit.generate import generate
    from ballpass.runtime.many.data_set import SignalClass
    from ballpass.runtime.many.signals import check_outputs
    from ballpass.runtime.model import load_own
    from ballpass.runtime.request.locating import choose_kinks, stepper_for

    unknown = partial(check_outputs, signals=signals, label=spec.label)
    folder = generate(spec.scene, progress=stages, inspect=unknown)
    stages("compiling")
    model = load_own(folder)
    if model.has_stepper:
        # compiled here, where it is announced, and found by workers on this machine
        _ = stepper_for(model, choose_kinks(None, "stepper", model.manifest, model.manifest.run.rtol))
    return SignalClass(label=spec.label, model=model, members=spec.members, parameters=spec.parameters)
