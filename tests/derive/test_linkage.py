"""Kinematics of linkages: loops close, rates are derivatives, branches mean what they say; wrong ones are refused."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import mpmath
import numpy as np
import pytest
import sympy as sp
from linkages import (
    ANGLE,
    DEGREE,
    DRIVE,
    MACHINES,
    Machine,
    build,
    crank_slider,
    evaluate,
    four_bar,
    moving_guide,
    offset_slider,
    six_bar_slider,
    watt_six_bar,
)
from quick_cases import long_but

from ballpass.derive.mechanism.evaluator import Evaluator
from ballpass.derive.mechanism.linkage import Linkage, check_assembly, derive_linkage
from ballpass.derive.mechanism.vectors import dot
from ballpass.derive.scene.errors import LinkageError, SceneError
from ballpass.derive.scene.mechanism_records import Joint, Mechanism

TURN = np.linspace(0.0, 2 * np.pi, 61)
STEP = 1e-30  # of complex differentiation: no difference is taken, so no digits are lost

every_machine = pytest.mark.parametrize(
    "name", long_but(MACHINES, "four-bar", "crank-slider", "slotted lever", "watt six-bar", "guide on a moving body")
)


@cache
def derived(name: str) -> tuple[Machine, Linkage]:
    machine = MACHINES[name]()
    return machine, machine.linkage()


def joint_points(machine: Machine, linkage: Linkage, joint: Joint) -> list:
    return [linkage.motion(body, point) for body, point in zip(joint.bodies, joint.points, strict=True)]


@every_machine
def test_loops_close(name):
    """Both points of a hinge coincide, a slider stays on its guide and parallel to it, bodies are rigid."""
    machine, linkage = derived(name)
    gaps = [(pose.cos**2 + pose.sin**2 - 1, 2e-14) for pose in linkage.poses.values()]
    for joint in machine.mechanism.joints:
        one, two = joint_points(machine, linkage, joint)
        apart = tuple(b - a for a, b in zip(one.position, two.position, strict=True))
        if joint.kind == "prismatic":
            carrier, slider = (linkage.pose(body) for body in joint.bodies)
            assert (carrier.cos, carrier.sin, carrier.rate) == (slider.cos, slider.sin, slider.rate)
            angle = sp.Symbol(joint.direction.path, real=True)
            gaps.append((dot(carrier.rotate((-sp.sin(angle), sp.cos(angle))), apart), 1e-15))
        else:
            gaps += [(gap, 3e-15) for gap in apart]
    found = evaluate(machine, [gap for gap, _ in gaps], TURN, linkage)
    for gap, (_, bound) in zip(found, gaps, strict=True):
        assert np.max(np.abs(gap)) < bound


@every_machine
def test_rates_are_derivatives_of_positions(name):
    """Complex-step differentiation along the driver's angle."""
    machine, linkage = derived(name)
    speed = machine.speed()
    motions = [m for pose in linkage.poses.values() for m in (pose.origin, pose.center_of_mass)]
    positions = [c for m in motions for c in m.position]
    velocities = [c for m in motions for c in m.velocity]
    accelerations = [c for m in motions for c in m.acceleration]
    turns = [q for pose in linkage.poses.values() for q in (pose.cos, pose.sin, pose.rate, pose.acceleration)]
    run = Evaluator(linkage.definitions, [*positions, *velocities, *accelerations, *turns])
    plain = [np.real(v) for v in run(machine.numbers(TURN))]
    along = [np.imag(v) / STEP * speed for v in run(machine.numbers(TURN + 1j * STEP))]

    n, size = len(positions), 0.3
    for k in range(n):
        assert np.max(np.abs(along[k] - plain[n + k])) < 1e-13 * size * speed
        assert np.max(np.abs(along[n + k] - plain[2 * n + k])) < 1e-12 * size * speed**2
    for k in range(3 * n, len(plain), 4):
        turning = plain[k] * along[k + 1] - plain[k + 1] * along[k]
        assert np.max(np.abs(turning - plain[k + 2])) < 1e-12 * speed
        assert np.max(np.abs(along[k + 2] - plain[k + 3])) < 1e-11 * speed**2


def test_points_for_drawing_are_those_of_frame_and_bodies_with_centres_of_mass():
    _, linkage = derived("offset slider")
    assert [(p.body, p.point) for p in linkage.points] == [
        ("frame", "A"),
        ("frame", "guide"),
        ("crank", "A"),
        ("crank", "B"),
        ("crank", "center_of_mass"),
        ("rod", "B"),
        ("rod", "C"),
        ("rod", "center_of_mass"),
        ("slider", "C"),
        ("slider", "D"),
        ("slider", "tool"),
        ("slider", "center_of_mass"),
    ]


