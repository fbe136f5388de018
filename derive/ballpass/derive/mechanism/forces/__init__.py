"""Forces and torques on a linkage: tables of the scene file, each with its pathways and the laws that go with them.

A new pathway or law is a file here; an entry in `FORCE_TABLES` says in which table of the scene it may stand.
"""

from ballpass.derive.mechanism.forces.along_direction import AlongDirection
from ballpass.derive.mechanism.forces.angle_table import AngleTable
from ballpass.derive.mechanism.forces.applied import NO_FORCES, Forces, derive_forces, drawn_forces, drawn_springs
from ballpass.derive.mechanism.forces.body_torque import BodyTorque
from ballpass.derive.mechanism.forces.constant import ConstantForce
from ballpass.derive.mechanism.forces.force import ForceTable, Law, Pathway
from ballpass.derive.mechanism.forces.friction import Friction
from ballpass.derive.mechanism.forces.joint_motion import JointMotion, JointTravel, JointTurn
from ballpass.derive.mechanism.forces.piston_pressure import PistonPressure
from ballpass.derive.mechanism.forces.point_force import PointForce
from ballpass.derive.mechanism.forces.spring_damper import SpringDamper
from ballpass.derive.mechanism.forces.stop import Stop
from ballpass.derive.mechanism.forces.two_bodies import TwoBodies
from ballpass.derive.mechanism.forces.two_points import TwoPoints
from ballpass.derive.mechanism.forces.windows import Windows

__all__ = [
    "FORCE_TABLES",
    "BodyTorque",
    "ConstantForce",
    "ForceTable",
    "Forces",
    "Friction",
    "JointMotion",
    "Law",
    "Pathway",
]
__all__ += ["NO_FORCES", "PistonPressure", "PointForce", "Windows", "derive_forces", "drawn_forces", "drawn_springs"]

#: In the order in which their numbers are listed; a force has the pathway and law whose key is given, else the last.
FORCE_TABLES: tuple[ForceTable, ...] = (
    ForceTable(
        "forces", "force", "body, point and force", (PistonPressure, PointForce), (Windows, AngleTable, ConstantForce)
    ),
    ForceTable("torques", "torque", "body and torque", (BodyTorque,), (Windows, AngleTable, ConstantForce)),
    ForceTable("springs", "spring", "bodies, points and stiffness", (TwoPoints,), (SpringDamper,)),
    ForceTable("torsion_springs", "spring", "bodies and stiffness", (TwoBodies,), (SpringDamper,)),
    ForceTable("stops", "stop", "bodies, points, stiffness and free_length", (AlongDirection, TwoPoints), (Stop,)),
    ForceTable("torsion_stops", "stop", "bodies, stiffness and free_angle", (TwoBodies,), (Stop,)),
    ForceTable("friction", "friction", "joint and viscous", (JointTurn,), (Friction,)),
    ForceTable("guide_friction", "friction", "joint and viscous", (JointTravel,), (Friction,)),
)
