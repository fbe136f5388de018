"""The interface of an Assur dyad: it places two bodies at once and solves their joint reactions.

Each kind is one class in a file of its own, listed in `dyads/__init__.py`.  It says which joints form it and what its
branches are called (find), gives the poses of its bodies in closed form (place), and walks its balances (reactions).

Positions need one square root and no inverse function: cosine and sine of a body's angle are the quotient of its span
in the plane and its span in body axes, taken as complex numbers.  Rates follow from the differentiated loop closure,
two equations at a time, by Cramer's rule.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import sympy as sp

from ballpass.derive.mechanism.balance import Balance, Guide, JointAction
from ballpass.derive.mechanism.kinematics import Ledger, Motion, Play, Pose, displaced, joint_point, name_joint
from ballpass.derive.mechanism.vectors import Pair
from ballpass.derive.scene.mechanism_records import Joint, Mechanism
from ballpass.derive.terms import subscript
from ballpass.derive.variables import Words


@dataclass(frozen=True, slots=True, kw_only=True)
class Margin:
    """Where a dyad can be assembled: `expression` [1] is positive inside, zero at the limit, negative outside."""

    joint: str
    expression: sp.Expr
    description: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Group(ABC):
    """Bodies that are placed together: a dyad, or a wheel in mesh.

    Attributes
    ----------
    bodies, hosts : what is placed, and the bodies already placed that carry or turn them
    """

    bodies: tuple[str, ...]
    hosts: tuple[str, ...]

    @property
    @abstractmethod
    def joints(self) -> tuple[str, ...]:
        """Names of the joints that the bodies are placed by."""

    @property
    def outputs(self) -> Sequence[Words]:
        """Of what `solve` defines besides reactions."""
        return ()

    @property
    def circles(self) -> tuple[str, str, str, str, float] | None:
        """Bodies and points on the axes of two wheels in mesh, and the first one's share of their distance."""
        return None

    def meshing(self, placement: Placement) -> JointAction | None:
        """A contact of the bodies that is no joint of the mechanism."""
        return None

    @abstractmethod
    def place(self, ledger: Ledger, mechanism: Mechanism, poses: Mapping[str, Pose], play: Play) -> Placement:
        """Place the bodies on those in `poses`, writing the definitions into `ledger`.

        Where a joint has `play`, each body has a point of its own there.

        Raises
        ------
        LinkageError
            a body whose two joints of a dyad sit on one and the same point; play that moves an axis of a gear.
        """

    @abstractmethod
    def solve(self, ledger: Ledger, balance: Balance, placement: Placement) -> None:
        """Define the reactions of the group's joints; those of later groups are known to `balance`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Dyad(Group):
    """Two bodies with a joint between them, each with one joint to a body already placed.

    Attributes
    ----------
    kind : R (revolute) or P (prismatic) for each of outer joint of the first body, inner joint, outer joint of the
        second
    branches : values of `Joint.branch` at the inner joint; the first has the sign +1.  A dyad with one position has
        one, which a scene may leave out
    words : its joints, for messages
    bodies : in the order of `kind`; where that can be read from both ends, in the order of the inner joint's bodies
    hosts : the bodies already placed that carry them
    outer, inner : joints, `outer` in the order of `bodies`
    """

    kind: ClassVar[str]
    branches: ClassVar[tuple[str, ...]]
    words: ClassVar[str]

    bodies: tuple[str, str]
    hosts: tuple[str, str]
    outer: tuple[Joint, Joint]
    inner: Joint

    @classmethod
    def find(cls, inner: Joint, outer: tuple[Joint, Joint]) -> Self | None:
        """The dyad of these joints; None where they form another one.

        Parameters
        ----------
        inner : joint between two bodies that have no place yet
        outer : the joint of each of them to a body already placed, in the order of ``inner.bodies``
        """
        letters = {"revolute": "R", "prismatic": "P"}
        for order in ((0, 1), (1, 0)):
            joints = (outer[order[0]], inner, outer[order[1]])
            if "".join(letters[joint.kind] for joint in joints) == cls.kind:
                first, second = (inner.bodies[k] for k in order)
                one, two = (outer[k] for k in order)
                hosts = (one.other(first), two.other(second))
                return cls(bodies=(first, second), hosts=hosts, outer=(one, two), inner=inner)
        return None

    @property
    def joints(self) -> tuple[str, str, str]:
        """Names: outer joint of the first body, inner joint, outer joint of the second body."""
        return self.outer[0].name, self.inner.name, self.outer[1].name

    @property
    def sign(self) -> int:
        """+1 on the first of the branches, −1 on the second."""
        return 1 if self.inner.branch in (None, self.branches[0]) else -1

    def closing(self, second: Motion, play: Play) -> Motion:
        """A point of the second body, shifted so that the loop closes as if the inner joint had no play."""
        return displaced(second, play.get(self.inner.name), -1 if self.inner.bodies[0] == self.bodies[0] else 1)

    @abstractmethod
    def branch_meaning(self) -> str:
        """The choice between the branches, as "on which side of ... the joint lies"."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Placement:
    """A group once it is placed.

    Attributes
    ----------
    dyad : what was placed
    poses : of its bodies, in their order
    spans : vectors [m] that the reactions need; each kind says which
    determinant : of the 2×2 systems for rates and forces
    margin : where it can be assembled
    guides : of its prismatic joints
    """

    dyad: Group
    poses: tuple[Pose, ...]
    spans: tuple[Pair, ...] = ()
    determinant: sp.Expr
    margin: Margin
    guides: tuple[Guide, ...] = ()


def name_hinge(ledger: Ledger, mechanism: Mechanism, joint: Joint, host: Pose, play: Play) -> Motion:
    """Motion of the point that a new body has at a revolute joint on a body already placed.

    That of the host is named ``joint.<name>.x`` and so on; where the joint has play, that of the new body ``joint.
    <name>.<body>.x``.
    """
    motion = name_joint(ledger, joint, host.motion(joint_point(mechanism, joint, host.body)))
    if joint.name not in play:
        return motion
    body = joint.other(host.body)
    moved = displaced(motion, play[joint.name], 1 if joint.bodies[1] == body else -1)
    words, mark = f"joint {joint.name} on {body}", f"{subscript(joint.name)},{subscript(body)}"
    return ledger.name_motion(f"joint.{joint.name}.{body}", moved, words, mark)


def name_rate(ledger: Ledger, body: str, rate: sp.Expr) -> sp.Expr:
    """Name the angular velocity of a body."""
    latex = rf"\dot{{\varphi}}_{{{subscript(body)}}}"
    return ledger.name(f"body.{body}.rate", rate, "rad/s", f"angular velocity of {body}", latex)


def name_acceleration(ledger: Ledger, body: str, acceleration: sp.Expr) -> sp.Expr:
    """Name the angular acceleration of a body."""
    latex = rf"\ddot{{\varphi}}_{{{subscript(body)}}}"
    name = f"body.{body}.angular_acceleration"
    return ledger.name(name, acceleration, "rad/s^2", f"angular acceleration of {body}", latex)
