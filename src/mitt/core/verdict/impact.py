"""What a caught ball does to the arm: its impact and its weight in the brake.

A verdict of a generator knows the way to the catch; here is what comes after it. The ball and the
hand become one body: an impulse p = (1/m + J M^-1 J')^-1 v_rel passes between them (momentum is
kept, the ball sticks), and the joints change their speed by M^-1 J' p, the more the farther the
ball springs back at first. Then the arm brakes with the ball's mass at its hand, which has to hold
the ball (:mod:`mitt.core.verdict.holding`).

| here      | meaning                                                       | unit  | shape    |
|-----------|---------------------------------------------------------------|-------|----------|
| ``v_rel`` | velocity of the ball relative to the catch point at the catch | m/s   | (3,)     |
| ``jump``  | change of the joint speeds by the impact                      | rad/s | (n,)     |
| ``cap``   | largest joint speeds before the catch that leave room for it  | rad/s | (n,)     |

A motion that asks for more than a limit is run, tick by tick, through envelope and controller on
the model of the arm: 2 % too much of a motor makes the arm a few millimetres late, or not at all,
if it has the time to make up for it. What counts is how far the hand is from its place then.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mitt.core.arm.arm import Arm, Tables
from mitt.core.arm.catch import CaughtBall
from mitt.core.arm.dynamics import bias_and_mass, solve_positive
from mitt.core.control.closing import TOUCH_BEFORE
from mitt.core.control.envelope import bounds_of, clamp, speeds_of
from mitt.core.control.stop import Brake, MassWork, mass_work, plan_brake
from mitt.core.control.tracking import Tracking, track, tracking_of
from mitt.core.kernels import Record, kernel
from mitt.core.map.demand import shares_of, uniform
from mitt.core.signals import TICK, Array
from mitt.core.verdict.feasibility import Approach, Outcome, Verdict
from mitt.core.verdict.holding import force_of, hand_shares
from mitt.core.verdict.pieces import Pieces

#: Distance of the ball from the catch point at which the fingers still close around it [m].
GRASP = 0.030
#: By what an impact may be harder than that of two rigid bodies: 500 impacts of 0.2 to 0.5 kg
#: changed the speed of joint 4 by 0.85 to 1.18 times as much.
_HARDER = 1.2
#: Share of the way to the end of its range that a joint may need to come to rest with the ball; it
#: is kept slower where it would need more.
_ROOM = 0.9
#: Share of its way that the planned brake needs at most: it is found to within 4 % of its rate, and
#: leaves 2 % of the torque to feedback (:mod:`mitt.core.control.stop`).
_HARDEST = 0.94
#: Ticks of a motion that are run on the model in one piece: 0.2 ms or so.
_STRETCH = 50
#: Rounds in which caps and the impact at these caps are made to agree.
_ROUNDS = 4
#: Share of its speed limit to which a joint is slowed down at most, for an impact and for a brake.
#: Slower, with 48 V and half a kilogram, the impact was harder than expected (8 ticks in 3 of 20).
_SLOWEST = 0.7
_SLOWEST_TO_BRAKE = 0.4


def speed_jump(arm: Arm, q: Array, v_rel: Array, mass: float) -> Array:
    """Return the change of the joint speeds when a ball sticks to the catch point [rad/s], (n,).

    Args:
        arm: The arm, without the ball.
        q: Joint angles at the catch [rad], shape (n,).
        v_rel: Velocity of the ball relative to the catch point [m/s], shape (3,).
        mass: Of the ball [kg].
    """
    jump: Array = _answer(arm, q, mass) @ v_rel
    return jump


def _answer(arm: Arm, q: Array, mass: float) -> Array:
    """Return how the joint speeds answer to the ball's relative velocity [rad/m], shape (n, 3)."""
    if mass < 1e-9:  # it moves no arm
        return np.zeros((arm.n, 3))
    J = arm.jacobian(q)
    push = np.linalg.solve(arm.mass_matrix(q), J.T)  # M^-1 J'
    answer: Array = np.linalg.solve((np.eye(3) / mass + J @ push).T, push.T).T
    return answer


