"""Where a paddle has to be, and how it has to move, to send a ball to a target.

Impact, a rigid body's: of the speed u.n with which ball and paddle approach along the paddle's
normal n, the ball keeps e, and of its slip s along the face, that of its surface, it loses the
share ``loss`` as velocity, the rest as spin omega,

    v' = v_o - (1 + e) mu (u.n) n - loss s,   u = v_o - v_p = (u.n) n + u_t,
    omega' = omega + loss / (c r) n x s,      s = u_t - r omega x n,

mu = M / (M + m), M = 1 / (n' J M(q)^-1 J' n) the mass that the arm has behind the paddle, c m r^2
the ball's moment of inertia; e falls with |u.n|. The paddle's velocity v_p is along n. So v' to the
target asks for lambda n + loss r omega x n = v' - (1 - loss) v_o, which has one solution of length
1, and for u.n = (v_o - v').n / ((1 + e) mu). The flight to the target has the lift of omega'.

The place of the contact is the ball's at a given time. A flight from there to the target may take
any time T, each with its own v' (shooting, with drag); position and direction are five equations
for the joints that bring the paddle there, the joints that are ``held`` otherwise, and T. One held
joint solves them; with none the direction is met as well as it can be, with more the solution is
the nearest to the pose from which the search starts.

| here     | meaning                                         | unit | shape |
|----------|-------------------------------------------------|------|-------|
| ``ball`` | r_o, v_o at the contact                         | m, m/s | (2, 3) |
| ``v_out``| v', velocity of the ball after it               | m/s  | (3,)  |
| ``n``    | normal of the paddle: the z axis of the tool    | 1    | (3,)  |
| ``rows`` | slope of the five equations in joints and T, and what is left of them | | (5, k + 2) |
"""

from dataclasses import dataclass, replace
from typing import Annotated, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitt.core import checks
from mitt.core.arm.arm import Arm
from mitt.core.arm.kinematics import (
    Chain,
    Motion,
    Vec,
    cross,
    dot,
    minus,
    motion_of,
    place,
    rotate,
    row,
    times,
)
from mitt.core.arm.tools import USUAL_SPEED
from mitt.core.ball.flight import STILL, Lift, advance_spinning
from mitt.core.fields import Range, Settings, brief
from mitt.core.kernels import big_kernel, kernel
from mitt.core.map.demand import arm_numbers
from mitt.core.signals import Array

