"""Adversarial commands through the envelope of one joint, checked by an independent rule.

The rule is written from the promise, not from the envelope's code: finite differences of what was
emitted, the way to standstill, and equality where nothing had to change.
"""

from dataclasses import dataclass

import numpy as np

from mitt.core.control.envelope import BOUNDS, clamp_joint, clamp_smooth
from mitt.core.kernels import kernel
from mitt.core.signals import TICK, Array

#: Excess beyond a limit that is rounding, and how far inside a wish must be to pass untouched.
ROUNDING = 1e-9
INSIDE = 1e-9
#: Ticks for which one adversary drives one joint, and one with a jerk limit. Of so many commands
#: one is to such a joint: its way to standstill is walked each time.
EPISODE = 500
SMOOTH_EPISODE = 3000
SMOOTH_SHARE = 50

#: What an adversary does.
STEADY, WANDER, JUMP, BANG, HUGE, BROKEN, EDGE, TINY = range(8)
MODES = 8


@dataclass(frozen=True, slots=True)
class Count:
    """What became of the commands.

    Attributes:
        commands: Single-joint commands emitted.
        violations: Those that broke a rule.
        non_finite: Those that were not finite.
        changed: Those that were not what was wanted.
        outside: Those from a state outside the limits.
    """

    commands: int
    violations: int
    non_finite: int
    changed: int
    outside: int


def soak(commands: int, *, seed: int) -> Count:
    """Send ``commands`` adversarial commands through the envelope, some to joints with jerk."""
    counts = np.zeros(4, dtype=np.int64)
    smooth = commands // SMOOTH_SHARE
    _drive(commands - smooth, seed, counts, np.zeros(1, BOUNDS))
    _drive_smooth(smooth, seed, counts, np.zeros(1, BOUNDS))
    return Count(commands, *(int(x) for x in counts))


@kernel
def inside(b: Array, q: float, dq: float, slack: float) -> bool:
    """Say whether a joint is in its range, below its speed and able to stop in its range."""
    if not (b[0] - slack <= q <= b[1] + slack and abs(dq) <= b[2] + slack):
        return False
    end = q + 0.5 * dq * abs(dq) / b[3]
    return bool(b[0] - slack <= end <= b[1] + slack)


@kernel
def obeys(b: Array, q0: float, dq0: float, q: float, dq: float, ddq: float) -> bool:
    """Say whether a motion may follow another one."""
    e = ROUNDING
    if abs(q - q0) > b[2] * TICK + e or abs(dq - dq0) > b[4] * TICK + e or abs(ddq) > b[4] + e:
        return False
    if inside(b, q0, dq0, 0.0):
        return bool(inside(b, q, dq, e))
    beyond0, beyond = max(q0 - b[1], b[0] - q0, 0.0), max(q - b[1], b[0] - q, 0.0)
    fast0, fast = max(abs(dq0) - b[2], 0.0), max(abs(dq) - b[2], 0.0)
    back = beyond <= max(beyond0 - b[2] * TICK, 0.0) + e
    return bool(back and fast <= max(fast0 - b[4] * TICK, 0.0) + e)


@kernel
def _may_pass(b: Array, q0: float, dq0: float, q: float, dq: float, ddq: float) -> bool:
    """Say whether a wish is within every limit by a hair, so that it must pass untouched."""
    e = INSIDE
    return bool(
        abs(q - q0) < b[2] * TICK - e
        and abs(dq - dq0) < b[4] * TICK - e
        and abs(ddq) < b[4] - e
        and inside(b, q, dq, -e)
    )


@kernel
def _wish(
    mode: int, b: Array, q0: float, dq0: float, tick: int, goal: float
) -> tuple[float, float, float]:
    """Return what the adversary wants next."""
    x, y, z = np.random.random(), np.random.random(), np.random.random()  # noqa: NPY002 (compiled)
    if mode == STEADY:
        return q0 + dq0 * TICK, dq0 + (y - 0.5) * b[4] * TICK, (z - 0.5) * b[4]
    if mode == WANDER:
        return q0 + 3.0 * (x - 0.5) * b[2] * TICK, dq0 + 3.0 * (y - 0.5) * b[4] * TICK, goal
    if mode == JUMP:
        return 8.0 * (x - 0.5), 60.0 * (y - 0.5), 4000.0 * (z - 0.5)
    if mode == BANG:
        sign = 1.0 if goal > 0.0 else -1.0
        return q0 + sign * b[2] * TICK, sign * b[2] * 1.5, sign * b[4] * 1.5
    if mode == HUGE:
        return 1e9 * (x - 0.5) * 10.0 ** (60.0 * y), 1e200 * (y - 0.5), -1e300 * (z - 0.5)
    if mode == BROKEN:
        bad = np.nan if x < 0.34 else np.inf if x < 0.67 else -np.inf
        return (bad if y < 0.5 else q0), (bad if z < 0.5 else dq0), (bad if y > 0.3 else 0.0)
    if mode == EDGE:
        end = b[1] if goal > 0.0 else b[0]
        return end + 1e-12 * (x - 0.5), np.copysign(b[2], goal) * (1.0 + 1e-13 * y), b[4]
    return q0 + 1e-300 * x, 5e-324 * tick, -1e-310