def relative_velocity(arm: Arm, approach: Approach, cap: Array) -> Array:
    """Return the ball's velocity relative to the catch point, joints no faster than a cap [m/s].

    Args:
        arm: The arm, without the ball.
        approach: The motion to the catch.
        cap: Largest joint speeds [rad/s], shape (n,).
    """
    q, dq = approach.motion[-1, :2]
    relative: Array = approach.dr_o - arm.jacobian(q) @ np.clip(dq, -cap, cap)
    return relative


def speed_caps(
    arm: Arm, approach: Approach, ball: CaughtBall, pieces: Pieces | None = None
) -> Array:
    """Return the joint speeds that leave room for the impact and the brake [rad/s], shape (n,).

    Not to be written to; ``pieces`` as of :func:`examined`.
    """
    pieces = pieces or Pieces()
    return pieces.whole("slowed", _slowed, arm, approach, ball, pieces)[0]


def _slowed(
    arm: Arm, approach: Approach, ball: CaughtBall, pieces: Pieces
) -> tuple[Array, Brake, Array]:
    """Return these speeds, the brake after a catch at them, and where it ends [rad], shape (n,)."""
    cap = pieces.of("impact", _impact_caps, arm, approach, ball)
    for k in range(_ROUNDS):
        brake, start, rest = pieces.of(f"brake {k}", _stop, arm, approach, ball, cap)
        way = np.where(rest >= start, 1.0, -1.0)
        end = _end(arm, _ROOM * way)
        end = np.where(way * (end - start) > 0.0, end, _end(arm, way))
        room = way * (end - start) / np.maximum(way * (rest - start), 1e-9)
        if np.all(room >= 1.0):
            return cap, brake, rest
        speed = np.abs(np.clip(approach.motion[-1, 1], -cap, cap))
        slower = np.maximum(
            np.sqrt(np.maximum(room, 0.0)) * speed, _SLOWEST_TO_BRAKE * speeds_of(arm)
        )
        cap = np.where(room < 1.0, np.minimum(cap, slower), cap)
    brake, _, rest = pieces.of("brake", _stop, arm, approach, ball, cap)
    return cap, brake, rest


def _end(arm: Arm, share: Array) -> Array:
    """Return where so much of the half range of each joint is used, signed [rad], shape (n,)."""
    end: Array = 0.5 * (arm.q_max + arm.q_min) + 0.5 * share * (arm.q_max - arm.q_min)
    return end


def _stop(arm: Arm, approach: Approach, ball: CaughtBall, cap: Array) -> tuple[Brake, Array, Array]:
    """Return the brake after a catch at capped speeds, and where it begins and ends [rad], (n,)."""
    q, dq = approach.motion[-1, 0], np.clip(approach.motion[-1, 1], -cap, cap)
    after = dq + speed_jump(arm, q, relative_velocity(arm, approach, cap), ball.heaviest)
    # An arm that is short of room brakes from the first touch of the fingers on.
    start = q + TOUCH_BEFORE * dq
    brake = plan_brake(arm.holding(ball.heaviest), 0.0, np.array([start, after, np.zeros(arm.n)]))
    return brake, start, start + _HARDEST * (brake.q_end - start)


def _impact_caps(arm: Arm, approach: Approach, ball: CaughtBall) -> Array:
    """Return the joint speeds that leave room for the impact [rad/s], shape (n,).

    A joint that the ball drives on in its own direction must stay below its limit afterwards;
    one that it slows down needs no room.
    """
    fastest, (q, wanted) = speeds_of(arm), approach.motion[-1, :2]
    J, way = arm.jacobian(q), np.sign(wanted)
    answer = _hardest(arm, q, ball)
    # A slower joint is driven on farther; it gains 5 % of what it gives up at the least.
    give = np.clip(np.diag(answer @ J), 0.0, 0.95)
    cap: Array = fastest
    for _ in range(_ROUNDS):
        dq = np.clip(wanted, -cap, cap)
        jump = way * (answer @ (approach.dr_o - J @ dq))
        room = (fastest - jump - give * np.abs(dq)) / (1.0 - give)
        cap = np.where(jump > 0.0, np.clip(room, _SLOWEST * fastest, fastest), fastest)
    return cap


