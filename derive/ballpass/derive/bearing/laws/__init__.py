"""Damping laws of a ball, one file each, and the contact they act in.  A new law is a file and a line here."""

from ballpass.derive.bearing.laws.hunt_crossley import HuntCrossley
from ballpass.derive.bearing.laws.law import DampingLaw
from ballpass.derive.bearing.laws.no_damping import NoDamping
from ballpass.derive.bearing.laws.one_sided import OneSided
from ballpass.derive.bearing.laws.one_sided_gated import OneSidedGated
from ballpass.derive.bearing.laws.tangent import Tangent
from ballpass.derive.bearing.laws.two_sided_gated import TwoSidedGated
from ballpass.runtime.contract.plugins import Registry

#: Laws by their name in the scene file.
LAWS: Registry[DampingLaw] = Registry(
    "damping_laws",
    "damping law",
    DampingLaw,
    (NoDamping(), OneSided(), OneSidedGated(), TwoSidedGated(), Tangent(), HuntCrossley()),
)

__all__ = ["LAWS", "DampingLaw"]
