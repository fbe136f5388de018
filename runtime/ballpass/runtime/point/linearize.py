"""Small vibrations about a state: mass, damping and stiffness matrices, natural frequencies, modes.

In: a model, numbers, an instant, a state.  Out: a `Linearization` of M q'' = f(q, q', t):

    M dq'' + C dq' + K dq = 0,    K = -df/dq,    C = -df/dq',

with time frozen: the balls stand where they are at that instant, while their passing (the cage's speed) still enters
the rates of deflection, as in the right-hand side itself.  Eigenvalues are those of the generalised problem of first
order (F. Tisseur, K. Meerbergen, SIAM Review 43 (2001) 235, doi:10.1137/S0036144500381988).
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ballpass.runtime.contract.errors import SimulationError
from ballpass.runtime.contract.extras import need
from ballpass.runtime.contract.parameters import Numbers
from ballpass.runtime.native.loaded_model import LoadedModel
from ballpass.runtime.point.evaluate import point
from ballpass.runtime.point.jacobian import RHS, STATES, directions_of, rows_of
from ballpass.runtime.point.slopes import Deflections, KinkWarning, Point, Slopes, named, slopes
from ballpass.runtime.ratings.of_bearing import bearing_words
from ballpass.runtime.report.report import Report, ReportTable
from ballpass.runtime.report.reported import Reported
from ballpass.runtime.report.short_words import head_lines, names_in_words
from ballpass.runtime.request.magnitudes import mass_matrix

Array = NDArray[np.float64]

#: Eigenvalues below this fraction of the largest are zero but for rounding [1].
RIGID = 1e-7

#: Entries of a matrix below this fraction of its largest are zero but for rounding [1].
ROUNDING = 1e-14

#: How much faster than any ball's deflection changes at rest a vibration is whose balls all change sides [1].
FASTER = 1e3

#: Damping that differs by more than this depends on how fast the vibration is [1].
ALIKE = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mode:
    """A way to vibrate or to decay.

    Attributes
    ----------
    eigenvalue : of the motion exp(eigenvalue t) [1/s]; of a conjugate pair the one with positive imaginary part
    natural_frequency : absolute value of the eigenvalue over 2 pi [Hz]
    damped_frequency : Im(eigenvalue) / (2 pi) [Hz]; 0 for a decay without vibration
    damping_ratio : -Re(eigenvalue) over its absolute value [1]; NaN for a rigid mode
    shape : complex displacement of each coordinate, the largest 1, shape (coordinates,)

    Examples
    --------
    >>> mode = model.linearize(crank_angle=4.2).modes[0]
    >>> round(mode.natural_frequency), round(mode.damping_ratio, 3)  # [Hz], [1]
    (1064, 0.038)
    """

    eigenvalue: complex
    natural_frequency: float
    damped_frequency: float
    damping_ratio: float
    shape: NDArray[np.complex128]

    @property
    def rigid(self) -> bool:
        """Whether nothing restrains this mode."""
        return self.natural_frequency == 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Linearization(Reported):
    """Matrices and modes of small vibrations.

    Attributes
    ----------
    coordinates, descriptions : names of the positions, and what each is
    mass : M, shape (coordinates, coordinates) [kg]
    damping : C, same shape [N*s/m]
    stiffness : K, same shape [N/m]
    modes : by increasing natural frequency
    x : the state, shape (states,)
    time : the instant [s]
    at_equilibrium : whether the state is the static equilibrium of that instant
    unbalanced : accelerations left at the state, largest [m/s^2]
    notes : what does not hold without reserve, for people
    passing : fastest rate of a ball's deflection while the rings rest; 0 where the law has no corner there [m/s]
    faster_modes : modes of vibrations in which balls approach faster than `passing` and part as fast: under a law that
        damps on one side each ball damps half of the time; empty where that makes no difference

    Examples
    --------
    >>> small = model.linearize(crank_angle=4.2)  # [rad]
    >>> small.stiffness.shape, small.natural_frequencies.round()  # [N/m], [Hz]
    ((4, 4), array([1064., 1108., 2923., 4180.]))
    """

    coordinates: tuple[str, ...]
    descriptions: tuple[str, ...]
    mass: Array
    damping: Array
    stiffness: Array
    modes: tuple[Mode, ...]
    x: Array
    time: float
    at_equilibrium: bool
    unbalanced: float
    notes: tuple[str, ...]
    passing: float = 0.0
    faster_modes: tuple[Mode, ...] = ()

    def __repr__(self) -> str:
        frequencies = ", ".join(f"{m.natural_frequency:.6g}" for m in self.modes)
        where = "equilibrium" if self.at_equilibrium else "given state"
        return f"Linearization({where} at t = {self.time:.6g} s; natural frequencies {frequencies} Hz)"

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """All of them, pairs complete, shape (2 coordinates,) [1/s]."""
        pairs = [m.eigenvalue for m in self.modes] + [m.eigenvalue.conjugate() for m in self.modes if m.eigenvalue.imag]
        return np.array(sorted(pairs, key=lambda z: (abs(z), z.imag)))

    @property
    def natural_frequencies(self) -> Array:
        """Of the modes, shape (modes,) [Hz]."""
        return np.array([m.natural_frequency for m in self.modes])

    @property
    def damping_ratios(self) -> Array:
        """Of the modes, shape (modes,) [1]."""
        return np.array([m.damping_ratio for m in self.modes])

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers and lists for JSON; complex numbers as pairs, what is not defined as null.

        Examples
        --------
        >>> model.linearize(crank_angle=4.2).to_dict()["stiffness"]["unit"]
        'N/m'
        """
        return self.to_json()

    def _report(self) -> Report:
        def numbers(mode: Mode) -> dict[str, Any]:
            return {name: {"value": getattr(mode, name), "unit": unit} for name, unit in _UNITS.items()}

        facts = {
            "time": {"value": self.time, "unit": "s"},
            "at_equilibrium": self.at_equilibrium,
            "coordinates": list(self.coordinates),
            "state": self.x.tolist(),
            "mass": {"value": self.mass.tolist(), "unit": "kg"},
            "damping": {"value": self.damping.tolist(), "unit": "N*s/m"},
            "stiffness": {"value": self.stiffness.tolist(), "unit": "N/m"},
            "modes": [
                {
                    "eigenvalue": [mode.eigenvalue.real, mode.eigenvalue.imag],
                    **numbers(mode),
                    "shape": [[z.real, z.imag] for z in mode.shape.tolist()],
                }
                for mode in self.modes
            ],
            "passing": {"value": self.passing, "unit": "m/s"},
            "faster_modes": list(map(numbers, self.faster_modes)),
            "notes": list(self.notes),
        }
        tables = (_modes_table(self), *_faster_table(self), _matrices_table(self))
        records = [{name: getattr(mode, name) for name in _UNITS} for mode in self.modes]
        return Report(parts=tables, facts=facts, records=records)