def speed_jumps(
    arm: Arm, approach: Approach, ball: CaughtBall, pieces: Pieces | None = None
) -> Array:
    """Return by how much the ball changes the joint speeds at its hardest [rad/s], shape (n,).

    ``pieces`` as of :func:`examined`.
    """
    pieces = pieces or Pieces()
    cap = speed_caps(arm, approach, ball, pieces)
    return pieces.of("jumps", _jumps_at, arm, approach, ball, cap)


def _jumps_at(arm: Arm, approach: Approach, ball: CaughtBall, cap: Array) -> Array:
    """Return the same for joints no faster than a cap [rad/s], shape (n,)."""
    v_rel = relative_velocity(arm, approach, cap)
    jumps: Array = _hardest(arm, approach.motion[-1, 0], ball) @ v_rel
    return jumps


def _hardest(arm: Arm, q: Array, ball: CaughtBall) -> Array:
    """Return :func:`_answer` for the heaviest ball, while it springs back, shape (n, 3)."""
    out: Array = _HARDER * (1.0 + ball.restitution) * _answer(arm, q, ball.heaviest)
    return out


def examined(
    arm: Arm,
    verdict: Verdict,
    ball: CaughtBall,
    *,
    bandwidth: float,
    pieces: Pieces | None = None,
) -> Verdict:
    """Return a verdict that has looked at what the arm will do, up to the catch and after it.

    One that refuses for torque or speed is run on the model (:func:`gap_at_catch`); one that is
    feasible, then, looks beyond the catch. Any other stays as it is, as a generator's that refuses
    although no limit is exceeded.

    Args:
        arm: The arm, without the ball.
        verdict: What the generator says.
        ball: The ball.
        bandwidth: Of the tracking error [rad/s].
        pieces: What is known of this approach, and how much may be worked out; all if left out.

    Raises:
        Unfinished: It is to be gone on with.
    """
    pieces = pieces or Pieces()
    if verdict.approach is None:
        return verdict
    if verdict.outcome is Outcome.UNREACHABLE and verdict.share > 1.0:
        verdict = _rehearsed(arm, verdict, verdict.approach, ball, bandwidth, pieces)
    if verdict.outcome is not Outcome.FEASIBLE or verdict.approach is None:
        return verdict
    shares = shares_after(arm, verdict.approach, ball, pieces)
    binding = max(shares, key=lambda name: shares[name])
    if shares[binding] <= verdict.share:
        return verdict
    outcome = Outcome.FEASIBLE if shares[binding] <= 1.0 else Outcome.UNREACHABLE
    return replace(verdict, outcome=outcome, binding_limit=binding, share=shares[binding])


def _rehearsed(
    arm: Arm,
    verdict: Verdict,
    approach: Approach,
    ball: CaughtBall,
    bandwidth: float,
    pieces: Pieces,
) -> Verdict:
    """Return the verdict by how far the hand will be from its place, where no range is exceeded."""
    endless = uniform(np.inf)
    shares = pieces.of("ranges", shares_of, arm, approach.motion, endless)
    if not np.all(np.isfinite(approach.motion)) or max(shares.values()) > 1.0:
        return verdict
    caps = speed_caps(arm, approach, ball, pieces)
    share = gap_at_catch(arm, approach, caps, bandwidth, pieces) / GRASP
    outcome = Outcome.FEASIBLE if share <= 1.0 else Outcome.UNREACHABLE
    return replace(verdict, outcome=outcome, share=share)


