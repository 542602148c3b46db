"""What the catcher is told: encoders, and images or points that arrive late."""

from collections import deque
from collections.abc import Callable
from typing import Protocol

import numpy as np

from mitt.robot.arm import Arm
from mitt.signals import Array, Frame, Senses, Sighting, senses_of
from mitt.world.scene import Scene, Sensing
from mitt.world.silhouettes import Silhouettes


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


def encoder_steps(scene: Scene, arm: Arm) -> Array:
    """Return the resolution of each joint's encoder in a scene [rad], shape (n,); 0 is exact."""
    return np.full(arm.n, scene.sensing.encoder_step)


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
    ) -> None:
        """Set up the sensors; without cameras the ball is seen as points."""
        self._body = body
        self._sensing, self._radius = sensing, radius
        self._cameras = None if cameras is None else cameras(rng)
        self._rng = rng
        self._latency, self._step = sensing.latency, sensing.encoder_step
        self._line: deque[Exposed] = deque()
        self._covariance = max(sensing.point_noise, 1e-6) ** 2 * np.eye(3)
        self._q_before: Array | None = None
        self._t_before = 0.0

    @property
    def imager(self) -> FrameSource | None:
        """The cameras; None where the ball is seen as points."""
        return self._cameras

    @property
    def exact(self) -> bool:
        """Whether encoders do not count in steps."""
        return self._step == 0.0

    @property
    def covariance(self) -> Array:
        """Covariance of a point [m^2], shape (3, 3)."""
        return self._covariance

    def scatter(self, points: int) -> Array:
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
        return senses_of(t, *self._encoders(t, q, dq), *arrived)

    def _point(self, t: float, r_o: Array) -> Sighting:
        """Return a noisy position."""
        seen = r_o + self.scatter(1)[0]
        return Sighting(t=t, found=True, r_o=seen, covariance=self._covariance)

    def _encoders(self, t: float, q: Array, dq: Array) -> tuple[Array, Array]:
        """Return joint readings: exact, or counts whose difference is the velocity."""
        step = self._step
        if step == 0.0:
            return q.copy(), dq.copy()
        counted = step * np.rint(q / step)
        before, elapsed = self._q_before, t - self._t_before
        rate = np.zeros_like(q) if before is None else (counted - before) / elapsed
        self._q_before, self._t_before = counted, t
        return counted, rate
