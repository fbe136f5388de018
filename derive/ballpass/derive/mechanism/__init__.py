"""Planar linkages: order of assembly, kinematics, reactions."""