def shares_after(
    arm: Arm, approach: Approach, ball: CaughtBall, pieces: Pieces | None = None
) -> dict[str, float]:
    """Return the largest share of each limit that catch and brake ask for; 1 is the limit.

    Returns:
        ``impact:NAME`` the way by which the hand comes late where the joint is kept slow for the
        impact, in units of what the hand tolerates, or the speed that the ball drives it to where
        no room suffices (``speed:NAME`` where its own limit keeps it slow); ``brake:NAME`` where
        the joint comes to rest, in its range; ``grip`` the pull on the fingers, in units of what
        they hold; ``hand`` the time that they need to close, in units of what is left until the
        catch; ``palm`` how far the ball comes from the side or from behind the palm;
        ``spill`` how far the ball leaves the bottom of a basket, in units of its depth; ``force``
        the largest force of a contact, in units of what hand and arm take.
    """
    pieces = pieces or Pieces()
    return pieces.whole("after", _shares_after, arm, approach, ball, pieces)


def _shares_after(
    arm: Arm, approach: Approach, ball: CaughtBall, pieces: Pieces
) -> dict[str, float]:
    """Return the same."""
    cap, brake, end = pieces.whole("slowed", _slowed, arm, approach, ball, pieces)
    dq = np.clip(approach.motion[-1, 1], -cap, cap)
    middle, half = 0.5 * (arm.q_max + arm.q_min), 0.5 * (arm.q_max - arm.q_min)
    rest = np.abs(end - middle) / half
    late = pieces.of("late", _lateness, arm, approach, cap) / GRASP
    driven = np.abs(dq + speed_jumps(arm, approach, ball, pieces)) / arm.dq_max
    late = np.where(driven > 1.001, np.maximum(late, driven), late)
    slowed = cap < speeds_of(arm)
    shares = {f"brake:{name}": float(x) for name, x in zip(arm.names, rest, strict=True)}
    for name, x, kept in zip(arm.names, late.tolist(), slowed.tolist(), strict=True):
        shares[f"{'impact' if kept else 'speed'}:{name}"] = x
    v_rel = relative_velocity(arm, approach, cap)
    q, left = approach.motion[-1, 0], approach.step * (len(approach.motion) - 1)
    shares |= pieces.of("hand", hand_shares, arm, brake, ball, q=q, v_rel=v_rel, left=left)
    if np.isfinite(arm.force):
        shares["force"] = pieces.of("force", force_of, arm, q, v_rel, ball) / arm.force
    return shares


def harms(arm: Arm, verdict: Verdict, ball: CaughtBall, pieces: Pieces | None = None) -> bool:
    """Say whether the catch of a verdict would drive a joint too far, or not keep the ball.

    Fingers that should have begun to close may have done so.
    """
    if verdict.approach is None:
        return False
    shares = shares_after(arm, verdict.approach, ball, pieces)
    return any(x > 1.0 for name, x in shares.items() if not name.startswith(("speed:", "hand")))


def _lateness(arm: Arm, approach: Approach, cap: Array) -> Array:
    """Return by how far each joint, kept below its cap, brings the hand late [m], shape (n,)."""
    place, step = approach.motion[0, 0].copy(), cap * approach.step
    for wanted in approach.motion[1:, 0]:
        place = np.clip(wanted, place - step, place + step)
    gap = np.abs(approach.motion[-1, 0] - place)
    late: Array = gap * np.linalg.norm(arm.jacobian(approach.motion[-1, 0]), axis=0)
    return late


def gap_at_catch(
    arm: Arm, approach: Approach, caps: Array, bandwidth: float, pieces: Pieces | None = None
) -> float:
    """Return how far the hand will be from its place at the catch [m].

    Args:
        arm: The arm.
        approach: The motion that is asked for.
        caps: Largest joint speeds that are emitted [rad/s], shape (n,).
        bandwidth: Of the tracking error [rad/s].
        pieces: As of :func:`examined`.
    """
    pieces = pieces or Pieces()
    run = pieces.of("run", _run_of, arm, approach, caps)
    for k in range(0, len(run.rows) - 1, _STRETCH):
        pieces.of(f"run {k}", _run_on, arm, run, bandwidth, k)
    there, desired = arm.position(run.state[0]), arm.position(run.rows[-1, 0])
    return float(np.linalg.norm(there - desired))


