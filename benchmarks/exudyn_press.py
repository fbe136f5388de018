"""The press with its crank's bearings coupled both ways, built in Exudyn.

In: numbers of ``scenes/punching_press_two_way.toml``.  Out: states at the output points of one turn from its start.

Two rigid bodies, two mass points, revolute joints and a guide as constraints, the crank's angle prescribed.  All balls
are one connector whose force is a symbolic user function: Exudyn evaluates it in C++, Python is not called while it
integrates.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from benchmarks.contenders import UnavailableError

#: Integrators that take constraints; its explicit ones do not.
INTEGRATORS = ("GeneralizedAlpha", "TrapezoidalIndex2")


def exudyn() -> Any:
    """The module.

    Raises
    ------
    UnavailableError
        It is not installed.
    """
    try:
        return importlib.import_module("exudyn")
    except ImportError as error:
        raise UnavailableError("not installed") from error


class ExudynPress:
    """The machine, assembled anew for every run.

    Parameters
    ----------
    numbers : parameters and derived constants of the scene by name, SI
    balls : of each bearing
    """

    def __init__(self, numbers: Mapping[str, float], balls: int) -> None:
        self.exudyn, self.items = exudyn(), importlib.import_module("exudyn.itemInterface")
        self.symbolic_function = importlib.import_module("exudyn.utilities").CreateSymbolicUserFunction
        self.n, self.balls = numbers, balls
        self.speed = numbers["mechanism.driver.speed"]
        self.functions: list[Any] = []  # Exudyn keeps no reference to them

    def solve(self, step: float, integrator: str, times: np.ndarray) -> np.ndarray:
        """Displacements of the inner and the outer ring at times of one turn.

        Parameters
        ----------
        step : of time, shortened a little to end on the edges of the punch's window [s]
        integrator : one of `INTEGRATORS`
        times : from 0 to one turn [s], shape (n,)

        Returns
        -------
        numpy.ndarray
            x, y of both rings, from where they start [m], shape (n, 4).
        """
        system, punch, bodies = self._assembled()
        turn = 2 * math.pi / self.speed
        window = (self.n[f"mechanism.forces.punch.window.{end}"] / self.speed for end in ("start", "end"))
        sensors = [self._sensor(system, body, kind) for body in bodies for kind in ("Coordinates", "Coordinates_t")]
        system.Assemble()
        pieces = []
        for (begin, end), gate in zip(pairwise((0.0, *window, turn)), (0.0, 1.0, 0.0), strict=True):
            system.SetLoadParameter(punch, "loadVector", [0, gate * self.n["mechanism.forces.punch.force.y"], 0])
            steps = max(1, math.ceil((end - begin) / step))
            system.SolveDynamic(
                self._settings(begin, end, steps), solverType=getattr(self.exudyn.DynamicSolverType, integrator)
            )
            pieces.append([np.array(system.GetSensorStoredData(sensor)) for sensor in sensors])
            self._continue(system)
        crank, crank_rate, outer, outer_rate = (np.vstack(parts) for parts in zip(*pieces, strict=True))
        clock, first = np.unique(crank[:, 0], return_index=True)
        motion = [
            CubicHermiteSpline(clock, place[first, 1:3], rate[first, 1:3])(times)
            for place, rate in ((crank, crank_rate), (outer, outer_rate))
        ]
        return np.hstack(motion)

    def _settings(self, begin: float, end: float, steps: int) -> Any:
        settings = self.exudyn.SimulationSettings()
        settings.solutionSettings.writeSolutionToFile = False
        settings.solutionSettings.sensorsWritePeriod = 0.5 * (end - begin) / steps
        settings.linearSolverType = self.exudyn.LinearSolverType.EXUdense
        integration = settings.timeIntegration
        integration.verboseMode = 0
        integration.startTime, integration.endTime, integration.numberOfSteps = begin, end, steps
        integration.newton.useModifiedNewton = True
        integration.generalizedAlpha.spectralRadius = 0.8
        return settings

    def _continue(self, system: Any) -> None:
        """The next piece begins where this one ended."""
        data, kinds = system.systemData, self.exudyn.ConfigurationType
        data.SetODE2Coordinates(data.GetODE2Coordinates(kinds.Current), kinds.Initial)
        data.SetODE2Coordinates_t(data.GetODE2Coordinates_t(kinds.Current), kinds.Initial)

    def _sensor(self, system: Any, node: int, kind: str) -> Any:
        variable = getattr(self.exudyn.OutputVariableType, kind)
        return system.AddSensor(
            self.items.SensorNode(nodeNumber=node, outputVariableType=variable, storeInternal=True, writeToFile=False)
        )

    def _assembled(self) -> tuple[Any, int, tuple[int, int]]:
        """System, number of the punch's load, nodes of crank and outer ring; rings concentric and at rest."""
        n, items = self.n, self.items
        system = self.exudyn.SystemContainer().AddSystem()
        radius, length = n["mechanism.bodies.crank.points.B"], n["mechanism.bodies.rod.points.C"]
        middle, count = n["mechanism.bodies.rod.center_of_mass"], n["bearing.count"]
        below = -math.sqrt(length**2 - radius**2)
        tilt, sinking = math.atan2(below, -radius), self.speed * radius  # the rod does not turn at crank angle 0
        masses = {body: n[f"mechanism.bodies.{body}.mass"] for body in ("crank", "rod", "slider")}
        masses["outer"] = count * n["bearing.outer_ring.mass"]
        places: dict[str, tuple[list[float], list[float]]] = {
            "crank": ([0, 0, 0], [0, 0, self.speed]),
            "rod": ([radius + middle * math.cos(tilt), middle * math.sin(tilt), tilt], [0, sinking, 0]),
            "slider": ([0, below], [0, sinking]),
            "outer": ([0, 0], [0, 0]),
        }
        nodes, bodies = {}, {}
        for name, (place, rates) in places.items():
            turns = len(place) == 3
            node = items.NodeRigidBody2D if turns else items.NodePoint2D
            nodes[name] = system.AddNode(node(referenceCoordinates=place, initialVelocities=rates))
            inertia = {"physicsInertia": n[f"mechanism.bodies.{name}.inertia"]} if turns else {}
            body = items.ObjectRigidBody2D if turns else items.ObjectMassPoint2D
            bodies[name] = system.AddObject(body(physicsMass=masses[name], nodeNumber=nodes[name], **inertia))

        def point(body: int, along: float = 0.0) -> Any:
            return system.AddMarker(items.MarkerBodyPosition(bodyNumber=body, localPosition=[along, 0, 0]))

        def coordinate(node: int, index: int) -> Any:
            return system.AddMarker(items.MarkerNodeCoordinate(nodeNumber=node, coordinate=index))

        rod = (point(bodies["rod"], -middle), point(bodies["rod"], length - middle))
        system.AddObject(items.ObjectJointRevolute2D(markerNumbers=[point(bodies["crank"], radius), rod[0]]))
        system.AddObject(items.ObjectJointRevolute2D(markerNumbers=[rod[1], point(bodies["slider"])]))
        fixed = coordinate(system.AddNode(items.NodePointGround()), 0)
        system.AddObject(items.ObjectConnectorCoordinate(markerNumbers=[fixed, coordinate(nodes["slider"], 0)]))
        for name, mass in masses.items():
            weight = [0, -mass * n["mechanism.gravity"], 0]
            system.AddLoad(items.LoadForceVector(markerNumber=point(bodies[name]), loadVector=weight))
        punch = system.AddLoad(items.LoadForceVector(markerNumber=point(bodies["slider"]), loadVector=[0, 0, 0]))
        stiffness, damping = (count * n[f"bearing.outer_ring.{key}"] for key in ("stiffness", "damping"))
        ends = [point(system.AddObject(items.ObjectGround())), point(bodies["outer"])]
        system.AddObject(
            items.ObjectConnectorCartesianSpringDamper(
                markerNumbers=ends, stiffness=[stiffness, stiffness, 0], damping=[damping, damping, 0]
            )
        )
        bearing = system.AddObject(
            items.ObjectConnectorCartesianSpringDamper(
                markerNumbers=[ends[1], point(bodies["crank"])], stiffness=[1, 1, 1], damping=[1, 1, 1]
            )
        )
        drive = system.AddObject(
            items.ObjectConnectorCoordinate(
                markerNumbers=[fixed, coordinate(nodes["crank"], 2)],
                offset=self.speed,
                offsetUserFunction=lambda mbs, t, item, speed: speed * t,
                offsetUserFunction_t=lambda mbs, t, item, speed: speed,
            )
        )
        self.functions.clear()
        self._replace(system, bearing, "springForceUserFunction", self._forces())
        self._replace(system, drive, "offsetUserFunction", lambda mbs, t, item, speed: speed * t)
        self._replace(system, drive, "offsetUserFunction_t", lambda mbs, t, item, speed: speed)
        system.Assemble()
        return system, punch, (nodes["crank"], nodes["outer"])

    def _replace(self, system: Any, item: int, name: str, function: Any) -> None:
        """A function of an item as a symbolic one."""
        self.functions.append(self.symbolic_function(system, function, name, item))
        system.SetObjectParameter(item, name, self.functions[-1])

    def _forces(self) -> Any:
        """Force of all balls of all bearings side by side: Hertz, and Eq. (10) as printed."""
        n, symbolic, balls = self.n, self.exudyn.symbolic, self.balls
        cage, first, half = n["bearing.cage_speed"], n["bearing.ball_angle"], 0.5 * n["bearing.clearance"]

        def force(mbs: Any, t: Any, item: Any, u: Any, v: Any, stiffness: Any, damping: Any, offset: Any) -> Any:
            x, y = 0.0, 0.0
            for ball in range(balls):
                angle = cage * t + (first + 2 * math.pi * ball / balls)
                co, si = symbolic.cos(angle), symbolic.sin(angle)
                deflection = symbolic.max(u[0] * co + u[1] * si - half, 0.0)
                rate = (v[0] + cage * u[1]) * co + (v[1] - cage * u[0]) * si
                load = n["bearing.k_b"] * deflection * symbolic.sqrt(deflection)
                load = n["bearing.count"] * (load + n["bearing.c_b"] * symbolic.max(rate, 0.0))
                x, y = x + load * co, y + load * si
            return symbolic.Vector([x, y, 0.0])

        return force
