"""Optimising the map for the ball that comes: the learner's steps over its flight.

From the projection onto the arm's start, eq. (12), alpha goes on by Gauss-Newton steps of eq. (22)
and the limits (18), (20), as in learning (:mod:`mitt.core.map.learn`), over the predicted flight
and six that are displaced from it along each axis, either way, in position and velocity. Fitted to
one flight alone, alpha asks for many times the torque under a millimetre of noise. All seven start
where the arm is, so the reference does not jump.

The displaced flights also say how likely the catch is: how its place and the share of the binding
limit answer to the ball's place at the catch. The events (the ball in the map's region, the limit
kept, the ball in the hand) are taken as independent, the error as Gaussian, carried on without
drag.
"""

from dataclasses import replace
from math import erf, sqrt
from typing import NamedTuple

import numpy as np

from mitt.core.map.demand import FOLLOWED, Tolerance, shares_of
from mitt.core.map.foresight import foresee
from mitt.core.map.learn import Flight, LearnSettings, Lifted, lift_flight, refined
from mitt.core.map.mapping import DirectMap, project
from mitt.core.map.prediction import flown
from mitt.core.signals import Array, BallState
from mitt.core.verdict.feasibility import Verdict, weigh_way
from mitt.core.verdict.impact import GRASP

#: Displacement of the six flights in position [m] and velocity [m/s]: a third of it costs 40 throws
#: with 48 V half as much again, and twice as much costs flights that are known exactly a quarter.
_DISPLACED = 0.03, 0.15
#: Gauss-Newton steps, and instants of a flight.
_STEPS = 1
_INSTANTS = 12
#: Time before the catch in which the arm can no longer follow [s] (aT^2/4 of 3 mm).
_BLIND = 0.020


class Around(NamedTuple):
    """The predicted flight of a ball, and its six neighbours, along each axis and against it."""

    after: float  # time to the catch [s]
    lifted: tuple[Lifted, ...]


def around(f: DirectMap, ball: BallState, start: tuple[Array, Array]) -> Around | None:
    """Return the flights about that of a ball that are in the map's domain; None if its own is not.

    Args:
        f: The map.
        ball: Estimate of the ball.
        start: q, dq of the arm [rad, rad/s], shape (n,) each.
    """
    after = foresee(f, ball).after
    if not after < np.inf:
        return None
    t = np.linspace(0.0, after + FOLLOWED, _INSTANTS)
    lifted = []
    for way in (np.zeros(3), *np.eye(3), *-np.eye(3)):
        dr, ddr = (size * way for size in _DISPLACED)
        path = flown(replace(ball, r_o=ball.r_o + dr, dr_o=ball.dr_o + ddr), t)
        lifted.append(lift_flight(f, Flight(t=t, ball=path, seen=path[0]), start))
    if any(x is None for x in lifted):
        return None
    return Around(after, tuple(x for x in lifted if x is not None))


def refine(f: DirectMap, ball: BallState, q: Array, dq: Array) -> DirectMap:
    """Return the map for a ball, started in ``q``, ``dq``; the one given outside its domain.

    Args:
        f: The map.
        ball: Estimate of the ball.
        q: Joint angles now [rad], shape (n,).
        dq: Joint speeds now [rad/s], shape (n,).
    """
    near = around(f, ball, (q, dq))
    if near is None:
        return f
    g, own = refined(f, near.lifted, LearnSettings(steps=_STEPS)), near.lifted[0]
    return f.with_alpha(project(g.alpha, f.H_inverse, own.phi_0, own.gap))


def certify(
    f: DirectMap, ball: BallState, start: tuple[Array, Array], tolerance: Tolerance
) -> Verdict | None:
    """Return what a refined map's motion to the catch asks, and how likely that is; None without.

    Args:
        f: The map, refined.
        ball: Estimate of the ball.
        start: q, dq of the arm [rad, rad/s], shape (n,) each.
        tolerance: Share of each limit at which a throw is refused.
    """
    near = around(f, ball, start)
    if near is None:
        return None
    verdict = weigh_way(f, ball, near.after, tolerance)
    P, t = ball.covariance, near.after
    ahead = P[:3, :3] + t * (P[:3, 3:] + P[3:, :3]) + t * t * P[3:, 3:]
    off = 2.0 * (_DISPLACED[0] + t * _DISPLACED[1])  # of the ball at the catch, of two neighbours
    shares = np.array(
        [shares_of(f.arm, x.motion(f.alpha), tolerance)[verdict.binding_limit] for x in near.lifted]
    )
    slope = (shares[1:4] - shares[4:]) / off
    odds = _in_hand(P) * _below(1.0 - verdict.share, sqrt(slope @ ahead @ slope))
    place = np.array([x.virtual[-1, 0] for x in near.lifted])
    slopes = (place[1:4] - place[4:]) / off
    low, high = f.trusted
    for j in f.design.free:
        if j != f.design.catch_joint:
            sigma = sqrt(slopes[:, j] @ ahead @ slopes[:, j])
            odds *= _below(high[j] - place[0, j], sigma) - _below(low[j] - place[0, j], sigma)
    return replace(verdict, probability=odds)


def _below(bound: float, sigma: float) -> float:
    """Return the probability that a Gaussian of mean 0 lies below a bound."""
    return 0.5 * (1.0 + erf(bound / (sqrt(2.0) * max(sigma, 1e-12))))


def _in_hand(P: Array) -> float:
    """Return the probability that a ball with a covariance (6, 6) comes to where fingers close."""
    ahead = P[:3, :3] + _BLIND * (P[:3, 3:] + P[3:, :3]) + _BLIND**2 * P[3:, 3:]
    return float(1.0 - np.exp(-0.5 * GRASP**2 / max(np.trace(ahead) / 3.0, 1e-18)))