def linearize(
    model: LoadedModel, numbers: Numbers, *, t: float, x: Sequence[float] | np.ndarray | None, at_equilibrium: bool
) -> Linearization:
    """Linearise about a state; see `ballpass.runtime.Model.linearize`.

    Raises
    ------
    SimulationError
        The derivatives are not finite there.
    """
    there = point(model, numbers, t, x)
    count = len(model.states)
    half = count // 2
    found = slopes(model, rows_of(model, RHS), directions_of(model, numbers, STATES, t), there)
    jacobian = found.value
    if not np.all(np.isfinite(jacobian)):
        raise SimulationError("linearize: the derivatives at this state are not finite. Check state and parameters.")
    mass = mass_matrix(model, there)
    stiffness, damping = -mass @ jacobian[half:, :half], -mass @ jacobian[half:, half:]
    state = np.asarray(there["x"], dtype=float)
    modes = _modes(mass, damping, stiffness)
    passing, other = _faster_damping(model, numbers, there, mass, damping, t)
    differ = np.max(np.abs(other - damping)) > ALIKE * np.max(np.abs(other))
    faster = _modes(mass, other, stiffness) if differ else ()
    notes = (*_sides(found, mass, model.states[:half]), *onset_notes(model, there))
    if faster:
        notes += (_faster_note(model, modes, faster, passing),)
    for note in notes:
        warnings.warn(f"linearize: {note}", KinkWarning, stacklevel=3)
    return Linearization(
        coordinates=model.states[:half],
        descriptions=tuple(state.description for state in model.manifest.states[:half]),
        mass=mass,
        damping=damping,
        stiffness=stiffness,
        modes=modes,
        x=state,
        time=t,
        at_equilibrium=at_equilibrium,
        unbalanced=float(np.max(np.abs(model.kernel("rhs")(there)[half:]))),
        notes=notes,
        passing=passing,
        faster_modes=faster,
    )