def test_crank_slider_equals_the_textbook_stroke():
    """Slider below A on its line: y = l1 sin(theta) − sqrt(l2² − l1² cos²(theta))."""
    machine, linkage = derived("crank-slider")
    x, y = evaluate(machine, linkage.motion("slider", "C").position, TURN, linkage)
    expected = 6e-3 * np.sin(TURN) - np.sqrt(0.1**2 - (6e-3 * np.cos(TURN)) ** 2)
    assert np.max(np.abs(y - expected)) < 1e-16
    assert np.max(np.abs(x)) < 1e-16


@pytest.mark.parametrize(("branch", "sign"), [("left", 1.0), ("right", -1.0)])
def test_four_bar_equals_the_law_of_cosines(branch, sign):
    """The angle at B between the line B–D and the coupler, by arccos; the branch gives its sense."""
    machine = four_bar(branch)
    linkage = machine.linkage()
    pin = 0.05 * np.exp(1j * TURN)
    line = (0.2 + 0.03j) - pin
    opening = np.arccos((np.abs(line) ** 2 + 0.19**2 - 0.13**2) / (2 * np.abs(line) * 0.19))
    expected = pin + 0.19 * np.exp(1j * (np.angle(line) + sign * opening))
    x, y = evaluate(machine, linkage.motion("coupler", "C").position, TURN, linkage)
    assert np.max(np.abs(x + 1j * y - expected)) < 1e-15


def test_branch_of_rrr_is_the_side_of_the_line_between_the_outer_joints():
    """Read off the placed points, with the inner joint's bodies in either order."""
    for branch, side in (("left", 1), ("right", -1)):
        for bodies in (("coupler", "rocker"), ("rocker", "coupler")):
            machine = four_bar().with_joint("C", bodies=bodies, branch=branch)
            linkage = machine.linkage()
            outer = {"coupler": "B", "rocker": "D"}
            start = linkage.motion(bodies[0], outer[bodies[0]]).position
            end = linkage.motion(bodies[1], outer[bodies[1]]).position
            inner = linkage.motion("coupler", "C").position
            x0, y0, x1, y1, x, y = evaluate(machine, [*start, *end, *inner], TURN, linkage)
            assert np.all(side * ((x1 - x0) * (y - y0) - (y1 - y0) * (x - x0)) > 0)


@pytest.mark.parametrize("make", [crank_slider, offset_slider, six_bar_slider, moving_guide])
def test_branch_of_rrp_is_ahead_or_behind_along_the_guide(make):
    hinge = {"crank_slider": ("rod", "B", "C"), "offset_slider": ("rod", "B", "C")}
    body, outer, inner = hinge.get(make.__name__, ("link", "E" if make is six_bar_slider else "H", "F"))
    for branch, side in (("ahead", 1), ("behind", -1)):
        machine = make(branch=branch)
        linkage = machine.linkage()
        guide = next(j for j in machine.mechanism.joints if j.kind == "prismatic")
        angle = sp.Symbol(guide.direction.path, real=True)
        along = linkage.pose(guide.bodies[0]).rotate((sp.cos(angle), sp.sin(angle)))
        start = linkage.motion(body, outer).position
        end = linkage.motion(body, inner).position
        reach = dot(along, tuple(b - a for a, b in zip(start, end, strict=True)))
        (values,) = evaluate(machine, [reach], TURN, linkage)
        assert np.all(side * values > 0)


def test_dyads_are_placed_in_the_order_of_dependence_not_of_the_file():
    _, linkage = derived("six-bar with slider")
    assert [(d.kind, d.bodies, d.joints) for d in linkage.dyads] == [
        ("RRR", ("coupler", "rocker"), ("B", "C", "D")),
        ("RRP", ("link", "ram"), ("E", "F", "G")),
    ]
    assert [m.joint for m in linkage.margins] == ["C", "F"]
    _, linkage = derived("watt six-bar")
    assert [d.kind for d in linkage.dyads] == ["RRR", "RRR"]


def test_no_inverse_function_and_one_cosine_of_the_angle():
    for name in MACHINES:
        _, linkage = derived(name)
        expressions = [d.expression for d in linkage.definitions]
        assert not any(e.has(sp.atan2, sp.atan, sp.acos, sp.asin) for e in expressions)
        assert sum(e.has(ANGLE) for e in expressions) == 2


