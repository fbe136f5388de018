"""Random machines: linkages of the tests with other numbers, drives, forces, and bearings in any of their hinges.

In: a seed.  Out: a checked scene.
"""

from __future__ import annotations

import numpy as np
from coupled_scenes import LAWS, bearing, linkage_text, with_bearings
from linkages import MACHINES, Machine

from ballpass.derive.scene.records import Scene

FRAME_POINTS = "[mechanism.frame.points]\n"


def random_linkage(rng: np.random.Generator, topology: int) -> Machine:
    """Numbers off by a tenth, any sense and angle of the start."""
    machine = list(MACHINES.values())[topology % len(MACHINES)]()
    values = {path: value * rng.uniform(0.9, 1.1) for path, value in machine.values.items()}
    values["mechanism.driver.speed"] *= rng.choice([-1, 1])
    values["mechanism.driver.start_angle"] = rng.uniform(-3, 9)
    machine = Machine(mechanism=machine.mechanism, values=values)
    driver = machine.mechanism.joint("A")
    if driver.bodies[0] != "frame":
        machine = machine.with_joint("A", bodies=driver.bodies[::-1], points=driver.points[::-1])
    return machine


def random_bearings(rng: np.random.Generator, machine: Machine) -> list[str]:
    """Of any kind in some of the hinges, either way round."""
    hinges = [joint for joint in machine.mechanism.joints if joint.kind == "revolute"]
    chosen = [joint for joint in hinges if rng.random() < 0.5] or hinges[-1:]
    return [
        bearing(
            joint.name,
            str(rng.choice(joint.bodies)),
            law=str(rng.choice(LAWS)),
            elastic=bool(rng.random() < 0.5),
            count=float(rng.integers(1, 3)),
            clearance=f"{float(rng.uniform(0, 20))} um",
            balls=int(rng.integers(6, 10)),
        )
        for joint in chosen
    ]


def random_scene(seed: int) -> Scene:
    """A random linkage at constant speed, with bearings."""
    rng = np.random.default_rng(seed)
    machine = random_linkage(rng, seed)
    return with_bearings(linkage_text(machine), *random_bearings(rng, machine))


def random_machine(seed: int) -> Scene:
    """The same with any drive, windows, springs, stops and friction."""
    rng = np.random.default_rng([seed, 8])
    machine = random_linkage(rng, seed)
    text = linkage_text(machine)
    for old, new in (
        *_windows(rng, machine),
        _drive(rng, machine.speed()),
        (FRAME_POINTS, f'{FRAME_POINTS}hook = ["0.45 m", "0.4 m"]\n'),
    ):
        assert old in text
        text = text.replace(old, new, 1)
    forces = [*_springs(rng, machine), *_stops(rng, machine), *_friction(rng, machine)]
    return with_bearings("\n".join([text, *forces]), *random_bearings(rng, machine))


def _drive(rng: np.random.Generator, speed: float) -> tuple[str, str]:
    """What of the text is replaced, and by what."""
    wheel = f'[mechanism.driver.flywheel]\ninertia = "{rng.uniform(0.01, 0.3)} kg*m^2"\n' if rng.random() < 0.5 else ""
    size, torque = abs(speed), float(np.copysign(rng.uniform(5, 50), speed))
    laws = [
        f'law = "constant"\ntorque = "{torque} N*m"',
        f'law = "linear"\nno_load_speed = "{1.3 * speed} rad/s"\nstall_torque = "{torque} N*m"',
        f'law = "table"\nspeed = ["{-size} rad/s", "{0.5 * size} rad/s", "{1.5 * size} rad/s"]\n'
        f'torque = ["{torque} N*m", "{0.8 * torque} N*m", "{-0.1 * torque} N*m"]',
        f'law = "asynchronous"\nbreakdown_torque = "{torque} N*m"\nbreakdown_slip = 0.2\n'
        f'synchronous_speed = "{1.05 * speed} rad/s"',
        'law = "none"',
    ]
    if rng.random() < 0.35:
        return FRAME_POINTS, FRAME_POINTS
    if rng.random() < 0.25:
        line = f'speed = "{float(speed)!r} rad/s"'
        rows = f'time = ["0.001 s", "0.004 s", "0.5 s"], speed = ["{speed} rad/s", "{1.2 * speed} rad/s", "0 rad/s"]'
        inertia = f'\nflywheel = {{ inertia = "{rng.uniform(0.01, 0.3)} kg*m^2" }}' if wheel else ""
        return line, f"table = {{ {rows} }}{inertia}"
    return FRAME_POINTS, f"[mechanism.driver.torque]\n{rng.choice(laws)}\n{wheel}{FRAME_POINTS}"


