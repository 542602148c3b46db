"""The rule that judges the commands of a catcher, written from what docs/safety.md promises.

* Every number is finite; hand and torques are within what the drives can do.
* Each joint moves as :func:`soak.commands.obeys` says: within position, speed and acceleration,
  able to stop, and back monotonically from outside.
* Where the way to standstill is blocked, or the arm is stopping, a joint that is outside may brake
  instead: at its trusted deceleration, no slower, and never away from where braking leads.
* An arm that could stop clear of itself and the floor once never comes closer to them than is kept.
* Where more or less than a tick has passed, the motion has gone on in ticks, of which the last is
  judged, and the command lies between its ends.
* After a stop nothing gets faster, and the stop is latched. A stop far from the command starts
  from the estimate.
"""

from typing import final

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.arm.hands import HandModel
from mitt.core.arm.shapes import MARGIN, clearance, shapes_of
from mitt.core.catcher.catcher import Catcher, CatcherSettings, Phase
from mitt.core.catcher.state import REASONS
from mitt.core.control.envelope import bounds_of
from mitt.core.control.health import ABORT, ENCODER_REASONS, Reason
from mitt.core.kernels import Record, kernel
from mitt.core.signals import TICK, Array, Command
from soak.commands import ROUNDING, inside, obeys

#: Poses that are looked at along a way to standstill.
_LOOKS = 60


def rows_of(bounds: Record) -> Array:
    """Return limits as the rule takes them: ends, speed, deceleration, acceleration, (5, n)."""
    names = "q_min", "q_max", "dq_max", "deceleration", "ddq_max"
    return np.array([bounds[name] for name in names])


@kernel
def brakes(b: Array, q0: float, dq0: float, q: float, dq: float, ddq: float) -> bool:
    """Say whether a joint brakes at its trusted deceleration."""
    e, onward = ROUNDING, 1.0 if dq0 >= 0.0 else -1.0
    left = max(abs(dq0) - b[3] * TICK, 0.0)
    way = (q - q0) * onward
    return bool(
        abs(dq - onward * left) <= e
        and -e <= way <= 0.5 * (abs(dq0) + left) * TICK + e
        and abs(ddq) <= b[4] + e
    )


@kernel
def breaks(b: Array, last: Array, told: Array, blocked: bool) -> int:
    """Return the first joint that breaks the rule of motion; -1 if none.

    Args:
        b: Limits, of :func:`rows_of`, shape (5, n).
        last: q, dq told before, shape (>= 2, n).
        told: q, dq, ddq, shape (3, n).
        blocked: Whether a joint that is outside may brake instead of returning.
    """
    for k in range(told.shape[1]):
        q0, dq0, q, dq, ddq = last[0, k], last[1, k], told[0, k], told[1, k], told[2, k]
        if obeys(b[:5, k], q0, dq0, q, dq, ddq):
            continue
        outside = not inside(b[:5, k], q0, dq0, 0.0)
        if not (blocked and outside and brakes(b[:5, k], q0, dq0, q, dq, ddq)):
            return k
    return -1


def too_strong(arm: Arm, tau: Array, dq: Array) -> bool:
    """Say whether a drive is asked for more than it can give at a speed of the joints."""
    torques, speeds = (np.zeros(len(arm.model.links)) for _ in range(2))
    active = list(arm.model.active)
    torques[active], speeds[active] = tau, dq
    limits = arm.limits
    drive = limits.drive_torque(torques)
    bound = limits.torque_bound(drive, limits.drive_speed(speeds))
    return bool(np.any(np.abs(drive) > bound * (1.0 + ROUNDING) + ROUNDING))