def test_slider_on_the_frame_does_not_turn():
    _, linkage = derived("offset slider")
    pose = linkage.poses["slider"]
    assert (pose.cos, pose.sin, pose.rate, pose.acceleration) == (1, 0, 0, 0)


def test_radicand_of_the_slider_crank_keeps_its_digits_where_the_rod_is_across_the_guide():
    """L² − e² loses half of them at e = L (1 − 1e-9); (L − e)(L + e) does not."""
    machine, linkage = derived("crank-slider")
    definition = next(d for d in linkage.definitions if d.symbol.name == "joint.C.determinant")
    offset = 0.1 * (1 - 1e-9)
    length, e = mpmath.mpf(0.1), mpmath.mpf(offset)
    with mpmath.workdps(50):
        exact = mpmath.sqrt(length**2 - e**2)
    (value,) = Evaluator(linkage.definitions, [definition.symbol])(machine.numbers(0.0, **{"joint.C.offset": offset}))
    assert abs(value / float(exact) - 1) < 1e-15


def test_margin_is_the_squared_sine_of_the_transmission_angle():
    machine, linkage = derived("four-bar")
    inner, outer = (linkage.motion("coupler", p).position for p in ("C", "B"))
    far = linkage.motion("rocker", "D").position
    margin, *rest = evaluate(machine, [linkage.margins[0].expression, *inner, *outer, *far], TURN, linkage)
    xc, yc, xb, yb, xd, yd = (np.broadcast_to(v, TURN.shape) for v in rest)
    sine = np.sin(np.angle(((xb - xc) + 1j * (yb - yc)) / ((xd - xc) + 1j * (yd - yc))))
    assert np.max(np.abs(margin - sine**2)) < 1e-13


# --- refusals: numbers --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["crank-slider", "offset slider", "four-bar", "six-bar with slider", "watt six-bar"])
def test_shipped_linkages_turn_all_the_way(name):
    machine, linkage = derived(name)
    check_assembly(linkage, machine.values)


def test_a_four_bar_that_does_not_reach_at_its_start_is_named_with_joint_and_angle():
    """Coupler and rocker reach 0.20 m; the pin is farther from D than that at 180 deg, where 0.05 + 0.2 m part them."""
    machine = four_bar().with_values(
        mechanism__bodies__coupler__points__C=0.1,
        mechanism__bodies__rocker__points__C=0.1,
        mechanism__frame__points__D__y=0.0,
        mechanism__driver__start_angle=180.0 * DEGREE,
    )
    with pytest.raises(LinkageError, match=r"cannot be assembled at joint C .* 180\.0000 deg") as caught:
        check_assembly(machine.linkage(), machine.values)
    (fault,) = caught.value.faults
    assert fault.key == "mechanism.joints.C"
    assert "B, C, D" in fault.remedy


def test_almost_equal_crank_and_rod_are_accepted():
    machine = crank_slider(crank=0.095, rod=0.1)
    check_assembly(machine.linkage(), machine.values)


def test_rod_of_zero_length_is_refused():
    machine = crank_slider(rod=0.0)
    with pytest.raises(LinkageError, match="joint C"):
        check_assembly(machine.linkage(), machine.values)


def test_dyad_that_fails_behind_another_is_named():
    machine = six_bar_slider().with_values(mechanism__bodies__link__points__F=0.01)
    with pytest.raises(LinkageError, match="joint F") as caught:
        check_assembly(machine.linkage(), machine.values)
    assert [f.key for f in caught.value.faults] == ["mechanism.joints.F"]


# --- refusals: topology -------------------------------------------------------------------------------------------


def of_joints(mechanism: Mechanism, *names: str, more: tuple[Joint, ...] = (), bodies: int | None = None) -> Mechanism:
    """A mechanism of some of another's joints, others, and its first bodies."""
    joints = (*(joint for joint in mechanism.joints if joint.name in names), *more)
    return replace(mechanism, bodies=mechanism.bodies[:bodies], joints=joints)


def hinge(name: str, body: str, *points: str) -> Joint:
    return Joint(name=name, kind="revolute", bodies=("frame", body), points=points, direction=None, branch=None)


