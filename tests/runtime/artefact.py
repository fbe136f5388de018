"""A small generated folder made by hand: a damped oscillator pushed by a gate, a harmonic force and a table.

x'' = -stiffness/m x - 2 damping x' + (push gate + amplitude cos(phase) + table) / m,
where m = weight / 2 is a derived constant.

It has all the kinds of inputs, a derived constant, outputs of both shapes and a margin, and a closed-form solution.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import casadi as ca

from ballpass.runtime.contract import manifest as mf
from ballpass.runtime.contract.folder import file_digest, write_manifest

BALLS = 3
DEFAULTS = {
    "spring.stiffness": ("N/m", 1000.0),
    "spring.damping": ("1/s", 2.0),
    "body.weight": ("kg", 4.0),
    "push.force": ("N", 5.0),
    "push.window.start": ("rad", math.radians(330.0)),
    "push.window.end": ("rad", math.radians(47.0)),
    "swing.amplitude": ("N", 0.0),
    "driver.speed": ("rad/s", 20.0),
    "driver.start_angle": ("rad", 0.3),
    "table.time.1": ("s", 0.1),
    "table.time.2": ("s", 0.25),
    "table.time.3": ("s", 0.7),
    "table.y.1": ("N", 0.0),
    "table.y.2": ("N", 0.0),
    "table.y.3": ("N", 0.0),
    "mechanism.forces.push.force.x": ("N", 5.0),
    "mechanism.forces.push.force.y": ("N", 0.0),
    "initial.x": ("m", 0.01),
    "initial.v": ("m/s", -0.2),
}
TURNINGS = (
    mf.TurningInfo(
        name="driver",
        kind="driver",
        words="the driver",
        offset="driver.start_angle",
        rate="driver.speed",
        speeds=("driver.speed",),
    ),
)
INPUTS = (
    mf.InputInfo(name="phase.driver", kind="phase", turning="driver"),
    mf.InputInfo(
        name="gate.push",
        kind="gate",
        turning="driver",
        windows=(("push.window.start", "push.window.end"),),
    ),
    *(
        mf.InputInfo(
            name=f"{kind}.y",
            kind=kind,  # type: ignore[arg-type]
            times=("table.time.1", "table.time.2", "table.time.3"),
            values=("table.y.1", "table.y.2", "table.y.3"),
        )
        for kind in ("table", "table_rate")
    ),
)
OUTPUTS = (
    mf.VariableInfo(name="body.x", unit="m", description="Position of the body"),
    mf.VariableInfo(name="push.power", unit="W", description="Power of the gated push"),
    mf.VariableInfo(name="ball.force", unit="N", description="Force of every ball", size=BALLS),
)


def functions(*, extra_term: float = 0.0, states: bool = True) -> list[ca.Function]:
    """The functions of the folder; `extra_term` changes the source, `states` False leaves none."""
    t, x, u = ca.SX.sym("t"), ca.SX.sym("x", 2), ca.SX.sym("u", len(INPUTS))
    p, c = ca.SX.sym("p", len(DEFAULTS)), ca.SX.sym("c", 1)
    value = dict(zip(DEFAULTS, ca.vertsplit(p), strict=True))
    phase, gate, table, rate = ca.vertsplit(u)
    load = (
        value["push.force"] * gate
        + value["swing.amplitude"] * ca.cos(phase + value["driver.speed"] * t)
        + table
        + rate * t
        + extra_term
    )
    force = -value["spring.stiffness"] * x[0] + load
    xdot = ca.vertcat(x[1], force / c[0] - 2 * value["spring.damping"] * x[1])
    constants = ca.vertcat(value["body.weight"] / 2)
    names, arguments = ["t", "x", "u", "p", "c"], [t, x, u, p, c]
    angle = phase + value["driver.speed"] * t
    made = [ca.Function("constants", [p], [constants], ["p"], ["c"])]
    made.append(ca.Function("constants_jac", [p], [ca.jacobian(constants, p)], ["p"], ["c_p"]))
    balls = ca.vertcat(*(force * (k + 1) for k in range(BALLS)))
    outputs = [x[0], value["push.force"] * gate * x[1], balls]
    if not states:
        kept = [k for k, name in enumerate(names) if name != "x"]
        outputs = [ca.substitute(output, x, ca.DM([1.0, 2.0])) for output in outputs]
        names, arguments = [names[k] for k in kept], [arguments[k] for k in kept]
    made.append(ca.Function("outputs", arguments, outputs, names, ["body_x", "push_power", "ball_force"]))
    if states:
        made.append(ca.Function("rhs", arguments, [xdot], names, ["xdot"]))
        for name, along in (("x", x), ("t", t), ("u", u), ("p", p), ("c", c)):
            made.append(ca.Function(f"rhs_jac_{name}", arguments, [ca.jacobian(xdot, along)], names, [f"xdot_{name}"]))
    # the crank lifts a pin: the dyad closes while the pin stays below 0.7 + 0.1 weight, smallest at 90 degrees
    margin = ca.vertcat(0.7 + 0.1 * value["body.weight"] - ca.sin(angle))
    made.append(ca.Function("assembly", [t, u, p, c], [margin], ["t", "u", "p", "c"], ["margins"]))
    return made


def write_folder(
    folder: Path,
    *,
    extra_term: float = 0.0,
    states: bool = True,
    defaults: dict[str, float] | None = None,
    mechanism: bool = True,
) -> Path:
    """Write the generated folder; `defaults` replaces default values and touches the manifest only."""
    folder.mkdir(parents=True, exist_ok=True)
    made = functions(extra_term=extra_term, states=states)
    generator = ca.CodeGenerator("model.c")
    for function in made:
        generator.add(function)
    generator.generate(f"{folder}/")
    pack = ca.FileSerializer(str(folder / "model.casadi"))
    pack.pack(len(made))
    for function in made:
        pack.pack(function)
    del pack
    write_manifest(folder, manifest(made, folder, defaults or {}, states, mechanism))
    return folder


def manifest(
    made: tuple[ca.Function, ...], folder: Path, defaults: dict[str, float], states: bool, mechanism: bool
) -> mf.Manifest:
    """The manifest of the folder."""
    found = mf.Manifest(
        scene="oscillator",
        title="Oscillator made by hand",
        source="",
        signature="0" * 64,
        versions=(("casadi", ca.__version__),),
        parameters=tuple(
            mf.ParameterInfo(name=name, unit=unit, description=f"{name} of the test", latex="", default=value)
            for name, (unit, value) in {k: (u, defaults.get(k, v)) for k, (u, v) in DEFAULTS.items()}.items()
        ),
        constants=(mf.VariableInfo(name="mass", unit="kg", description="Half the weight"),),
        states=(
            mf.VariableInfo(name="body.x", unit="m", description="Position of the body"),
            mf.VariableInfo(name="body.v", unit="m/s", description="Velocity of the body"),
        ),
        coordinates=(
            mf.CoordinateInfo(
                name="body.x", velocity="body.v", kind="displacement", unit="m", group="body", partner=""
            ),
        ),
        initial=("initial.x", "initial.v"),
        turnings=TURNINGS,
        inputs=INPUTS,
        outputs=OUTPUTS,
        functions=tuple(
            mf.FunctionInfo(
                name=f.name(),
                inputs=tuple((f.name_in(k), f.size1_in(k)) for k in range(f.n_in())),
                outputs=tuple((f.name_out(k), f.size1_out(k)) for k in range(f.n_out())),
                operations=0,
                description=f.name(),
            )
            for f in made
        ),
        smoothness=(),
        mechanism=mf.MechanismInfo(
            speed="driver.speed",
            start_angle="driver.start_angle",
            joints=(),
            points=(mf.PointInfo(body="pin", point="P"),),
            margins=(mf.MarginInfo(joint="C", description="reach of the rod"),),
            forces=(("push", "pin", "P", "gate.push"),),
        )
        if mechanism
        else None,
        bearings=(),
        run=mf.RunInfo(
            cycles=3.0, duration=None, transient_cycles=1.0, samples_per_cycle=200, method="auto", rtol=1e-8
        ),
        files=tuple((name, file_digest(folder / name)) for name in ("model.c", "model.casadi")),
    )
    if not states:
        found = replace(found, states=(), coordinates=(), initial=())
    return found
