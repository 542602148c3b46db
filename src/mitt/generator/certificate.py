"""The verdict before moving: can this throw be caught, and which limit binds?

The ball's estimate is flown on by the flight model to the catch, the map is adapted to the arm
at rest, and what the motion asks of the arm is held against its limits.
"""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from mitt.flight import forecast
from mitt.generator.demand import demand
from mitt.generator.mapping import DirectMap
from mitt.signals import Array, BallState, MapStatus

#: How far ahead a ball is flown [s], and in what steps.
_HORIZON, _STRIDE = 1.0, 0.02
#: Instants at which the demand is reckoned.
_INSTANTS = 25


class Outcome(Enum):
    """Whether the throw can be caught; OPEN where it falls short and only a bounce would help."""

    FEASIBLE = "feasible"
    OPEN = "open"
    UNREACHABLE = "unreachable"


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerance:
    """Share of each limit at which a throw is refused.

    A little more than 1 for torque: a short saturation costs some tracking error, not the ball.
    """

    torque: float = 1.25
    speed: float = 1.0
    range_gap: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What the certificate says.

    Attributes:
        outcome: Feasible or not.
        binding_limit: The limit that is asked most, such as ``torque:j2``.
        share: How much of it is asked; 1 is the limit.
        t_catch: Predicted time of the catch [s]; infinite without one.
        sigma: Predicted 1-sigma of the ball's position then [m].
    """

    outcome: Outcome
    binding_limit: str
    share: float
    t_catch: float
    sigma: float


def catch_forecast(f: DirectMap, ball: BallState) -> BallState | None:
    """Return the ball when q_o,i reaches q_alpha; None where it does not within the horizon."""
    i, last = f.design.catch_joint, 0.0
    for k in range(int(_HORIZON / _STRIDE) + 1):
        ahead = forecast(ball, ball.t + k * _STRIDE)
        inside, rows = f.virtual(np.array([ahead.r_o, ahead.dr_o, ahead.ddr_o]))
        if not inside:
            return None
        s = rows[0, i] - f.design.q_catch
        if k > 0 and s * last <= 0.0:
            return forecast(ball, ahead.t - _STRIDE * s / (s - last))
        last = s
    return None


def judge(f: DirectMap, ball: BallState, q: Array, *, tolerance: Tolerance) -> Verdict:
    """Return the verdict on a ball for an arm at rest in ``q`` [rad], shape (n,)."""
    adapted = f.adapt(ball, q, np.zeros(f.arm.n))
    caught = catch_forecast(f, ball) if adapted.status is MapStatus.INSIDE else None
    if caught is None:
        return Verdict(
            outcome=Outcome.OPEN if _falls_short(f, ball) else Outcome.UNREACHABLE,
            binding_limit="domain",
            share=np.inf,
            t_catch=np.inf,
            sigma=np.inf,
        )
    path = [forecast(ball, t) for t in np.linspace(ball.t, caught.t, _INSTANTS)]
    motion = np.array([_row(adapted, ball) for ball in path])
    shares = _shares(f, motion, tolerance)
    binding = max(shares, key=lambda name: shares[name])
    outcome = Outcome.FEASIBLE if shares[binding] <= 1.0 else Outcome.UNREACHABLE
    return Verdict(
        outcome=outcome,
        binding_limit=binding,
        share=shares[binding],
        t_catch=caught.t,
        sigma=float(np.sqrt(np.linalg.eigvalsh(caught.covariance[:3, :3])[-1])),
    )


def _falls_short(f: DirectMap, ball: BallState) -> bool:
    """Say whether the ball passes over reachable ground, but below what the map can reach.

    A level surface that nobody announced, such as a table, may send it up again; it cannot
    change where over the ground the ball flies, nor bring down a ball that passes above.
    """
    i = f.design.catch_joint
    q = f.arm.q_ready.copy()
    q[i] = f.design.q_catch
    reach = float(np.linalg.norm(f.arm.position(q)))
    for k in range(int(_HORIZON / _STRIDE) + 1):
        r_o = forecast(ball, ball.t + k * _STRIDE).r_o
        if np.hypot(r_o[0], r_o[1]) <= reach:
            return bool(r_o[2] < 0.0)
    return False


def _row(f: DirectMap, ball: BallState) -> Array:
    """Return q_d, dq_d, ddq_d for a ball, shape (3, n)."""
    reference = f.reference(ball)
    return np.array([reference.q_d, reference.dq_d, reference.ddq_d])


def _shares(f: DirectMap, motion: Array, tolerance: Tolerance) -> dict[str, float]:
    """Return the largest share of each limit of the active joints, in units of its tolerance."""
    arm, asked = f.arm, demand(f.arm, motion)
    torque = arm.active(asked.torque).max(axis=0) / tolerance.torque
    speed = arm.active(asked.speed).max(axis=0) / tolerance.speed
    half = 0.5 * (arm.q_max - arm.q_min)
    middle = 0.5 * (arm.q_max + arm.q_min)
    angle = (np.abs(motion[:, 0] - middle) / (half + tolerance.range_gap)).max(axis=0)
    kinds = {"torque": torque, "speed": speed, "range": angle}
    return {
        f"{kind}:{name}": float(share)
        for kind, values in kinds.items()
        for name, share in zip(arm.names, values, strict=True)
    }