def triad() -> Machine:
    """A plate with three hinges, on a rod from the crank and on two rockers."""
    bar = {"mass": 1.0, "inertia": 1e-3}
    return build(
        frame={"A": None, "D": ("xy", 0.2, 0.0), "E": ("xy", 0.1, 0.2)},
        bodies={
            "crank": {**bar, "points": {"A": None, "B": 0.05}},
            "rod": {**bar, "points": {"B": None, "C": 0.1}},
            "plate": {**bar, "points": {"C": None, "F": 0.1, "G": ("xy", 0.05, 0.08)}},
            "left": {**bar, "points": {"F": None, "D": 0.1}},
            "right": {**bar, "points": {"G": None, "E": 0.1}},
        },
        joints={
            "A": {"bodies": ("frame", "crank")},
            "B": {"bodies": ("crank", "rod")},
            "C": {"bodies": ("rod", "plate")},
            "F": {"bodies": ("plate", "left")},
            "G": {"bodies": ("plate", "right")},
            "D": {"bodies": ("left", "frame")},
            "E": {"bodies": ("right", "frame")},
        },
        speed=10.0,
    )


BAR, SLIDER = four_bar().mechanism, crank_slider().mechanism


@pytest.mark.parametrize(
    ("mechanism", "words"),
    [
        (of_joints(BAR, *"ABC"), r"(?s)mobility 3: 9 unknowns .* and 6 equations .*crank, coupler, rocker.*A, B, C"),
        (
            of_joints(BAR, *"ABCD", more=(hinge("X", "coupler", "A", "tool"),)),
            "mobility -1: 9 unkn.* and 10 equations",
        ),
        # a triangle of two bars and the frame
        (of_joints(SLIDER, *"AB", more=(hinge("C", "rod", "guide", "C"),), bodies=2), "mobility 0: 6 unknowns .* 6 eq"),
        (of_joints(SLIDER, *"AB", bodies=2), r"mobility 2: 6 unknowns .* and 4 equations"),
        # the coupler hangs on the frame instead of the crank: a truss beside a crank that turns alone
        (
            four_bar().with_joint("B", bodies=("frame", "coupler"), points=("A", "B")).mechanism,
            r"does not move coupler and rocker: 6 unknowns and 6 equations .* B, C, D",
        ),
        # four bodies hinged in a ring of higher class: no two of them can be placed before the others
        (
            watt_six_bar().with_joint("C", bodies=("coupler", "link"), points=("C", "F"), branch=None).mechanism,
            r"no dyad places the bodies coupler, rocker, link, arm: 12 unknowns .* and 12 equations",
        ),
        (
            triad().mechanism,
            "rod, plate, left, right are placed together alone, an Assur group of class III",
        ),
        (crank_slider().with_joint("C", points=("B", "C")).mechanism, "same point of rod"),
    ],
    ids=[
        "3",
        "-1",
        "truss",
        "chain",
        "beside the driver",
        "no dyad",
        "triad",
        "one point",
    ],
)
def test_what_is_no_linkage_of_one_driver_is_refused_with_the_count(mechanism: Mechanism, words: str) -> None:
    with pytest.raises(LinkageError, match=words):
        derive_linkage(mechanism, DRIVE)


@pytest.mark.parametrize(
    ("make", "joint"), [(crank_slider, "C"), (offset_slider, "C"), (four_bar, "C"), (moving_guide, "F")]
)
def test_missing_branch_is_refused(make, joint):
    with pytest.raises(LinkageError, match="has no branch") as caught:
        make().with_joint(joint, branch=None).linkage()
    (fault,) = caught.value.faults
    assert fault.key == f"mechanism.joints.{joint}.branch"
    assert fault.allowed in ("left or right", "ahead or behind")


@pytest.mark.parametrize(("make", "branch"), [(crank_slider, "left"), (four_bar, "ahead")])
def test_branch_of_another_dyad_is_refused(make, branch):
    with pytest.raises(LinkageError, match="branch of another dyad"):
        make().with_joint("C", branch=branch).linkage()


@pytest.mark.parametrize("joint", ["A", "B", "D"])
def test_branch_where_it_means_nothing_is_refused(joint):
    with pytest.raises(LinkageError, match=f"means nothing at joint {joint}"):
        crank_slider().with_joint(joint, branch="left").linkage()


def test_all_faults_of_a_topology_are_reported_together():
    machine = crank_slider().with_joint("A", branch="left").with_joint("C", branch=None)
    with pytest.raises(SceneError) as caught:
        machine.linkage()
    assert [f.key for f in caught.value.faults] == ["mechanism.joints.A.branch", "mechanism.joints.C.branch"]
    assert "2 faults" in str(caught.value)
