"""Strength and life of bearings: what a report holds.

Numbers are SI, lives in turns of the inner ring against the outer one, angles in rad.  Places of a raceway are angles
in the ring's own coordinates, from where its x axis was at the start.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ballpass.runtime.contract.manifest import FitInfo
from ballpass.runtime.life.combined_load import CombinedLoad
from ballpass.runtime.ratings.life import hours
from ballpass.runtime.ratings.oscillation import Oscillation
from ballpass.runtime.ratings.tilt import Tilt
from ballpass.runtime.show.short import ShortRepr


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class RingStrength(ShortRepr):
    """One ring of a bearing.

    Attributes
    ----------
    peak_pressure : under the highest ball force [Pa]
    major_axis, minor_axis : half axes of the ellipse then, across the groove and along it [m]
    equivalent_load : Q_e; None where there is no life [N]
    damage : share of each place of the raceway in the damage of both, first at angle 0; empty likewise [1]
    worst_angle : place of the most damage [rad]
    wear : depth a second at the deepest place, for the least and the most of `COEFFICIENTS` [m/s]
    wear_angle, wear_across : that place, around the ring [rad] and from the middle of the groove [m]

    Examples
    --------
    >>> (bearing,) = model.life(cycles=4, transient=2).bearings
    >>> f"{bearing.inner.peak_pressure / 1e9:.1f} GPa"
    '4.3 GPa'
    """

    peak_pressure: float
    major_axis: float
    minor_axis: float
    equivalent_load: float | None
    damage: tuple[float, ...]
    worst_angle: float
    wear: tuple[float, float]
    wear_angle: float
    wear_across: float


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class BearingStrength(ShortRepr):
    """One bearing under the load of a run.

    Attributes
    ----------
    name : empty for the scene's only one
    element : kind of its rolling elements, for which "ball" stands in all names
    dynamic_rating, static_rating, fatigue_limit : C_r, C_0r, C_u [N]
    given : which of these the scene gives; the others follow from the geometry
    assumed : whether grooves and steel are the reference ones, for the scene gives a stiffness
    peak_force : highest force of any ball [N], at `peak_time` [s], of ball `peak_ball`, counted from 1, at the angle
        `peak_angle` of driver or shaft, None where its speed changes [rad]
    static_safety : s_0, of the load P_0 whose heaviest ball bears the peak force (Z/5 of it), that of `combined`
        where it is higher [1]
    inner, outer : the rings
    speed : mean of the inner ring against the outer one in the run; 0 where there is no life [rad/s]
    why_no_life : reason why no standard gives a life; empty where one does
    equivalent_load : P, cubic mean of the force on the bearing [N]
    basic_life : L_10 of ISO 281 under P [turns]
    life : L_10r of ISO 16281 [turns]; None where there is none
    viscosity_ratio, contamination : κ and e_C [1], None where the scene does not give them
    factor, modified_life : a_ISO [1] and L_nmr [turns], likewise
    beyond : limits of these numbers that it is beyond, sentences
    oscillation : where the rings swing, by hand; None where they turn, or do not move
    tilt : of the rings, by hand
    combined : with axial force or tilt, where the scene has them

    Examples
    --------
    >>> (bearing,) = model.life(cycles=4, transient=2).bearings
    >>> f"s_0 {bearing.static_safety:.1f}, {bearing.life / 1e6:.0f} million turns"
    's_0 0.9, 225 million turns'
    """

    name: str
    element: str
    dynamic_rating: float
    static_rating: float
    fatigue_limit: float
    given: tuple[str, ...]
    assumed: bool
    peak_force: float
    peak_time: float
    peak_ball: int
    peak_angle: float | None
    static_safety: float
    inner: RingStrength
    outer: RingStrength
    speed: float
    why_no_life: str
    equivalent_load: float
    basic_life: float | None
    life: float | None
    viscosity_ratio: float | None
    contamination: float | None
    factor: float | None
    modified_life: float | None
    beyond: tuple[str, ...] = ()
    oscillation: Oscillation | None = None
    tilt: Tilt | None = None
    combined: CombinedLoad | None = None

    @property
    def rated_lives(self) -> tuple[float | None, float | None]:
        """L_10 and L_10r with axial force and tilt where the scene has them, else `basic_life` and `life` [turns]."""
        if self.combined is None:
            return self.basic_life, self.life
        return self.combined.basic_life or self.basic_life, self.combined.life

    @property
    def reached(self) -> float | None:
        """Life that 90 % of such bearings reach: L_nmr where the scene says oil and dirt, else L_10r [turns]."""
        return self.rated_lives[1] if self.modified_life is None else self.modified_life

    def hours(self, turns: float) -> float:
        """Hours that so many turns take.

        Examples
        --------
        >>> (bearing,) = model.life(cycles=4, transient=2).bearings
        >>> f"{bearing.hours(1e6):.0f} h for a million turns"
        '33 h for a million turns'
        """
        return float(hours(turns, abs(self.speed)))


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class StateStrength(ShortRepr):
    """The bearings of a scene in one state of its duty cycle, or as the scene stands.

    Attributes
    ----------
    name, share : of the state [1]; empty and 1 without a duty cycle
    bearings : none where the state stands still
    turns : steady turns that were run, None where nothing turns
    change : of the life or peak that the second half of them moved most, relative to itself [1]
    settled : whether that counts as none
    samples : steady samples that wear and the equivalent load of ISO 281 are means of

    Examples
    --------
    >>> (state,) = model.life(cycles=4, transient=2).states  # no duty cycle
    >>> state.share, round(state.turns, 9)
    (1.0, 2.0)
    """

    name: str
    share: float
    bearings: tuple[BearingStrength, ...]
    turns: float | None
    change: float
    settled: bool
    samples: int


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class DutyLife(ShortRepr):
    """Life of one bearing over a duty cycle, by Miner's rule.

    Attributes
    ----------
    name : of the bearing
    hours, turns : its life; None where there is none
    modified_hours, modified_turns : of L_nmr; None where a state has none
    mean_load, basic_hours, basic_turns : P_m that has the same L_10 as the loads P of the states [N], and that life
    damage : share of each state [1]
    why_no_life : reason why there is none; empty where there is one

    Examples
    --------
    >>> idle = {"mechanism": {"forces": {"punch": {"force": {"y": "0 N"}}}}}
    >>> duty = {"punching": {"share": 0.6}, "idling": {"share": 0.4, "set": idle}}
    >>> scene = read_scene("scenes/punching_press.toml", changes={"duty": duty})
    >>> folder = generate(scene, "generated/duty")
    >>> (life,) = load(folder).life(cycles=4, transient=2).duty
    >>> {name: f"{share:.0%}" for name, share in life.damage.items()}
    {'punching': '100%', 'idling': '0%'}
    """

    name: str
    hours: float | None = None
    turns: float | None = None
    modified_hours: float | None = None
    modified_turns: float | None = None
    mean_load: float | None = None
    basic_hours: float | None = None
    basic_turns: float | None = None
    damage: Mapping[str, float] = field(default_factory=dict)
    why_no_life: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class FitSpread(ShortRepr):
    """A bearing over the clearances that its fits by class leave.

    All numbers are for the least, lowest probable, mean, highest probable and largest clearance in this order; probable
    is within three standard deviations.

    Attributes
    ----------
    name, state : of the bearing, and of the duty cycle
    fit : classes and interferences [m]
    clearance : in operation [m]
    lives : L_10r in turns; empty where there is no life
    peak_forces : highest forces of any ball [N]
    turns : steady turns of each run; None: as long as the scene says
    failed : why runs failed, whose lives and forces are NaN

    Examples
    --------
    >>> model.life(cycles=4, transient=2).fits  # the scene gives no classes
    ()
    """

    name: str
    state: str
    fit: FitInfo
    clearance: tuple[float, ...]
    lives: tuple[float, ...]
    peak_forces: tuple[float, ...]
    turns: float | None
    failed: tuple[str, ...]
