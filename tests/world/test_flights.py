"""Recorded flights: read with care, smoothed to the noise, placed as the contract says."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from thrower_hands import SWING, carried

from mitt.core.ball.flight import advance_spinning
from mitt.core.ball.spin import lift_of
from mitt.core.errors import FileError
from mitt.core.signals import Array
from mitt.lab.world.flights import (
    JITTER_POSITION,
    JITTER_YAW,
    PiecewisePolynomial,
    RecordedFlight,
    builtin_flights,
    place_flight,
    read_flights,
    smooth,
)
from mitt.lab.world.scene import TABLE_TENNIS
from mitt.lab.world.throws import Throw, fly

CATCH = np.array([0.785, 0.0, 0.057])
NOISE_MM = np.array([1.6, 0.6, 0.85])
HEADER = "flight,t_s,x_m,y_m,z_m\n"
RECORDINGS = builtin_flights()
which = st.integers(0, len(RECORDINGS) - 1)


def test_the_residuals_are_the_measured_noise() -> None:
    """Over all 44 flights the smoothed curve misses the samples by the noise, to 10 %."""
    assert len(RECORDINGS) == 44
    residuals = []
    for flight in RECORDINGS:
        curve = smooth(flight.t, flight.r)
        residuals.append((flight.r - np.array([curve.at(s)[0] for s in flight.t]))[curve.used])
        assert curve.used.mean() > 0.9
    assert 1e3 * np.vstack(residuals).std(axis=0) == pytest.approx(NOISE_MM, rel=0.10)


@given(index=which)
def test_a_flight_comes_from_x_through_the_catch_point(index: int) -> None:
    """Without jitter the chord points along -x and 75 % of the duration lies at the catch point."""
    flight = RECORDINGS[index]
    placed = place_flight(flight, CATCH, rng=None)
    assert placed.at(0.75 * placed.duration)[0] == pytest.approx(CATCH, abs=1e-12)
    chord = placed.rotation @ (flight.r[-1] - flight.r[0])
    assert chord[0] < 0.0
    assert chord[1] == pytest.approx(0.0, abs=1e-12)
    assert placed.rotation @ placed.rotation.T == pytest.approx(np.eye(3), abs=1e-12)


@settings(max_examples=30)
@given(index=which, seed=st.integers(0, 10_000))
def test_jitter_stays_within_the_contract(index: int, seed: int) -> None:
    """At most 30 mm an axis and 3 degrees of yaw, the same for the same seed."""
    flight = RECORDINGS[index]
    placed, again = (place_flight(flight, CATCH, rng=np.random.default_rng(seed)) for _ in range(2))
    off = placed.at(0.75 * placed.duration)[0] - CATCH
    chord = placed.rotation @ (flight.r[-1] - flight.r[0])
    assert np.abs(off).max() <= JITTER_POSITION
    assert abs(np.arctan2(-chord[1], -chord[0])) <= JITTER_YAW + 1e-12
    assert np.array_equal(placed.at(0.3)[0], again.at(0.3)[0])


@settings(max_examples=40)
@given(index=which, beyond=st.floats(0.0, 0.4))
def test_after_the_last_sample_the_ball_flies_on(index: int, beyond: float) -> None:
    """The free flight takes over without a jump and obeys gravity and drag.

    An ulp in the duration may mean one integration step more, worth 1e-8 m at the most.
    """
    placed = place_flight(RECORDINGS[index], CATCH, rng=None)
    end = placed.at(placed.duration)
    wanted = fly(*end, drag=placed.drag, duration=beyond)
    found = placed.at(placed.duration + beyond)
    assert found[0] == pytest.approx(wanted[0], abs=1e-7)
    assert found[1] == pytest.approx(wanted[1], abs=1e-7)


def test_interleaved_flights_are_told_apart(tmp_path: Path) -> None:
    """Rows of two flights may alternate; time starts at zero in each."""
    path = tmp_path / "two.csv"
    rows = [f"{name},{5 + 0.01 * k},{-0.1 * k},0,1\n" for k in range(12) for name in "ab"]
    path.write_text(HEADER + "".join(rows))
    first, second = read_flights(path)
    assert (first.name, second.name) == ("a", "b")
    assert first.t[0] == 0.0
    assert len(second.t) == 12


def rows(count: int, *, step: float = 0.01, way: float = 0.1) -> str:
    """Return rows of one plain flight."""
    return "".join(f"a,{step * k},{way * k},0,1\n" for k in range(count))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("flight,t_s,x_m,y_m\n", "columns"),
        (HEADER, "at least one flight"),
        (HEADER + rows(9), "at least 10 samples"),
        (HEADER + rows(12, step=0.0), "line 3 column t_s"),
        (HEADER + rows(12, way=0.0), "horizontal way"),
        (HEADER + rows(12) + "a,x,0,0,0\n", "line 14 column t_s"),
        (HEADER + rows(12) + "a,9,0,one,0\n", "line 14 column y_m"),
        (HEADER + rows(12) + "a,9,0,0,1e9\n", "line 14 column z_m"),
    ],
)
def test_bad_recordings_are_refused(tmp_path: Path, text: str, said: str) -> None:
    """Each fault names the file and the place."""
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(FileError) as caught:
        read_flights(path)
    assert said in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_placed_flight_is_a_rigid_copy() -> None:
    """Distances between samples survive the placing."""
    flight = RECORDINGS[3]
    placed = place_flight(flight, CATCH, rng=np.random.default_rng(2))
    there = placed.rotation @ flight.r.T
    assert np.linalg.norm(np.diff(there.T, axis=0), axis=1) == pytest.approx(
        np.linalg.norm(np.diff(flight.r, axis=0), axis=1), abs=1e-12
    )
    assert isinstance(flight, RecordedFlight)


NOISE_M = np.array([1.6, 0.6, 0.85]) * 1e-3  # measured, README of the flights
FRAME = 1.0 / 179.0


def bounced(t: Array, hit: float) -> tuple[Array, Array]:
    """Return positions and velocities of a table-tennis ball that bounces at ``hit`` [s]."""
    before = fly(np.array([0.0, 0.0, 1.1]), np.array([4.4, 0.1, 2.0]), drag=0.12, duration=hit)
    after = before[1] * np.array([0.7, 0.9, -0.85])
    rows = [
        fly(np.array([0.0, 0.0, 1.1]), np.array([4.4, 0.1, 2.0]), drag=0.12, duration=s)
        if s < hit
        else fly(before[0], after, drag=0.12, duration=s - hit)
        for s in t
    ]
    return np.array([r for r, _ in rows]), np.array([dr for _, dr in rows])


@settings(max_examples=40)
@given(hit=st.floats(0.40, 0.60), seed=st.integers(0, 1000))
def test_a_noisy_bounce_is_found_and_stays_sharp(hit: float, seed: int) -> None:
    """One bounce, within 1.5 ms; the curve within the noise, the velocity within 0.25 m/s inside.

    A polynomial is worst at its ends; what the arm catches lies well inside a piece.
    """
    t = np.arange(0.0, 0.9, FRAME)
    r, dr = bounced(t, hit)
    curve = smooth(t, r + NOISE_M * np.random.default_rng(seed).standard_normal(r.shape))
    assert len(curve.edges) == 3
    assert curve.edges[1] == pytest.approx(hit, abs=0.0015)
    found = [curve.at(s) for s in t]
    inside = (np.abs(t - hit) > 0.05) & (t > 0.05) & (t < 0.85)
    assert np.abs(np.array([p for p, _ in found]) - r)[inside].max() < 0.003
    assert np.abs(np.array([v for _, v in found]) - dr)[inside].max() < 0.25


@settings(max_examples=30)
@given(hit=st.floats(0.40, 0.60))
def test_position_is_continuous_at_a_bounce_and_velocity_is_not(hit: float) -> None:
    """The two sides of a bounce meet to a nanometre; the vertical velocity flips at once."""
    t = np.arange(0.0, 0.9, FRAME)
    curve = smooth(t, bounced(t, hit)[0])
    left, right = curve.at(np.nextafter(curve.edges[1], 0.0)), curve.at(curve.edges[1])
    assert left[0] == pytest.approx(right[0], abs=1e-9)
    assert left[1][2] < -1.5
    assert right[1][2] > 1.5


@settings(max_examples=40)
@given(seed=st.integers(0, 1000))
def test_a_flight_without_bounce_is_one_piece(seed: int) -> None:
    """Neither the apex nor the noise is taken for a bounce."""
    t = np.arange(0.0, 0.6, FRAME)
    r = bounced(t, 5.0)[0] + NOISE_M * np.random.default_rng(seed).standard_normal((len(t), 3))
    assert len(smooth(t, r).edges) == 2


@cache
def of_a_bounce() -> PiecewisePolynomial:
    """Return the curve of a flight without noise that bounces after half a second."""
    t = np.arange(0.0, 0.9, FRAME)
    return smooth(t, bounced(t, 0.5)[0])


@given(s=st.floats(0.01, 0.89))
def test_velocity_is_the_derivative_of_position(s: float) -> None:
    """Central difference of the position, except across the bounce."""
    curve, h = of_a_bounce(), 1e-5
    if abs(s - curve.edges[1]) < 2 * h:
        return
    difference = (curve.at(s + h)[0] - curve.at(s - h)[0]) / (2 * h)
    assert curve.at(s)[1] == pytest.approx(difference, abs=1e-5)


def test_a_wild_sample_is_left_out() -> None:
    """A sample 5 cm off does not bend the curve."""
    t = np.arange(0.0, 0.6, FRAME)
    r = bounced(t, 5.0)[0]
    wild = r + 1e-4 * np.random.default_rng(0).standard_normal(r.shape)
    wild[40] += 0.05
    curve = smooth(t, wild)
    assert not curve.used[40]
    assert curve.at(float(t[40]))[0] == pytest.approx(r[40], abs=1e-3)


def test_ten_samples_are_enough() -> None:
    """The shortest recording that is read can be smoothed."""
    t = np.linspace(0.0, 0.1, 10)
    r = bounced(t, 5.0)[0]
    assert smooth(t, r).at(0.05)[0] == pytest.approx(
        fly(r[0], np.array([4.4, 0.1, 2.0]), drag=0.12, duration=0.05)[0], abs=0.02
    )


RESTS = ("still", "walk", "toss", "sway", "swung")


def in_the_hand(kind: str, *, rate: float, held: float, hit: float, seed: int) -> RecordedFlight:
    """Return a flight of 0.8 s that is seen in the thrower's hand before, with 1 mm of noise."""
    ball = Throw(r=np.array([0.0, 0.0, 1.1]), dr=np.array([4.4, 0.1, 2.0]))
    since = np.arange(-SWING if kind == "swung" else -held, 0.8, 1.0 / rate)
    seen = [carried(kind, ball, s) if s < 0.0 else bounced(np.array([s]), hit)[0][0] for s in since]
    r = np.array(seen) + 0.001 * np.random.default_rng(seed).standard_normal((len(since), 3))
    return RecordedFlight(name=kind, t=since - since[0], r=r)


