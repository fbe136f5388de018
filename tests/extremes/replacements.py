"""Names of the press's parameters and replacements in the shipped scenes, which the extreme cases share."""

from __future__ import annotations

import math
from pathlib import Path

Change = tuple[str, str]

TURN = 2.0 * math.pi
SPEED = "mechanism.driver.speed"
START = "mechanism.driver.start_angle"
PUNCH = "mechanism.forces.punch.force.y"
WINDOW = "mechanism.forces.punch.window"
CRANK, ROD = "mechanism.bodies.crank.points.B", "mechanism.bodies.rod.points.C"
ROD_CENTER = "mechanism.bodies.rod.center_of_mass"
OUTER = "bearing.outer_ring"
RATIO = "bearing.damping.ratio"
CLEARANCE = "bearing.clearance"

#: The crank starts 7 degrees before the punch, so that a seventh of a turn holds both of its steps.
BEFORE_PUNCH = math.radians(230.0)
#: A ball is flattened by 7 % of its diameter, 8 % under a punch of `STRONG`; by more than a tenth a run is refused.
FAST, STRONG = {SPEED: 15_000 * TURN / 60.0}, 3e5
TINY = {CRANK: 5e-6, ROD: 5e-6 / 0.06, ROD_CENTER: 5e-6 / 0.12}
#: At a turn a second.
STRETCHED = {CRANK: 0.09999, START: math.radians(350.0), SPEED: TURN}

#: What stands for each law in the place of the shipped press's damping.
DAMPING = {
    "none": 'law = "none"',
    "one-sided": 'law = "one-sided"\nratio = "0.25e-5 s*mm^0.5"',
    "one-sided-gated": 'law = "one-sided-gated"\nratio = "0.25e-5 s*mm^0.5"',
    "two-sided-gated": 'law = "two-sided-gated"\nratio = "0.25e-5 s*mm^0.5"',
    "tangent": 'law = "tangent"\nratio = "0.25e-5 s"',
}


def lines_of(name: str, *starts: str) -> str:
    """Lines of a shipped scene that start so, which must follow each other."""
    scene = Path(__file__).resolve().parents[2] / "scenes" / f"{name}.toml"
    return "\n".join(line for line in scene.read_text(encoding="utf-8").splitlines() if line.startswith(starts))


#: An outer ring that does not move.
FIXED_RING: tuple[Change, ...] = (
    (
        lines_of("punching_press", 'support = "elastic"', 'mass = "0.555 kg"', 'stiffness = "5e7', 'damping = "500'),
        'support = "fixed"',
    ),
    (lines_of("punching_press", "outer = ", "outer_velocity = "), ""),
    ('"outer.*", ', ""),
)
GIVEN_MASS: tuple[Change, ...] = (
    ("[bearing.inner_ring.equivalent_mass]", '[bearing.inner_ring]\nmass = "0.4 kg"'),
    ('ring = "0.032 kg" ', "#"),
    ('crankpin = "0.05 kg" ', "#"),
    ('crank = "whole" ', "#"),
)
OFF_LINE: tuple[Change, ...] = (
    *GIVEN_MASS,
    ('guide = "origin" ', 'guide = ["93.99 mm", "-10 mm"]  #'),
    ('{ distance = "0 mm", angle = "0 deg" }', '{ distance = "4 mm", angle = "150 deg" }'),
    ('center_of_mass = "50 mm"  ', 'center_of_mass = ["38 mm", "7 mm"]  #'),
    (
        'window = { start = "237 deg", end = "267 deg" }',
        'window = [{ start = "237 deg", end = "250 deg" }, { start = "260 deg", end = "267 deg" }]',
    ),
)
SIXTY_BALLS: tuple[Change, ...] = (
    ("balls = 8  ", "balls = 60  #"),
    ('ball_diameter = "7.9375 mm"', 'ball_diameter = "1.7 mm"'),
    ('groove_radius = "4.1275 mm"', 'groove_radius = "0.884 mm"'),
    ('groove_radius = "4.206875 mm"', 'groove_radius = "0.901 mm"'),
)
#: Everything that has a direction is given by an angle.
TURNABLE: tuple[Change, ...] = (
    *GIVEN_MASS,
    ('gravity = "9.81 m/s^2" ', 'gravity = { magnitude = "9.81 m/s^2", direction = "270 deg" } #'),
    ('force = ["0 N", "8964.8 N"]', 'force = { magnitude = "8964.8 N", direction = "90 deg" }'),
    ('center_of_mass = "50 mm"  ', 'center_of_mass = ["38 mm", "7 mm"]  #'),
)

#: Load of the shipped rotor.
ROTOR_LOAD = lines_of("varying_compliance", "type = ", "force = ")