def _faster_damping(
    model: LoadedModel, numbers: Numbers, there: Point, mass: Array, damping: Array, t: float
) -> tuple[float, Array]:
    """Fastest rate of a ball's deflection at a state [m/s], and the damping of vibrations much faster than that.

    That is the mean over both directions in which a coordinate moves; `damping` itself where no law has a corner at
    rest, or no ball a rate.
    """
    half, x = len(mass), np.asarray(there["x"], dtype=float)
    passing, reach = 0.0, np.zeros(half)
    for bearing in model.manifest.bearings:
        if bearing.damping.corner_at_rest:
            balls = Deflections(model, bearing, there)
            passing = max(passing, float(np.max(np.abs(balls.rate))))
            reach = np.maximum(reach, np.max(np.abs(balls.by_positions), axis=0))
    found = damping.copy()
    for k, moved in enumerate(reach.tolist()):
        # the driver's speed is no vibration
        if passing == 0.0 or moved == 0.0 or model.manifest.coordinates[k].kind != "displacement":
            continue
        found[:, k] = 0.0
        for side in (1.0, -1.0):
            fast = x.copy()
            fast[half + k] += side * FASTER * passing / moved
            directions = directions_of(model, numbers, STATES, t)
            slope = slopes(model, rows_of(model, RHS), directions, {**there, "x": fast}).value
            found[:, k] -= 0.5 * (mass @ slope[half:, half + k])
    return passing, found


def _faster_note(model: LoadedModel, modes: Sequence[Mode], faster: Sequence[Mode], passing: float) -> str:
    laws = {bearing.damping.law for bearing in model.manifest.bearings if bearing.damping.corner_at_rest}
    least, other = (min((m.damping_ratio for m in some if not m.rigid), default=math.nan) for some in (modes, faster))
    words = (
        f"the law {' and '.join(sorted(laws))} damps approach only, and the balls pass at up to {passing:.2g} m/s "
        "while the rings rest: a ball that parts, however slowly, counts as undamped, and one that approaches as "
        "damped all the time. That holds for slower vibrations. In any faster one each ball damps half of the time: "
        f"the least ratio is then {other:.3g} instead of {least:.3g}."
    )
    return bearing_words(words, model.manifest.bearings)


def _modes(mass: Array, damping: Array, stiffness: Array) -> tuple[Mode, ...]:
    """Modes of A z = lambda B z with z = (q, q'), A = [[0, I], [-K, -C]], B = [[I, 0], [0, M]]."""
    n = len(mass)
    zero, one = np.zeros((n, n)), np.eye(n)
    # one unit of time for all: positions and velocities of the same size, so that rounding spares the slow modes
    unit = math.sqrt(max(float(np.max(np.abs(np.linalg.solve(mass, stiffness)))), 1e-300))
    left = np.block([[zero, one], [-stiffness / unit**2, -damping / unit]])
    right = np.block([[one, zero], [zero, mass]])
    linalg = need("scipy.linalg")  # here: the import takes longer than a run

    values, vectors = linalg.eig(left, right)
    values = values * unit
    largest = float(np.max(np.abs(values)))
    modes = []
    for value, vector in zip(values.tolist(), vectors.T, strict=True):
        if value.imag < 0.0:
            continue
        shape = vector[:n]
        shape = shape / shape[int(np.argmax(np.abs(shape)))]
        if abs(value) <= RIGID * largest:
            value = 0j
        size = abs(value)
        modes.append(
            Mode(
                eigenvalue=value,
                natural_frequency=size / (2.0 * math.pi),
                damped_frequency=value.imag / (2.0 * math.pi),
                damping_ratio=-value.real / size if size else math.nan,
                shape=shape,
            )
        )
    return tuple(sorted(modes, key=lambda m: (m.natural_frequency, m.eigenvalue.imag)))


