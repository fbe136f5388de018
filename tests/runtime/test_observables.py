"""Observables against closed forms, printed tables and second methods."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scripts.validation.kinematics import kinematic_frequencies

from ballpass.runtime import Model
from ballpass.runtime.ask.observables import (
    orbits,
    statistics,
    stroboscopic_points,
    turns,
)
from ballpass.runtime.contract.errors import RequestError
from ballpass.runtime.request.ball_angles import ball_angles
from ballpass.runtime.vibration.spectrum import amplitude_spectrum, whole_cycles

TURN = 2.0 * np.pi
INCH = 25.4e-3


def even(cycles: float, per_cycle: int, length: float = 1.0) -> np.ndarray:
    return np.arange(round(cycles * per_cycle) + 1) * (length / per_cycle)


class TestKinematicFrequencies:
    def test_printed_values_of_the_cwru_data_set(self) -> None:
        # SKF 6205, per turn of the shaft: https://engineering.case.edu/bearingdatacenter; its ball frequency is 2 BSF
        found = kinematic_frequencies(9, 0.3126 * INCH, 1.537 * INCH, TURN)
        assert found.shaft == pytest.approx(1.0)
        assert found.cage == pytest.approx(0.39828, abs=5e-5)
        assert found.ball_pass_outer == pytest.approx(3.5848, abs=1.5e-4)
        assert found.ball_pass_inner == pytest.approx(5.4152, abs=1.5e-4)
        assert 2.0 * found.ball_spin == pytest.approx(4.7135, abs=1.5e-4)

    def test_values_of_the_6204(self) -> None:
        found = kinematic_frequencies(8, 7.9375e-3, 33.5e-3, TURN)
        assert found.cage == pytest.approx(0.381530, abs=1e-6)
        assert found.ball_pass_outer == pytest.approx(3.052239, abs=1e-6)
        assert found.ball_pass_inner == pytest.approx(4.947761, abs=1e-6)
        assert found.ball_spin == pytest.approx(1.991766, abs=1e-6)

    @given(
        balls=st.integers(1, 40),
        ratio=st.floats(0.01, 0.9),
        pitch=st.floats(1e-3, 1.0),
        speed=st.floats(-1e4, 1e4),
    )
    def test_rolling_without_slip(self, balls: int, ratio: float, pitch: float, speed: float) -> None:
        found = kinematic_frequencies(balls, ratio * pitch, pitch, speed)
        # every ball passes the two rings together once per turn of one against the other
        assert found.ball_pass_outer + found.ball_pass_inner == pytest.approx(
            balls * found.shaft, rel=1e-12, abs=1e-300
        )
        # seen from the cage, ball and outer raceway have one speed where they touch
        assert found.ball_spin * ratio == pytest.approx(found.cage * (1.0 + ratio), abs=1e-12)
        assert found.cage >= 0.0


def test_a_ball_passes_a_point_of_the_outer_ring_at_the_ball_pass_frequency(make_model: Callable[..., Model]) -> None:
    model = make_model("varying_compliance")
    numbers = model.numbers({"bearing.ball_angle": 0.3, "shaft.speed": 50.0})
    values = [numbers.values[f"bearing.{name}"] for name in ("ball_diameter", "pitch_diameter")]
    frequencies = kinematic_frequencies(model.manifest.bearings[0].balls, *values, 50.0)
    state = np.zeros(len(model.states))
    (first,) = ball_angles(model, numbers, 0.0, state)
    (later,) = ball_angles(model, numbers, 1.0 / frequencies.ball_pass_outer, state)
    assert first[0] == pytest.approx(0.3)
    assert later[:-1] == pytest.approx(first[1:])


class TestTurns:
    def test_neighbours_share_a_sample_and_the_last_ends_the_record(self) -> None:
        time = even(3.5, 40, length=0.12)
        found = turns(time, 0.12)
        assert len(found) == 3
        assert found[-1].stop == time.size
        assert all(a.stop == b.start + 1 for a, b in pairwise(found))
        assert [time[turn][-1] - time[turn][0] for turn in found] == pytest.approx([0.12] * 3)

    def test_a_turn_missed_by_rounding_counts(self) -> None:
        assert len(turns(np.linspace(0.24, 0.48, 4001) * (1.0 + 1e-15), 0.12)) == 2

    def test_less_than_a_turn_has_none(self) -> None:
        assert turns(even(0.9, 100), 1.0) == ()


class TestStatistics:
    def test_sine_with_offset(self) -> None:
        time = even(3, 500)
        found = statistics(time, 2.0 + 3.0 * np.sin(TURN * time))
        assert (found.minimum, found.maximum) == pytest.approx((-1.0, 5.0))
        assert found.mean == pytest.approx(2.0)
        assert found.std == pytest.approx(3.0 / np.sqrt(2.0))
        assert found.rms == pytest.approx(np.sqrt(4.0 + 4.5))

    def test_means_are_over_time_not_over_samples(self) -> None:
        time = np.concatenate((np.linspace(0.0, 0.5, 1000), np.linspace(0.5, 1.0, 11)[1:]))
        assert statistics(time, time).mean == pytest.approx(0.5)

    def test_times_that_stand_still_are_refused(self) -> None:
        with pytest.raises(RequestError, match="increasing"):
            statistics([0.0, 1.0, 1.0], [1.0, 2.0, 3.0])

    def test_an_output_with_one_column_per_ball_is_refused(self) -> None:
        with pytest.raises(RequestError, match="one column"):
            statistics([0.0, 1.0], np.zeros((2, 8)))


class TestStroboscopicPoints:
    def test_error_between_samples_stays_within_that_of_the_hermite_cubic(self) -> None:
        for per_cycle in (33, 66, 132):
            time = even(4, per_cycle)
            found = stroboscopic_points(
                time, np.sin(3.3 * time), 3.3 * np.cos(3.3 * time), cycle_length=0.7, offset=0.01
            )
            assert found.time == pytest.approx(0.01 + 0.7 * np.arange(6))
            # step^4 / 384 times the greatest fourth derivative, and not much less: the points lie between the samples
            bound = (3.3 / per_cycle) ** 4 / 384.0
            assert 0.1 * bound < np.max(np.abs(found.position - np.sin(3.3 * found.time))) < bound
            assert found.velocity == pytest.approx(3.3 * np.cos(3.3 * found.time), abs=1e-4)

    def test_at_samples_they_are_the_samples(self) -> None:
        generator = np.random.default_rng(1)
        time = even(3, 50, length=0.12)
        x, v = generator.normal(size=(2, time.size))
        found = stroboscopic_points(time, x, v, cycle_length=0.12)
        assert found.position == pytest.approx(x[::50], abs=1e-9)
        assert found.velocity == pytest.approx(v[::50], abs=1e-9)

    def test_points_of_a_quasi_periodic_motion_drift_by_the_ball_pass_remainder(self) -> None:
        order = 3.0522388  # ball passes per turn
        time = even(40, 400)
        found = stroboscopic_points(
            time, np.cos(TURN * order * time), -TURN * order * np.sin(TURN * order * time), cycle_length=1.0
        )
        angle = np.unwrap(np.arctan2(-found.velocity / (TURN * order), found.position))
        assert np.diff(angle) / TURN == pytest.approx(order - 3.0, abs=1e-5)


class TestOrbits:
    def test_a_motion_that_repeats_closes(self) -> None:
        time = even(3, 200)
        found = orbits(time, np.cos(TURN * time), np.sin(2 * TURN * time), cycle_length=1.0)
        assert len(found) == 3
        assert found[-1].gap == pytest.approx(0.0, abs=1e-12)

    def test_a_motion_that_does_not_repeat_leaves_the_chord(self) -> None:
        time = even(3, 200)
        found = orbits(time, np.cos(1.1 * TURN * time), np.sin(1.1 * TURN * time), cycle_length=1.0)
        assert found[0].gap == pytest.approx(2.0 * np.sin(0.1 * TURN / 2.0))


class TestAmplitudeSpectrum:
    @pytest.mark.parametrize(("window", "share"), [("boxcar", 1e-12), ("hann", 1e-12), ("flattop", 1e-12)])
    def test_a_sine_on_a_line_reads_its_amplitude(self, window: str, share: float) -> None:
        time = even(8, 128, length=0.12)
        signal = 5.0 + 0.7 * np.sin(TURN * 3.0 * time / 0.12 + 0.4) + 0.2 * np.cos(TURN * 20.0 * time / 0.12)
        found = amplitude_spectrum(time, signal, cycle_length=0.12, window=window)  # type: ignore[arg-type]
        assert found.cycles == 8
        assert found.resolution == pytest.approx(1.0 / (8 * 0.12))
        for order, amplitude in ((3, 0.7), (20, 0.2)):
            line = int(np.argmin(np.abs(found.frequency - order / 0.12)))
            assert found.frequency[line] == pytest.approx(order / 0.12)
            assert found.amplitude[line] == pytest.approx(amplitude, rel=1e-6 + share)
        assert found.amplitude[0] == pytest.approx(0.0, abs=1e-12)

    def test_whole_cycles_without_window_leak_nothing(self) -> None:
        time = even(2.3, 400)  # 0.3 of a cycle too many
        found = amplitude_spectrum(time, np.sin(TURN * time), cycle_length=1.0)
        others = np.delete(found.amplitude, 2)
        assert found.cycles == 2
        assert found.amplitude[2] == pytest.approx(1.0)
        assert np.max(others) < 1e-12

    def test_flattop_reads_any_frequency_and_hann_at_worst_15_percent_low(self) -> None:
        time = even(50, 64)
        signal = np.sin(TURN * 3.05 * time * 1.0033)
        reading = {
            window: float(np.max(amplitude_spectrum(time, signal, cycle_length=1.0, window=window).amplitude))
            for window in ("flattop", "hann", "boxcar")
        }
        assert reading["flattop"] == pytest.approx(1.0, abs=2e-3)
        assert 0.848 < reading["hann"] < 1.0
        assert 0.636 < reading["boxcar"] < 1.0

    def test_mean_square_is_half_the_sum_of_squared_amplitudes(self) -> None:
        generator = np.random.default_rng(2)
        time = even(4, 64)
        signal = generator.normal(size=time.size)
        signal[-1] = signal[0]
        found = amplitude_spectrum(time, signal, cycle_length=1.0)
        squares = found.amplitude[1:-1] @ found.amplitude[1:-1] / 2.0 + found.amplitude[-1] ** 2
        assert squares == pytest.approx(np.var(signal[:-1]))

    def test_a_cycle_of_no_whole_number_of_steps_is_read_between_the_samples(self) -> None:
        step = 1.0 / 333.3
        time = np.arange(2000) * step
        found = amplitude_spectrum(time, np.sin(TURN * 4.0 * time), cycle_length=1.0)
        assert found.cycles == 5
        assert found.amplitude[20] == pytest.approx(1.0, abs=1e-6)
        assert np.max(np.delete(found.amplitude, 20)) < 1e-6

    def test_the_last_cycles_are_used(self) -> None:
        time = even(2.5, 100)
        grid, values, cycles = whole_cycles(time, time, 1.0)
        assert (cycles, values.size) == (2, 200)
        assert grid[0] == pytest.approx(0.5)
        assert values == pytest.approx(grid)

    def test_uneven_steps_are_refused(self) -> None:
        with pytest.raises(RequestError, match=r"equal, positive steps.*even grid"):
            amplitude_spectrum([0.0, 1.0, 2.0, 3.5, 4.0], np.zeros(5))

    def test_less_than_a_cycle_is_refused(self) -> None:
        with pytest.raises(RequestError, match="less than one cycle"):
            amplitude_spectrum(even(0.9, 100), np.zeros(91), cycle_length=1.0)

    def test_unknown_window_is_refused(self) -> None:
        with pytest.raises(RequestError, match="boxcar, hann, flattop"):
            amplitude_spectrum(even(1, 100), np.zeros(101), window="kaiser")  # type: ignore[arg-type]