@pytest.mark.thorough
@settings(max_examples=30, deadline=None)
@given(
    kind=st.sampled_from(RESTS),
    rate=st.sampled_from((120.0, 200.0, 400.0)),
    held=st.floats(0.4, 1.5),
    hit=st.sampled_from((0.45, 5.0)),
    seed=st.integers(0, 1000),
)
def test_the_time_in_the_throwers_hand_is_no_flight(
    kind: str, rate: float, held: float, hit: float, seed: int
) -> None:
    """Placed by the time since the release; the flight's curve is that of the flight alone."""
    recording = in_the_hand(kind, rate=rate, held=held, hit=hit, seed=seed)
    placed = place_flight(recording, CATCH, rng=None)
    released = SWING if kind == "swung" else held
    assert placed.release == pytest.approx(released, abs=0.045)
    assert placed.pieces.bounces == pytest.approx([released + hit] if hit < 0.8 else [], abs=0.003)
    middle = placed.release + 0.75 * (placed.duration - placed.release)
    assert placed.at(middle)[0] == pytest.approx(CATCH, abs=1e-12)
    since = np.arange(0.1, 0.75, 0.01)
    since = since[np.abs(since - hit) > 0.05]
    r, dr = bounced(since, hit)
    found = [placed.pieces.at(s) for s in since + released]
    assert np.abs(np.array([p for p, _ in found]) - r).max() < 0.004
    assert np.abs(np.array([v for _, v in found]) - dr).max() < 0.3