class _Run(NamedTuple):
    """A motion that is run on the model; see :func:`follow_within_limits`."""

    bounds: Record
    rows: Array
    state: Array
    last: Array
    tracking: Tracking
    mass: MassWork


def _run_of(arm: Arm, approach: Approach, caps: Array) -> _Run:
    """Return a motion before its first tick."""
    rows, b = _each_tick(approach), bounds_of(arm)
    b["dq_max"] = np.minimum(b["dq_max"], caps)
    state, last = rows[0, :2].copy(), np.zeros((3, arm.n))
    last[:2] = state
    return _Run(b, rows, state, last, tracking_of(arm), mass_work(arm))


def _run_on(arm: Arm, run: _Run, bandwidth: float, first: int) -> None:
    """Let it go on for a stretch, from a tick on."""
    rows = run.rows[first : first + _STRETCH + 1]
    follow_within_limits(
        arm.tables, run.bounds, bandwidth, rows, run.state, run.last, run.tracking, run.mass
    )


def _each_tick(approach: Approach) -> Array:
    """Return the motion at every tick, by cubics between its instants, shape (K, 3, n)."""
    known, h = approach.motion, approach.step
    t = np.linspace(0.0, h * (len(known) - 1), max(round(h * (len(known) - 1) / TICK), 1) + 1)
    k = np.minimum((t / h).astype(np.int64), len(known) - 2)
    x = (t / h - k)[:, None]
    p, v, q, w = known[k, 0], h * known[k, 1], known[k + 1, 0], h * known[k + 1, 1]
    c, d = 3.0 * (q - p) - 2.0 * v - w, 2.0 * (p - q) + v + w
    place = p + x * (v + x * (c + x * d))
    speed = (v + x * (2.0 * c + 3.0 * x * d)) / h
    rate = (1.0 - x) * known[k, 2] + x * known[k + 1, 2]
    return np.ascontiguousarray(np.stack([place, speed, rate], axis=1))


@kernel
def follow_within_limits(
    arm: Tables,
    b: Record,
    bandwidth: float,
    rows: Array,
    state: Array,
    last: Array,
    w: Tracking,
    m: MassWork,
) -> None:
    """Carry q, dq on along a motion within all limits, on the model of the arm.

    Args:
        arm: As of ``Arm.tables``.
        b: Limits, as of :func:`mitt.core.control.envelope.bounds_of`.
        bandwidth: Of the tracking error [rad/s].
        rows: q_d, dq_d, ddq_d at each tick, shape (K, 3, n); the last is where the motion ends.
        state: q, dq, overwritten [rad, rad/s], shape (2, n).
        last: q, dq, ddq commanded before, overwritten [rad ...], shape (3, n).
        w: Of the tracking, before the first torques.
        m: Scratch.
    """
    bodies, index, n = arm.bodies, arm.active, state.shape[1]
    command = np.zeros((4, n))
    motion, system = np.zeros((3, n)), np.zeros((n, n + 1))
    for k in range(len(rows) - 1):
        command[:3] = rows[k]
        clamp(b, last, command[:3])
        last[:] = command[:3]
        track(w, arm, b, bandwidth, state, command, TICK)
        w.before[:] = command[3]
        motion[:2] = state
        bias_and_mass(bodies, motion, m.tau, m.mass, m.work)
        for i in range(n):
            for j in range(n):
                system[i, j] = m.mass[index[i], j]
            system[i, n] = command[3, i] - m.tau[index[i]]
        solve_positive(system)
        for j in range(n):
            ddq = system[j, n]
            state[0, j] += TICK * (state[1, j] + 0.5 * TICK * ddq)
            state[1, j] += TICK * ddq
