"""Assur dyads, of which linkages are made.  A new kind is a file here and an entry in `DYADS`."""

from ballpass.derive.mechanism.dyads.dyad import Dyad, Group, Margin, Placement
from ballpass.derive.mechanism.dyads.prp import PRP
from ballpass.derive.mechanism.dyads.rpp import RPP
from ballpass.derive.mechanism.dyads.rpr import RPR
from ballpass.derive.mechanism.dyads.rrp import RRP
from ballpass.derive.mechanism.dyads.rrr import RRR

__all__ = ["BRANCHES", "DYADS", "Dyad", "Group", "Margin", "Placement"]

DYADS: tuple[type[Dyad], ...] = (RRR, RRP, RPR, RPP, PRP)

#: All values that `Joint.branch` may have.
BRANCHES: tuple[str, ...] = tuple(dict.fromkeys(branch for dyad in DYADS for branch in dyad.branches))