def _sides(found: Slopes, mass: Array, coordinates: Sequence[str]) -> tuple[str, ...]:
    """That the sides of the derivatives differ, with the damping on each; empty where they agree."""
    half = len(mass)
    below, above = (-np.diag(mass @ side[half:, half:]) for side in (found.below, found.above))
    pairs = "; ".join(f"{n} {a:.6g} or {b:.6g}" for n, a, b in zip(coordinates, below, above, strict=True) if a != b)
    words = f"A harmonic vibration loses energy by the mean. Damping on either side, N*s/m: {pairs}."
    return tuple(f"{note} {words}" for note in found.notes())


def onset_notes(model: LoadedModel, there: Point) -> tuple[str, ...]:
    """A sentence where balls are at contact onset and the damping law has no derivative there."""
    notes = []
    for bearing in model.manifest.bearings:
        if bearing.damping.in_deflection not in ("kinked", "discontinuous"):
            continue
        found = Deflections(model, bearing, there)
        jumps = bearing.damping.in_deflection == "discontinuous"
        touching = [k for k in found.at_onset() if abs(found.rate[k]) > 0.0 or jumps]
        if touching:
            notes.append(
                f"the law {bearing.damping.law} has no derivative at contact onset, where {named(bearing, touching)} "
                f"stands: the derivative is that of the free side. Give {bearing.path}.contact.smoothing, and there "
                "is one derivative."
            )
    return tuple(notes)


#: Numbers of a mode, and their columns.
_UNITS = {"natural_frequency": "Hz", "damped_frequency": "Hz", "damping_ratio": "1"}
_COLUMNS: dict[str, Callable[[Mode], str]] = {
    ">natural\n[Hz]": lambda mode: f"{mode.natural_frequency:.6g}",
    ">damped\n[Hz]": lambda mode: f"{mode.damped_frequency:.6g}",
    ">damping\nratio": lambda mode: "" if mode.rigid else f"{mode.damping_ratio:.4g}",
}


def _modes_table(result: Linearization) -> ReportTable:
    where = "static equilibrium" if result.at_equilibrium else "given state"
    words = "Damping ratio: over critical damping. Shapes: size and phase of each coordinate, the largest 1."
    coordinates = names_in_words(dict(zip(result.coordinates, result.descriptions, strict=True)))
    shapes: dict[str, Callable[[Mode], str]] = {
        f">{head_lines(name)}": lambda mode, k=k: _polar(complex(mode.shape[k]))  # type: ignore[misc]
        for k, name in enumerate(result.coordinates)
    }
    return ReportTable.of(
        result.modes,
        _COLUMNS | shapes,
        title=f"Small vibrations about the {where} at t = {result.time:.6g} s",
        caption="\n".join((words, coordinates, *result.notes)),
    )


def _faster_table(result: Linearization) -> tuple[ReportTable, ...]:
    """Frequencies and ratios of vibrations faster than the balls pass, where they are others."""
    if not result.faster_modes:
        return ()
    title = f"The same in vibrations faster than {result.passing:.2g} m/s"
    return (ReportTable.of(result.faster_modes, _COLUMNS, title=title),)


def _polar(z: complex) -> str:
    """Size and phase [deg]; a size that rounds to zero has no phase."""
    size = f"{abs(z):.2f}"
    phase = round(math.degrees(math.atan2(z.imag, z.real)))
    return "0" if float(size) == 0.0 else f"{size}∠{180 if phase == -180 else phase}°"


def _matrices_table(result: Linearization) -> ReportTable:
    """Mass, damping and stiffness as one table, a row for each coordinate."""
    matrices = (
        (("mass", "[kg]"), result.mass),
        (("damping", "[N·s/m]"), result.damping),
        (("stiffness", "[N/m]"), result.stiffness),
    )
    rows = [
        (words[k] if k < 2 else "", name, *(_entry(value, float(np.max(np.abs(matrix)))) for value in row))
        for words, matrix in matrices
        for k, (name, row) in enumerate(zip(result.coordinates, matrix.tolist(), strict=True))
    ]
    heads = tuple(map(head_lines, result.coordinates))
    return ReportTable(heads=("matrix", "row", *heads), rows=rows, right=heads)


def _entry(value: float, largest: float) -> str:
    """An entry of a matrix; what rounding leaves beside the largest one is zero."""
    return "0" if abs(value) <= ROUNDING * largest else f"{value:.5g}"