@final
class Judge:
    """The independent rule, over the commands of one catcher."""

    def __init__(self, arm: Arm, settings: CatcherSettings) -> None:
        """Take the arm, empty and with the ball."""
        self._arms = arm, arm.holding(settings.ball_mass)
        self._max_tracking_error = settings.max_tracking_error
        self._bounds = rows_of(bounds_of(arm))
        self._bounds[3:] = np.minimum(*(rows_of(bounds_of(a))[3:] for a in self._arms))
        self._shapes = shapes_of(arm, settings.around)
        hand = arm.model.hand
        self._closed = hand.drive.closed if isinstance(hand, HandModel) else 0.0
        self.reset()

    def reset(self) -> None:
        """Forget the last command, as after a recovery."""
        self._last: Array | None = None
        self._t = np.nan
        self._begun = False
        self._stopped = self._clear = False

    def fault(self, catcher: Catcher, command: Command, slowest: Array) -> str:
        """Return which rule a command breaks; the empty text if none.

        Args:
            catcher: The catcher, after what it thought.
            command: Its command.
            slowest: Speeds to which it kept the joints in this tick [rad/s], shape (n,): slower
                than their limits where it leaves room for an impact.
        """
        told = np.array([command.q, command.dq, command.ddq])
        hand, tau = command.hand, command.tau
        gaze = np.zeros(1) if command.gaze is None else command.gaze
        everything = np.concatenate([told.ravel(), tau, gaze.ravel(), (hand, command.t)])
        if not np.all(np.isfinite(everything)):
            return f"not finite: {everything.tolist()}"
        begun, self._begun = self._begun, bool(catcher.state.scalars[0]["begun"])
        last, self._last = self._last if begun else None, told
        passed, self._t = command.t - self._t, command.t
        if not self._begun and (tau.any() or not command.brakes):
            return f"torques {tau.tolist()}, brakes {command.brakes}, and a joint was not read yet"
        if not -ROUNDING <= hand <= self._closed + ROUNDING:
            return f"hand at {hand}"
        estimated = catcher.estimated[1]
        state, reason = (catcher.result.scalars[name].item() for name in ("health", "reason"))
        blocked = state >= ABORT or REASONS[reason] is Reason.BLOCKED  # or a graver reason hides it
        if too_strong(self._arms[0], tau, estimated):
            return f"torques {tau.tolist()} at {estimated.tolist()}"
        if last is not None:
            b = self._bounds.copy()
            b[2] = np.minimum(b[2], slowest)
            ends, ahead = (last, told), catcher.state.scalars[0]["ahead"].item()
            if ahead > 0.0 or abs(passed - TICK) > ROUNDING:
                ends = catcher.state.before.copy(), catcher.state.last.copy()
                between = ends[1] - ahead * (ends[1] - ends[0])
                if np.array_equal(*ends):  # begun anew at the estimate by a stop in this tick
                    between = told
                if np.any(np.abs(told - between) > ROUNDING):
                    return f"{told.tolist()}, not {between.tolist()}, {ahead} of a tick before"
            joint = -1 if np.array_equal(*ends) else breaks(b, *ends, blocked)
            if joint >= 0:
                return f"joint {joint} from {ends[0].tolist()} to {ends[1].tolist()}"
            if self._stopped and np.any(np.abs(told[1]) > np.abs(last[1]) + ROUNDING):
                return f"faster after a stop: {last[1].tolist()} to {told[1].tolist()}"
        if self._clear and self._gap(told[0]) < MARGIN - ROUNDING:
            return f"{1e3 * self._gap(told[0]):.3f} mm from a body at {told.tolist()}"
        if self._stopped and catcher.phase is not Phase.STOPPED:
            return f"{catcher.phase} after a stop"
        if last is None:
            self._clear = self._begun and self._stops_clear(told)
        stops = catcher.phase is Phase.STOPPED and not self._stopped
        self._stopped |= stops
        measured = REASONS[reason] not in ENCODER_REASONS
        far = np.max(np.abs(told[0] - catcher.estimated[0])) > self._max_tracking_error
        if stops and measured and far:
            self._last = np.array([*catcher.estimated, 0.0 * estimated])
            self._clear = self._stops_clear(self._last)
        return ""

    def _gap(self, q: Array) -> float:
        """Return the smallest gap of a pose [m]."""
        shapes = self._shapes
        return float(clearance(self._arms[0].bodies, q, shapes.table, shapes.pairs, shapes.ends))

    def _stops_clear(self, told: Array) -> bool:
        """Say whether no pose on the way to standstill is too close: many are looked at."""
        brake, speed = self._bounds[3], np.abs(told[1])
        for t in np.linspace(0.0, float(np.max(speed / brake)), _LOOKS):
            passed = np.minimum(t, speed / brake)
            way = np.copysign(passed * (speed - 0.5 * brake * passed), told[1])
            if self._gap(told[0] + way) < MARGIN:
                return False
        return True
