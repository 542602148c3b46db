"""Adversarial commands through the envelope of one joint, checked by an independent rule.

The rule is written from the promise, not from the envelope's code: finite differences of what was
emitted, the way to standstill, and equality where nothing had to change.
"""

from dataclasses import dataclass

import numpy as np

from mitt.control.envelope import clamp_joint
from mitt.jit import kernel
from mitt.signals import TICK, Array

#: Excess beyond a limit that is rounding, and how far inside a wish must be to pass untouched.
ROUNDING, INSIDE = 1e-9, 1e-9
#: Ticks for which one adversary drives one joint.
EPISODE = 500

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
    """Send ``commands`` adversarial commands through the envelope."""
    counts = np.zeros(4, dtype=np.int64)
    _drive(commands, seed, counts)
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
def _start(b: Array) -> tuple[float, float]:
    """Draw a state, in one of three cases outside the limits."""
    x, y, z = np.random.random(), np.random.random(), np.random.random()  # noqa: NPY002 (compiled)
    q = b[0] + x * (b[1] - b[0])
    if z < 1.0 / 3.0:
        return b[0] - 1.0 + x * (b[1] - b[0] + 2.0), 2.5 * (y - 0.5) * 2.0 * b[2]
    room = b[1] - q if y > 0.5 else q - b[0]
    return q, (2.0 * y - 1.0) * min(b[2], np.sqrt(2.0 * b[3] * room))


@kernel
def _drive(commands: int, seed: int, counts: Array) -> None:
    """Count violations, non-finite and changed commands, and starts from outside."""
    np.random.seed(seed)  # noqa: NPY002 (compiled: the thread's own generator)
    b, done = np.zeros(5), 0
    while done < commands:
        _limits(b)
        q0, dq0 = _start(b)
        mode, goal = np.random.randint(MODES), np.random.random() - 0.5  # noqa: NPY002
        for tick in range(min(EPISODE, commands - done)):
            if np.random.random() < 0.01:  # noqa: NPY002
                mode, goal = np.random.randint(MODES), np.random.random() - 0.5  # noqa: NPY002
            wq, wdq, wddq = _wish(mode, b, q0, dq0, tick, goal)
            q, dq, ddq = clamp_joint(b[0], b[1], b[2], b[3], b[4], q0, dq0, wq, wdq, wddq)
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