@given(index=which)
def test_a_flight_that_is_not_seen_in_a_hand_is_whole(index: int) -> None:
    """Noise, spin, bounces and single wild samples are no hand."""
    flight = RECORDINGS[index]
    assert smooth(flight.t, flight.r).release == 0.0
    wild = flight.r.copy()
    wild[[8, 30]] += 0.05
    assert smooth(flight.t, wild).release == 0.0


@pytest.mark.parametrize("rate", [-150.0, 0.0, 150.0])
def test_the_spin_of_a_recorded_flight_is_fitted_after_its_last_bounce(rate: float) -> None:
    """Within 60 rad/s of what it was flown with, seen with the noise of recordings at 179 Hz."""
    ball, rng = TABLE_TENNIS.spinning, np.random.default_rng(4)
    r, v, t = np.array([0.0, 0.0, 1.0]), np.array([5.0, 0.1, 2.0]), np.arange(0.0, 0.6, 1 / 179)
    lift, rows = lift_of(np.array([0.0, rate, 0.0]), ball.K, ball.radius), []
    for _ in t:
        rows.append(r + rng.normal(0.0, [0.0016, 0.0006, 0.00085]))
        advance_spinning(r, v, TABLE_TENNIS.drag, lift, 1 / 179)
    seen = RecordedFlight(name="spins", t=t, r=np.array(rows))
    found = place_flight(seen, np.zeros(3), rng=None, spinning=ball)
    assert float((found.rotation.T @ found.spin)[1]) == pytest.approx(rate, abs=60.0)
    assert not place_flight(seen, np.zeros(3), rng=None).spin.any()
