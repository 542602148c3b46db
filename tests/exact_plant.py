"""An arm that does exactly what its model says, for as long as a command is held; no contact.

Loops of a user go by their own time: a tick may come late, and the arm moves on meanwhile.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import final

import numpy as np
from numpy.typing import NDArray

from mitt.core.arm.arm import Arm
from mitt.core.arm.dynamics import bias_and_mass, slopes_work, solve_positive
from mitt.core.ball.filter import THROWN_BALL
from mitt.core.catcher.catcher import Catcher, CatcherSettings, Phase
from mitt.core.catcher.state import REASONS
from mitt.core.control.health import Reason
from mitt.core.kernels import Record, kernel
from mitt.core.signals import ArmState, Array, Command, Senses, Sighting
from mitt.lab.world.throws import Throw

#: Longest step of the plant [s], error of a seen position [m], and free fall [m/s^2].
STEP = 2.5e-4
SIGMA = 1e-3
FALL = np.array([0.0, 0.0, -9.81])
#: What is known of a ball without drag.
SETTINGS = CatcherSettings(flight=replace(THROWN_BALL, drag_mean=0.0, drag_sigma=0.002))
Change = Callable[[int, ArmState], ArmState]


@kernel
def _move(
    bodies: Record,
    index: NDArray[np.int64],
    state: Array,
    tau: Array,
    steps: int,
    h: float,
    work: Record,
) -> None:
    """Carry q, dq on in steps of constant torques, shape (2, n)."""
    n = state.shape[1]
    bias, mass = np.zeros(len(bodies)), np.zeros((len(bodies), n))
    motion, system = np.zeros((3, n)), np.zeros((n, n + 1))
    for _ in range(steps):
        motion[:2] = state
        bias_and_mass(bodies, motion, bias, mass, work)
        for i in range(n):
            for j in range(n):
                system[i, j] = mass[index[i], j]
            system[i, n] = tau[i] - bias[index[i]]
        solve_positive(system)
        for j in range(n):
            state[0, j] += h * (state[1, j] + 0.5 * h * system[j, n])
            state[1, j] += h * system[j, n]


@final
class ExactPlant:
    """The arm; once its brakes act it stands.

    Attributes:
        state: q, dq [rad, rad/s], shape (2, n).
    """

    def __init__(self, arm: Arm) -> None:
        """Begin at rest in the ready pose."""
        self.state = np.array([arm.q_ready, np.zeros(arm.n)])
        self._bodies, self._index = arm.bodies, np.array(arm.model.active)
        self._work, self._braked = slopes_work(len(arm.bodies)), 0.0
        self._delay = max(brake.delay for brake in arm.brakes)

    def move(self, command: Command, time: float) -> None:
        """Hold a command for a time [s]."""
        self._braked = self._braked + time if command.brakes else 0.0
        if self._braked > self._delay:
            self.state[1] = 0.0
            return
        steps = max(round(time / STEP), 1)
        tau = np.ascontiguousarray(command.tau)
        _move(self._bodies, self._index, self.state, tau, steps, time / steps, self._work)


@dataclass(frozen=True, slots=True)
class Thrown:
    """What became of a throw.

    Attributes:
        phase, stopped: Phase at the end, and why it was stopped.
        reasons: Reasons of all ticks, in their order.
        nearest: Least distance of catch point and ball while the hand was open [m].
        t, commands: Times of the ticks [s], and q, dq, ddq, tau of their commands, (k, 4, n).
        q: Where the arm was in the ticks [rad], shape (k, n).
        brakes: Whether the brakes were commanded to engage.
    """

    phase: Phase
    stopped: Reason | None
    reasons: Sequence[Reason]
    nearest: float
    t: Array
    commands: Array
    q: Array
    brakes: bool


def each(period: float, count: int) -> Array:
    """Return the times of ticks at a constant period [s]."""
    times: Array = period * np.arange(count, dtype=np.float64)
    return times


def as_read(_: int, reading: ArmState) -> ArmState:
    """Return a reading as it is."""
    return reading


def throw(
    catcher: Catcher,
    arm: Arm,
    ball: Throw,
    times: Array,
    *,
    seed: int = 7,
    change: Change = as_read,
) -> Thrown:
    """Let a catcher tick at the given times; the arm moves by the time between them.

    Args:
        catcher: A fresh one.
        arm: The arm, as it is.
        ball: At the first time; it has no drag.
        times: Of the ticks, rising [s].
        seed: Of the error of what is seen.
        change: Changes the reading of a tick, whose number it is given.
    """
    plant, rng, out = ExactPlant(arm), np.random.default_rng(seed), catcher.result.scalars
    reasons, commands, places, nearest = list[Reason](), list[Command](), list[Array](), np.inf
    for k, t in enumerate(times.tolist()):
        if k > 0:
            plant.move(commands[-1], t - times[k - 1])
        since = t - times[0]
        r_o = ball.r + since * ball.dr + 0.5 * since * since * FALL
        nearest = min(nearest, float(np.linalg.norm(arm.position(plant.state[0]) - r_o)))
        seen = Sighting(
            t=t,
            found=True,
            r_o=r_o + SIGMA * rng.standard_normal(3),
            covariance=SIGMA**2 * np.eye(3),
        )
        reading = change(k, ArmState(t=t, q=plant.state[0].copy(), dq=plant.state[1].copy()))
        command = catcher.step(Senses(t=t, arm=reading, points=(seen,)))
        catcher.think()
        commands.append(command)
        places.append(plant.state[0].copy())
        reasons.append(REASONS[int(out["reason"][0])])
        if catcher.done:
            break
    why = catcher.stopped_by
    return Thrown(
        catcher.phase,
        None if why is None else why.reason,
        reasons,
        nearest,
        times[: len(commands)],
        np.array([x.joints for x in commands]),
        np.array(places),
        commands[-1].brakes,
    )
