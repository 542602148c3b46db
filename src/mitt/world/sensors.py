"""What reaches the catcher: encoders, and images or points that arrive late."""

from collections import deque
from collections.abc import Callable
from typing import Protocol

import numpy as np

from mitt.jit import kernel
from mitt.robot.description import ArmModel
from mitt.signals import ArmState, Array, Frame, Senses, Sighting
from mitt.world.capsules import Silhouettes
from mitt.world.scene import Scene, Sensing


class FrameSource(Protocol):
    """The cameras: ``mitt.world.imaging.Imager`` is one."""

    def render(
        self, t: float, r_o: Array | None, radius: float, *, dr_o: Array | None, capsules: Array
    ) -> tuple[Frame, ...]:
        """Return what the cameras see at ``t`` [s]: ball, and capsules of arm and hand."""

    def turn(self, gaze: Array | None, duration: float) -> None:
        """Turn the cameras, if they can be turned, for ``duration`` [s]."""


Exposed = tuple[tuple[Frame, ...], tuple[Sighting, ...]]
_NOTHING: Exposed = ((), ())

CameraMaker = Callable[[np.random.Generator], FrameSource]
"""Sets up the cameras for a trial with its own source of noise."""


STEP, Q, DQ, COUNTED, SINCE = range(5)
"""Rows of a table of encoders, shape (5, n): resolution [rad], reading [rad], its rate [rad/s], the
reading before [rad], and in the first column its time [s], negative before there was one."""


def encoder_steps(scene: Scene, arm: ArmModel) -> Array:
    """Return the resolution of each active joint's encoder [rad], shape (n,); 0 is exact."""
    step = scene.sensing.encoder_step
    if step == "arm":
        return np.array([arm.links[k].encoder_step for k in arm.active])
    return np.full(len(arm.names), step)


def fresh_encoders(steps: Array) -> Array:
    """Return the table of encoders that have not been read yet, shape (5, n)."""
    table = np.zeros((5, len(steps)))
    table[STEP], table[SINCE] = steps, -1.0
    return table


@kernel
def read_encoders(table: Array, t: float, q: Array, dq: Array) -> None:
    """Read the encoders: exact, or counts whose difference is the velocity.

    Args:
        table: As of :func:`fresh_encoders`; its rows ``Q`` and ``DQ`` are the result.
        t: Time of the reading [s].
        q: True joint positions [rad], shape (n,).
        dq: True joint velocities [rad/s], shape (n,).
    """
    before = table[SINCE, 0]
    for i in range(len(q)):
        step = table[STEP, i]
        if step == 0.0:
            table[Q, i], table[DQ, i] = q[i], dq[i]
            continue
        counted = step * np.rint(q[i] / step)
        table[DQ, i] = 0.0 if before < 0.0 else (counted - table[COUNTED, i]) / (t - before)
        table[Q, i] = table[COUNTED, i] = counted
    table[SINCE, 0] = t


class Sensors:
    """Sensors of one trial.

    Frames and points are exposed at every tick and delivered ``latency`` ticks later, carrying
    the time of their exposure.
    """

    def __init__(
        self,
        sensing: Sensing,
        radius: float,
        cameras: CameraMaker | None,
        rng: np.random.Generator,
        body: Silhouettes,
        steps: Array,
    ) -> None:
        """Set up the sensors.

        Args:
            sensing: Settings.
            radius: Radius of the ball [m].
            cameras: Sets up the cameras; the ball is seen as points if None.
            rng: Source of all noise.
            body: Arm and hand in the images.
            steps: As of :func:`encoder_steps`.
        """
        self._body = body
        self._sensing, self._radius = sensing, radius
        self._cameras = None if cameras is None else cameras(rng)
        self._rng = rng
        self._latency, self._encoders = sensing.latency, fresh_encoders(steps)
        self._line: deque[Exposed] = deque()
        self._covariance = max(sensing.point_noise, 1e-6) ** 2 * np.eye(3)

    @property
    def imager(self) -> FrameSource | None:
        """The cameras; None where the ball is seen as points."""
        return self._cameras

    @property
    def encoders(self) -> Array:
        """Table of the encoders as of :func:`fresh_encoders`, for compiled loops that read them."""
        return self._encoders

    @property
    def covariance(self) -> Array:
        """Covariance of a point [m^2], shape (3, 3)."""
        return self._covariance

    def noise(self, points: int) -> Array:
        """Draw how far off the next points are [m], shape (points, 3)."""
        return self._sensing.point_noise * self._rng.standard_normal((points, 3))

    def turn(self, gaze: Array | None, duration: float) -> None:
        """Let the heads of the cameras follow the catcher's gaze for ``duration`` [s]."""
        if self._cameras is not None:
            self._cameras.turn(gaze, duration)

    def read(
        self, t: float, q: Array, dq: Array, r_o: Array, dr_o: Array, *, look: bool = True
    ) -> Senses:
        """Expose at time ``t`` and return what arrives; to be called once a tick.

        Args:
            t: Time of the tick [s].
            q: True joint positions [rad], shape (n,).
            dq: True joint velocities [rad/s], shape (n,).
            r_o: True ball centre [m], shape (3,).
            dr_o: True ball velocity [m/s], shape (3,).
            look: Whether ball and images are exposed.
        """
        if not look:
            self._line.append(_NOTHING)
        elif self._cameras is None:
            self._line.append(((), (self._point(t, r_o),)))
        else:
            self._body.update()
            frames = self._cameras.render(
                t, r_o, self._radius, dr_o=dr_o, capsules=self._body.capsules
            )
            self._line.append((frames, ()))
        arrived = self._line.popleft() if len(self._line) > self._latency else _NOTHING
        read_encoders(self._encoders, t, q, dq)
        q, dq = self._encoders[Q].copy(), self._encoders[DQ].copy()
        return Senses(t=t, arm=ArmState(t=t, q=q, dq=dq), frames=arrived[0], points=arrived[1])

    def _point(self, t: float, r_o: Array) -> Sighting:
        """Return a noisy position."""
        seen = r_o + self.noise(1)[0]
        return Sighting(t=t, found=True, r_o=seen, covariance=self._covariance)