@kernel
def _limits(b: Array) -> None:
    """Draw the limits of a joint."""
    u = np.random.random(5)  # noqa: NPY002 (compiled)
    b[0] = -0.05 - 3.0 * u[0]
    b[1] = 0.05 + 3.0 * u[1]
    b[2] = 0.2 + 20.0 * u[2] * u[2]
    b[3] = 5.0 + 200.0 * u[3]
    b[4] = b[3] * (1.0 + 5.0 * u[4] * u[4])


@kernel
def _fill(b: Array, jerk: float, joint: Array) -> None:
    """Write limits as the envelope takes them."""
    k = joint[0]
    k.q_min, k.q_max, k.dq_max = b[0], b[1], b[2]
    k.deceleration, k.ddq_max, k.jerk = b[3], b[4], jerk


@kernel
def _start(b: Array) -> tuple[float, float]:
    """Draw a state, in one of three cases outside the limits."""
    x, y, z = np.random.random(), np.random.random(), np.random.random()  # noqa: NPY002 (compiled)
    q = b[0] + x * (b[1] - b[0])
    if z < 1.0 / 3.0:
        return b[0] - 1.0 + x * (b[1] - b[0] + 2.0), 2.5 * (y - 0.5) * 2.0 * b[2]
    room = b[1] - q if y > 0.5 else q - b[0]
    return q, (2.0 * y - 1.0) * min(b[2], np.sqrt(2.0 * b[3] * room))


@kernel
def _drive(commands: int, seed: int, counts: Array, joint: Array) -> None:
    """Count violations, non-finite and changed commands, and starts from outside."""
    np.random.seed(seed)  # noqa: NPY002 (compiled: the thread's own generator)
    b, done = np.zeros(5), 0
    while done < commands:
        _limits(b)
        _fill(b, np.inf, joint)
        q0, dq0 = _start(b)
        mode, goal = np.random.randint(MODES), np.random.random() - 0.5  # noqa: NPY002
        for tick in range(min(EPISODE, commands - done)):
            if np.random.random() < 0.01:  # noqa: NPY002
                mode, goal = np.random.randint(MODES), np.random.random() - 0.5  # noqa: NPY002
            wq, wdq, wddq = _wish(mode, b, q0, dq0, tick, goal)
            q, dq, ddq = clamp_joint(joint[0], (q0, dq0, 0.0), (wq, wdq, wddq))
            same = q == wq and dq == wdq and ddq == wddq
            counts[2] += not same
            within = inside(b, q0, dq0, 0.0)
            counts[3] += not within
            if not (np.isfinite(q) and np.isfinite(dq) and np.isfinite(ddq)):
                counts[1] += 1
                q, dq = _start(b)
            elif not obeys(b, q0, dq0, q, dq, ddq) or (
                within and not same and _may_pass(b, q0, dq0, wq, wdq, wddq)
            ):
                counts[0] += 1
            q0, dq0 = q, dq
            done += 1


@kernel
def obeys_smooth(
    b: Array, jerk: float, last: tuple[float, float, float], told: tuple[float, float, float]
) -> bool:
    """Say whether a motion with a jerk limit may follow another."""
    (q0, dq0, ddq0), (q, dq, ddq), e = last, told, ROUNDING
    most = max(b[4], abs(ddq0))
    return bool(
        abs(ddq - ddq0) <= jerk * TICK * (1.0 + e) + e
        and abs(ddq) <= most + e
        and abs(dq) <= max(b[2], abs(dq0)) + e
        and abs(dq - dq0 - TICK * ddq) <= e
        and abs(q - q0 - 0.5 * TICK * (dq0 + dq)) <= e
    )


@kernel
def _drive_smooth(commands: int, seed: int, counts: Array, joint: Array) -> None:
    """Count as :func:`_drive`, for joints with a jerk limit that begin at rest, also beyond an end.

    None goes farther out, none that is in leaves, and at the end of an episode each is in.
    """
    np.random.seed(seed)  # noqa: NPY002 (compiled: the thread's own generator)
    b, done = np.zeros(5), 0
    while done < commands:
        _limits(b)
        jerk = min(b[3] * 10.0 ** (0.5 + 2.8 * np.random.random()), 2.0 * b[4] / TICK)  # noqa: NPY002
        _fill(b, jerk, joint)
        now = (b[0] - 0.5 + np.random.random() * (b[1] - b[0] + 1.0), 0.0, 0.0)  # noqa: NPY002
        out = max(now[0] - b[1], b[0] - now[0], 0.0)
        mode, goal = np.random.randint(MODES), np.random.random() - 0.5  # noqa: NPY002
        for tick in range(min(SMOOTH_EPISODE, commands - done)):
            if np.random.random() < 0.01:  # noqa: NPY002
                mode, goal = np.random.randint(MODES), np.random.random() - 0.5  # noqa: NPY002
            wish = _wish(mode, b, now[0], now[1], tick, goal)
            told = clamp_smooth(joint[0], now, wish)
            counts[2] += told != wish
            counts[3] += out > 0.0
            if not (np.isfinite(told[0]) and np.isfinite(told[1]) and np.isfinite(told[2])):
                counts[1] += 1
                break
            before, out = out, max(told[0] - b[1], b[0] - told[0], 0.0)
            late = tick == SMOOTH_EPISODE - 1 and out > 0.0
            if out > before + 1e-12 or late or not obeys_smooth(b, jerk, now, told):
                counts[0] += 1
            now = told
            done += 1