def _windows(rng: np.random.Generator, machine: Machine) -> list[tuple[str, str]]:
    """Of some forces, near the start: a run of some degrees meets an edge now and then."""
    start, out = machine.values["mechanism.driver.start_angle"] % 6.0, []
    for force in machine.mechanism.forces:
        if rng.random() < 0.6:
            edges = start + np.sort(rng.uniform(-0.3, 0.5, 2)), start + np.array([2.0, 3.0])
            rows = ", ".join(f'{{ start = "{a} rad", end = "{b} rad" }}' for a, b in edges)
            table = f"[mechanism.{force.table}.{force.name}]\n"
            out.append((table, f"{table}window = [{rows}]\n"))
    return out


def _place(rng: np.random.Generator, machine: Machine) -> tuple[str, str]:
    """A body, and a point of it."""
    body = machine.mechanism.bodies[rng.integers(len(machine.mechanism.bodies))]
    return body.name, str(rng.choice([p.name for p in body.points]))


def _two_turning(rng: np.random.Generator, machine: Machine) -> list[str]:
    names = [body.name for body in machine.mechanism.bodies if body.inertia is not None]
    return [str(name) for name in rng.choice(["frame", *names], 2, replace=False)]


def _springs(rng: np.random.Generator, machine: Machine) -> list[str]:
    out = []
    if rng.random() < 0.6:
        body, point = _place(rng, machine)
        out.append(f"""[mechanism.springs.coil]
bodies = ["frame", "{body}"]
points = ["hook", "{point}"]
stiffness = "{rng.uniform(500, 4000)} N/m"
free_length = "{rng.uniform(0.2, 0.7)} m"
damping = "{rng.uniform(0, 60)} N*s/m"
preload = "{rng.uniform(-20, 20)} N"
""")
    if rng.random() < 0.4:
        out.append(f"""[mechanism.torsion_springs.twist]
bodies = {_two_turning(rng, machine)}
stiffness = "{rng.uniform(5, 50)} N*m/rad"
free_angle = "{rng.uniform(-2, 2)} rad"
damping = "{rng.uniform(0, 1)} N*m*s/rad"
""")
    return out


def _stops(rng: np.random.Generator, machine: Machine) -> list[str]:
    """About half of them touch."""
    out = []
    if rng.random() < 0.6:
        body, point = _place(rng, machine)
        wall = rng.random() < 0.5
        size = f'direction = "{rng.uniform(-3, 3)} rad"\nfree_distance' if wall else "free_length"
        free = rng.uniform(-0.4, 0.4) if wall else rng.uniform(0.2, 0.8)
        out.append(f"""[mechanism.stops.wall]
bodies = ["frame", "{body}"]
points = ["hook", "{point}"]
stiffness = "{rng.uniform(1e4, 2e5)} N/m"
{size} = "{free} m"
hysteresis = "{rng.uniform(0, 1)} s/m"
""")
    if rng.random() < 0.3:
        out.append(f"""[mechanism.torsion_stops.limit]
bodies = {_two_turning(rng, machine)}
stiffness = "{rng.uniform(100, 1000)} N*m/rad"
free_angle = "{rng.uniform(-3, 3)} rad"
""")
    return out


def _friction(rng: np.random.Generator, machine: Machine) -> list[str]:
    out = []
    for joint in machine.mechanism.joints:
        if rng.random() < 0.7:
            continue
        turns = joint.kind == "revolute"
        kind, moment = ("friction", "torque") if turns else ("guide_friction", "force")
        unit, rate = ("N*m", "rad") if turns else ("N", "m")
        out.append(f'[mechanism.{kind}.at_{joint.name}]\njoint = "{joint.name}"')
        out.append(f'viscous = "{rng.uniform(0, 0.5)} {unit}*s/{rate}"')
        if rng.random() < 0.6:
            out.append(f'{moment} = "{rng.uniform(0, 5)} {unit}"\nsmoothing = "{rng.uniform(0.5, 1)} {rate}/s"')
    return out