#: Steps of Newton's method, its largest steps [rad, s], and rounds of shooting in each.
_STEPS = 14
_TURN = 0.35
_LATER = 0.15
_ROUNDS = 3
#: Weight of a metre against a radian, what is added to the squares, and when it has settled.
_WEIGHT = 1e3
_DAMPING = 1e-9
_SETTLED = 1e-7
#: Shortest and longest flight to the target [s].
_BRIEFEST = 0.1
_LONGEST = 2.0
#: Speed of a returned ball by which the search for T begins [m/s].
_USUAL = 4.5
#: Squared Mahalanobis distance of a hit beyond which it is odd: of three numbers 1 in 7000 is.
_ODD = 20.0
#: Time in which a joint is to come to its speed at the contact [s].
_RUN_UP = 0.15
#: Largest distance of the contact from the ball that counts as met [m].
_NEAR: Final = 1e-4
#: Largest angle of the normal off the one that is wished that counts as met [rad].
ASTRAY: Final = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Impact(Settings):
    """How a ball and a paddle part.

    Attributes:
        mass: Mass of the ball [kg].
        restitution: Share e of the speed along the normal that is left, the other way.
            It is that at ``USUAL_SPEED``.
        fall: By how much e is less for each m/s more along the normal [s/m].
        loss: Share of the slip along the face that is lost as velocity.
        drag: Drag coefficient of the ball [1/m].
        radius: Radius of the ball [m]; of 0, its spin does nothing.
        inertia: Its moment of inertia as share of m r^2.
        lift: Its lift constant, of :mod:`mitt.core.ball.spin`.
        spin: Its angular velocity before the impact [rad/s].
    """

    mass: Annotated[float, Range(1e-6, 1e3)]
    restitution: Annotated[float, Range(0.0, 1.0)] = 0.75
    fall: Annotated[float, Range(0.0, 0.1)] = 0.0
    loss: Annotated[float, Range(0.0, 1.0)] = 0.0
    drag: Annotated[float, Range(0.0, 10.0)] = 0.04
    radius: Annotated[float, Range(0.0, 1.0)] = 0.0
    inertia: Annotated[float, Range(0.01, 1.0)] = 0.4
    lift: Annotated[float, Range(0.0, 10.0)] = 0.0
    spin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def given_back(self, speed: float) -> float:
        """Return e of a ball that comes at a speed along the normal [m/s]."""
        return min(max(self.restitution - self.fall * (abs(speed) - USUAL_SPEED), 0.0), 1.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PaddleStrike:
    """How a paddle meets a ball.

    Attributes:
        q: Pose of the arm at the contact [rad], shape (n,).
        dq: Its joint speeds then, the smallest that move the paddle so [rad/s], shape (n,).
        ball: r_o, v_o of the ball then [m, m/s], shape (2, 3).
        normal: Of the paddle, shape (3,).
        v_paddle: Velocity of the paddle [m/s], shape (3,).
        v_out: Velocity of the ball afterwards [m/s], shape (3,).
        T: Time from the contact to the target [s]; 0 of a shield.
        astray: Angle between the normal and the one that the target asks for [rad].
    """

    q: Array
    dq: Array
    ball: Array
    normal: Array
    v_paddle: Array
    v_out: Array
    T: float
    astray: float

    __repr__ = brief


class Aiming(NamedTuple):
    """What the search for a pose knows of an arm, for the kernel."""

    chain: Chain
    normal: Array  # (3,) the paddle's normal in the last joint's frame
    moved: NDArray[np.int64]  # (k,) joints that may turn
    motion: Motion
    rows: Array  # (5, k + 2) the last column is what is left
    square: Array  # (k + 1, k + 1)
    step: Array  # (k + 1,)
    v_out: Array  # (3,)
    end: Array  # (2, 3) scratch of shooting
    faced: Array  # (3,) the normal that was wished last; zero before


class Asked(NamedTuple):
    """What is asked of a strike, for the kernel; as of :class:`Impact` but for what is said.

    Attributes:
        aims: Whether there is a target; a shield faces the ball.
        drag: See there, and ``loss``, ``radius``, ``inertia``, ``lift``, ``spin``.
    """

    aims: bool
    drag: float
    loss: float
    radius: float
    inertia: float
    lift: float
    spin: Vec


def aiming_of(arm: Arm, moved: tuple[int, ...]) -> Aiming:
    """Return the search of an arm, some joints of which may turn."""
    still = arm.q_ready
    last = np.reshape(place(arm.chain, still, motion_of(arm.n)), (3, 3))
    k = len(moved)
    return Aiming(
        arm.chain,
        np.ascontiguousarray(last.T @ arm.orientation(still)[:, 2]),
        np.array(moved, dtype=np.int64),
        motion_of(arm.n),
        np.zeros((5, k + 2)),
        np.zeros((k + 1, k + 1)),
        np.zeros(k + 1),
        np.zeros(3),
        np.zeros((2, 3)),
        np.zeros(3),
    )


def mass_behind(arm: Arm, q: Array, normal: Array) -> float:
    """Return the mass that an arm has behind its paddle along a normal, (3,) [kg]."""
    pull = arm.jacobian(q).T @ normal
    given_way = float(pull @ np.linalg.solve(arm.mass_matrix(q), pull))
    return 1.0 / max(given_way, 1e-12)


def rebound(impact: Impact, behind: float, normal: Array, v_in: Array, v_paddle: Array) -> Array:
    """Return the velocity of a ball after its impact on a paddle [m/s], shape (3,).

    Args:
        impact: How they part.
        behind: Mass behind the paddle [kg]; infinite for one that does not give way.
        normal: Of the paddle, shape (3,).
        v_in: Velocity of the ball before [m/s], shape (3,).
        v_paddle: Velocity of the paddle [m/s], shape (3,).
    """
    u = v_in - v_paddle
    speed = float(u @ normal)
    into = speed * normal
    out: Array = v_in - (1.0 + impact.given_back(speed)) * _share(impact, behind) * into
    return out - impact.loss * slip(impact, normal, u)


def slip(impact: Impact, normal: Array, u: Array) -> Array:
    """Return how fast the ball's surface moves along the face [m/s], shape (3,).

    Args:
        impact: How they part.
        normal: Of the paddle, shape (3,).
        u: Velocity of the ball relative to the paddle [m/s], shape (3,).
    """
    turning = np.cross(np.array(impact.spin), normal)
    return np.asarray(u - (u @ normal) * normal - impact.radius * turning)


def spin_after(impact: Impact, normal: Array, u: Array) -> Array:
    """Return the spin of a ball after its impact [rad/s], shape (3,); as for :func:`slip`."""
    if impact.radius == 0.0:
        return np.array(impact.spin)
    gained = impact.loss / (impact.inertia * impact.radius)
    return np.array(impact.spin) + gained * np.cross(normal, slip(impact, normal, u))


def _share(impact: Impact, behind: float) -> float:
    """Return mu, what the arm's mass leaves of an impact."""
    return 1.0 / (1.0 + impact.mass / behind)


def shot(r: Array, target: Array, T: float, drag: float, lift: Lift = STILL) -> Array:
    """Return the velocity with which a ball flies from a point to another [m/s], shape (3,).

    Args:
        r: Where it starts [m], shape (3,).
        target: Where it is to be [m], shape (3,).
        T: After this time [s].
        drag: Its drag coefficient [1/m].
        lift: What its spin does.
    """
    v, end = (target - r) / T, np.zeros((2, 3))
    for _ in range(8):
        _shoot(r, target, (T, drag), lift, v, end)
    return v


@kernel
def _shoot(
    r: Array, target: Array, of: tuple[float, float], lift: Lift, v: Array, end: Array
) -> None:
    """Improve the velocity ``v`` that leads to a target, of a time and a drag coefficient."""
    T, drag = of
    for _ in range(_ROUNDS):
        for c in range(3):
            end[0, c], end[1, c] = r[c], v[c]
        advance_spinning(end[0], end[1], drag, lift, T)
        for c in range(3):
            v[c] += (target[c] - end[0, c]) / T


@kernel
def _lift_after(v_o: Vec, n: Vec, of: Asked) -> Lift:
    """Return the lift of a ball after an impact along a normal; of a paddle that moves along it."""
    if of.lift == 0.0 or of.radius == 0.0:
        return STILL
    tangential = minus(v_o, times(dot(v_o, n), n))
    s = minus(tangential, times(of.radius, cross(of.spin, n)))
    gained = times(of.loss / (of.inertia * of.radius), cross(n, s))
    x, y, z = of.spin[0] + gained[0], of.spin[1] + gained[1], of.spin[2] + gained[2]
    return of.lift * x, of.lift * y, of.lift * z, 2.0 * of.radius / of.lift


@kernel
def _solve_turned(beta: Vec, size: float, y: Vec) -> Vec:
    """Return x of size x + beta x x = y."""
    both = size * size + dot(beta, beta)
    along, across = dot(beta, y), cross(beta, y)
    return (
        (size * size * y[0] + along * beta[0] - size * across[0]) / (size * both),
        (size * size * y[1] + along * beta[1] - size * across[1]) / (size * both),
        (size * size * y[2] + along * beta[2] - size * across[2]) / (size * both),
    )


@kernel
def _wish(ball: Array, target: Array, T: float, of: Asked, a: Aiming) -> tuple[Vec, Vec]:
    """Return the normal that a target asks for, and how it turns with T.

    Args:
        ball: r_o, v_o [m, m/s], shape (2, 3).
        target: Where the ball is to go [m], shape (3,).
        T: Time of its flight there [s].
        of: What is asked.
        a: The search, whose ``v_out`` is improved, by the lift as of its last normal.
    """
    v_o, faced = row(ball, 1), (a.faced[0], a.faced[1], a.faced[2])
    if not of.aims:
        return times(-1.0 / np.sqrt(dot(v_o, v_o)), v_o), (0.0, 0.0, 0.0)
    lift = STILL if dot(faced, faced) == 0.0 else _lift_after(v_o, faced, of)
    _shoot(ball[0], target, (T, of.drag), lift, a.v_out, a.end)
    v_out = a.v_out[0], a.v_out[1], a.v_out[2]
    change, beta = minus(v_out, times(1.0 - of.loss, v_o)), times(of.loss * of.radius, of.spin)
    less, along = dot(change, change) - dot(beta, beta), dot(beta, change)
    size = np.sqrt(max(0.5 * (less + np.sqrt(less * less + 4.0 * along * along)), 1e-12))
    n = _solve_turned(beta, size, change)
    n = times(1.0 / np.sqrt(max(dot(n, n), 1e-12)), n)
    rate = _solve_turned(beta, size, times(-1.0 / T, row(a.end, 1)))
    longer = _solve_turned(beta, size, n)
    for c in range(3):
        a.faced[c] = n[c]
    return n, minus(rate, times(dot(rate, n) / dot(longer, n), longer))


@kernel
def _across(n: Vec) -> tuple[Vec, Vec]:
    """Return two unit vectors across another."""
    x, y = abs(n[0]), abs(n[1])
    off: Vec = (1.0, 0.0, 0.0) if x < 0.6 else ((0.0, 1.0, 0.0) if y < 0.6 else (0.0, 0.0, 1.0))
    first = cross(n, off)
    first = times(1.0 / np.sqrt(dot(first, first)), first)
    return first, cross(n, first)


@kernel
def _expand(a: Aiming, q: Array, r: Vec, wish: tuple[Vec, Vec]) -> float:
    """Write the rows at a pose, for a place and a normal; return the angle off the normal."""
    last, k = place(a.chain, q, a.motion), len(a.moved)
    normal = rotate(last, (a.normal[0], a.normal[1], a.normal[2]))
    n, dn = wish
    first, second = _across(n)
    miss = minus(r, row(a.motion.tip, 0))
    for b in range(k):
        J = row(a.motion.J, a.moved[b])
        turned = cross(row(a.motion.W, a.moved[b]), normal)
        for c in range(3):
            a.rows[c, b] = _WEIGHT * J[c]
        a.rows[3, b], a.rows[4, b] = dot(first, turned), dot(second, turned)
    for c in range(3):
        a.rows[c, k], a.rows[c, k + 1] = 0.0, _WEIGHT * miss[c]
    a.rows[3, k], a.rows[4, k] = -dot(first, dn), -dot(second, dn)
    a.rows[3, k + 1], a.rows[4, k + 1] = -dot(first, normal), -dot(second, normal)
    return float(np.arctan2(np.hypot(a.rows[3, k + 1], a.rows[4, k + 1]), dot(n, normal)))


@kernel
def _least(a: Aiming) -> None:
    """Write the least step of least squares of the rows, by Cholesky's factors."""
    G, x, k = a.square, a.step, len(a.step)
    for i in range(k):
        x[i] = 0.0
        for c in range(5):
            x[i] += a.rows[c, i] * a.rows[c, k]
        for j in range(i + 1):
            G[i, j] = _DAMPING if i == j else 0.0
            for c in range(5):
                G[i, j] += a.rows[c, i] * a.rows[c, j]
    for i in range(k):
        for j in range(i + 1):
            for b in range(j):
                G[i, j] -= G[i, b] * G[j, b]
            G[i, j] = np.sqrt(max(G[i, i], 1e-300)) if i == j else G[i, j] / G[j, j]
        for b in range(i):
            x[i] -= G[i, b] * x[b]
        x[i] /= G[i, i]
    for back in range(k):
        i = k - 1 - back
        for b in range(i + 1, k):
            x[i] -= G[b, i] * x[b]
        x[i] /= G[i, i]


@big_kernel
def search_strike(a: Aiming, ball: Array, target: Array, of: Asked, q: Array, out: Array) -> None:
    """Improve a pose ``q`` to one that sends a ball to a target.

    Args:
        a: The search; its ``v_out`` is the velocity after the impact that is looked for, too.
        ball: r_o, v_o at the contact [m, m/s], shape (2, 3).
        target: Where the ball is to go [m], shape (3,).
        of: What is asked.
        q: The pose [rad], shape (n,), overwritten.
        out: First T from which the search starts [s]; result: T, angle off the normal [rad],
            distance of the paddle from the ball [m], shape (3,).
    """
    T, k, r = out[0], len(a.moved), row(ball, 0)
    for c in range(3):
        a.v_out[c] = (target[c] - ball[0, c]) / T
    a.v_out[2] += 4.9 * T
    a.faced[:] = 0.0
    wish = _wish(ball, target, T, of, a)
    for _ in range(_STEPS):
        wish = _wish(ball, target, T, of, a)
        _expand(a, q, r, wish)
        _least(a)
        largest = abs(a.step[k]) / _LATER
        for b in range(k):
            largest = max(largest, abs(a.step[b]) / _TURN)
        share = 1.0 / max(largest, 1.0)
        for b in range(k):
            q[a.moved[b]] += share * a.step[b]
        T = min(max(T + share * a.step[k], _BRIEFEST), _LONGEST)
        if largest < _SETTLED:
            break
    for _ in range(2):  # the place is met exactly, also where the direction is not
        _expand(a, q, r, wish)
        a.rows[3:] = 0.0
        a.rows[:, k] = 0.0
        _least(a)
        for b in range(k):
            q[a.moved[b]] += a.step[b]
    out[0] = T
    out[1] = _expand(a, q, r, _wish(ball, target, T, of, a))
    miss = minus(r, row(a.motion.tip, 0))
    out[2] = np.sqrt(dot(miss, miss))


def aim_at_target(
    arm: Arm,
    a: Aiming,
    ball: Array,
    target: Array | None,
    impact: Impact,
    start: Array,
    *,
    T: float | None = None,
) -> PaddleStrike | None:
    """Return how a paddle sends a ball to a target; None where it cannot be brought there.

    A direction that is met only in part is returned, with what is left of it.

    Args:
        arm: The arm.
        a: Its search, of :func:`aiming_of`.
        ball: r_o, v_o at the contact [m, m/s], shape (2, 3).
        target: Where the ball is to go [m], shape (3,); None for a shield: in its way, at rest.
        impact: How they part.
        start: Pose from which the search starts [rad], shape (n,).
        T: Time of the flight to the target from which it starts [s].
    """
    ball = checks.array("ball", ball, (2, 3), finite=True)
    aims = target is not None
    to = checks.vector("target", ball[0] if target is None else target, 3, finite=True)
    away = float(np.linalg.norm(to - ball[0]))
    found = np.array([max(away / _USUAL, 0.3) if T is None else T, 0.0, 0.0])
    q = checks.vector("start", start, arm.n, finite=True).copy()
    asked = Asked(
        aims,
        impact.drag,
        impact.loss,
        impact.radius,
        impact.inertia,
        impact.lift,
        (float(impact.spin[0]), float(impact.spin[1]), float(impact.spin[2])),
    )
    search_strike(a, ball, to, asked, q, found)
    if not (np.all(np.isfinite(q)) and found[2] < _NEAR and found[1] < 0.5 * np.pi):
        return None
    normal = arm.orientation(q)[:, 2]
    behind, v_o = mass_behind(arm, q, normal), ball[1]
    v_paddle = np.zeros(3)
    if aims:
        change = float((v_o - a.v_out) @ normal) / _share(impact, behind)
        into = change / (1.0 + impact.restitution)
        for _ in range(_ROUNDS):
            into = change / (1.0 + impact.given_back(into))
        v_paddle = (v_o @ normal - into) * normal
    v_out = rebound(impact, behind, normal, v_o, v_paddle)
    return PaddleStrike(
        q=q,
        dq=_speeds(arm, q, v_paddle),
        ball=ball,
        normal=normal,
        v_paddle=v_paddle,
        v_out=v_out,
        T=float(found[0]) if aims else 0.0,
        astray=float(found[1]),
    )


def attained(arm: Arm) -> Array:
    """Return the joint speeds that limits of speed and acceleration allow at a contact, (n,)."""
    return np.minimum(arm.dq_max, _RUN_UP * arm_numbers(arm).ddq_max)


def _speeds(arm: Arm, q: Array, v: Array) -> Array:
    """Return the least joint speeds, as shares of their limits, that move the paddle so, (n,)."""
    J, most = arm.jacobian(q), attained(arm)
    spread = most[:, None] ** 2 * J.T if np.all(np.isfinite(most)) else J.T
    dq: Array = spread @ np.linalg.solve(J @ spread, v)
    return dq


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Restitution(Settings):
    """What is known of a ball's restitution from its hits; a filter of one number.

    Attributes:
        mean: Restitution e as it is believed.
        sigma: Its 1-sigma.
        drift: By how much e may differ from one hit to the next, 1 sigma.
        sigma_v: Error of the measured speed after a hit, along the normal, 1 sigma [m/s].
        fall: By how much e is taken to fall with speed [s/m]; e is that at ``USUAL_SPEED``.
    """

    mean: Annotated[float, Range(0.0, 1.0)] = 0.75
    sigma: Annotated[float, Range(0.0, 1.0)] = 0.05
    drift: Annotated[float, Range(0.0, 1.0)] = 0.002
    sigma_v: Annotated[float, Range(1e-6, 10.0)] = 0.05
    fall: Annotated[float, Range(0.0, 0.1)] = 0.0

    def after(
        self, strike: PaddleStrike, behind: float, mass: float, v_out: Array
    ) -> "Restitution":
        """Return what is known after a hit.

        Args:
            strike: The hit as it was: velocities of ball and paddle before it, and the normal.
            behind: Mass behind the paddle, of :func:`mass_behind` [kg].
            mass: Mass of the ball [kg].
            v_out: Velocity of the ball after it, as it was seen [m/s], shape (3,).
        """
        v_out = checks.vector("v_out", v_out, 3, finite=True)
        n, v_in = strike.normal, strike.ball[1]
        speed = float((v_in - strike.v_paddle) @ n)
        into = speed / (1.0 + mass / behind)
        variance = self.sigma**2 + self.drift**2
        if not into < 0.0:  # they did not meet
            return self
        seen = float((v_in - v_out) @ n) / into - 1.0 + self.fall * (abs(speed) - USUAL_SPEED)
        gain = variance / (variance + (self.sigma_v / into) ** 2)
        mean = min(max(self.mean + gain * (seen - self.mean), 0.0), 1.0)
        return replace(self, mean=mean, sigma=float(np.sqrt((1.0 - gain) * variance)))


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Grip(Settings):
    """What is known of how rubber and ball grip, from hits; a filter of two numbers.

    Of the change of velocity along the face, -loss (u_t - gain r omega x n), ``loss`` and
    ``loss gain`` are learned. The gain corrects the spin, as it is known from the flight: of a ball
    whose lift is not as expected, by as much.

    Attributes:
        loss: As of :class:`Impact`.
        gain: True spin over the estimated.
        sigma: 1-sigma of the loss, as share of it.
        sigma_gain: 1-sigma of the gain.
        drift: By how much either may differ from one hit to the next, as share of the loss.
        sigma_v: Error of the measured speed along the face, 1 sigma [m/s].
        covariance: Variance of ``loss``, covariance, variance of ``loss gain``, after hits; before
            any it follows from the sigmas.
    """

    loss: Annotated[float, Range(0.0, 1.0)]
    gain: Annotated[float, Range(0.0, 10.0)] = 1.0
    sigma: Annotated[float, Range(0.0, 1.0)] = 0.12
    sigma_gain: Annotated[float, Range(0.0, 1.0)] = 0.1
    drift: Annotated[float, Range(0.0, 1.0)] = 0.005
    sigma_v: Annotated[float, Range(1e-6, 10.0)] = 0.1
    covariance: tuple[float, float, float] | None = None

    def after(self, impact: Impact, strike: PaddleStrike, v_out: Array, vague: float) -> "Grip":
        """Return what is known after a hit; an odd one teaches nothing.

        Args:
            impact: The ball, with the spin that was estimated before any gain.
            strike: The hit as it was.
            v_out: Velocity of the ball after it, as it was seen [m/s], shape (3,).
            vague: 1-sigma of the part of the spin that its flight does not show [rad/s].
        """
        v_out = checks.vector("v_out", v_out, 3, finite=True)
        n, v_in = strike.normal, strike.ball[1]
        u = v_in - strike.v_paddle
        aside, turning = u - (u @ n) * n, impact.radius * np.cross(np.array(impact.spin), n)
        change = (v_out - v_in) - ((v_out - v_in) @ n) * n
        x, P = np.array([self.loss, self.loss * self.gain]), self._square
        rows = np.column_stack([-aside, turning])
        unseen = impact.radius * np.cross(v_in / float(np.linalg.norm(v_in)), n) * vague
        R = self.sigma_v**2 * np.eye(3) + self.loss**2 * np.outer(unseen, unseen)
        S, off = rows @ P @ rows.T + R, change - rows @ x
        if off @ np.linalg.solve(S, off) > _ODD:
            return self
        K = P @ rows.T @ np.linalg.inv(S)
        x, P = x + K @ off, (np.eye(2) - K @ rows) @ P
        loss = min(max(float(x[0]), 1e-3), 1.0)
        return replace(
            self,
            loss=loss,
            gain=min(max(float(x[1]) / loss, 0.0), 10.0),
            covariance=(float(P[0, 0]), float(P[0, 1]), float(P[1, 1])),
        )

    @property
    def _square(self) -> Array:
        """Covariance of ``loss`` and ``loss gain`` before a hit, shape (2, 2)."""
        a = (self.loss * self.sigma) ** 2
        wide = a, a, a + (self.loss * self.sigma_gain) ** 2
        a, b, c = self.covariance or wide
        moved = (self.drift * self.loss) ** 2
        return np.array([[a + moved, b], [b, c + moved]])
