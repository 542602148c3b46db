"""What reaches the catcher: encoders, and images or points that arrive late."""

from collections import deque
from collections.abc import Callable
from math import floor
from typing import NamedTuple

import numpy as np

from mitt.core.arm.description import ArmModel
from mitt.core.kernels import kernel
from mitt.core.signals import TICK, ArmState, Array, BeltReading, Frame, Senses, Sighting
from mitt.lab.world.capsules import Body, lay_capsules
from mitt.lab.world.imaging import Imager
from mitt.lab.world.scene import BeltEncoder, Scene, Sensing
from mitt.lab.world.sight import Viewpoint, is_seen

Exposed = tuple[tuple[Frame, ...], tuple[Sighting, ...]]
_NOTHING: Exposed = ((), ())

CameraMaker = Callable[[np.random.Generator], Imager]
"""Sets up the cameras for a trial with its own source of noise."""


class SimulatedEncoders(NamedTuple):
    """The encoders of n joints.

    Attributes:
        step: Resolution [rad], shape (n,); 0 is exact.
        q: Reading [rad], shape (n,).
        dq: Its rate [rad/s], shape (n,).
        counted: The reading before of those that count [rad], shape (n,).
        since: Its time [s], shape (1,); negative before there was one.
    """

    step: Array
    q: Array
    dq: Array
    counted: Array
    since: Array


def encoder_steps(scene: Scene, arm: ArmModel) -> Array:
    """Return the resolution of each active joint's encoder [rad], shape (n,); 0 is exact."""
    step = scene.sensing.encoder_step
    if step == "arm":
        return np.array([arm.links[k].encoder_step for k in arm.active])
    return np.full(len(arm.names), step)


def fresh_encoders(steps: Array) -> SimulatedEncoders:
    """Return encoders of some resolution that have not been read yet."""
    n = len(steps)
    return SimulatedEncoders(
        np.array(steps), np.zeros(n), np.zeros(n), np.zeros(n), np.array([-1.0])
    )


@kernel
def read_encoders(encoders: SimulatedEncoders, t: float, q: Array, dq: Array) -> None:
    """Read the encoders: exact, or counts whose difference is the velocity.

    Args:
        encoders: The encoders; ``q`` and ``dq`` of them are the result.
        t: Time of the reading [s].
        q: True joint positions [rad], shape (n,).
        dq: True joint velocities [rad/s], shape (n,).
    """
    before = encoders.since[0]
    for i in range(len(q)):
        step = encoders.step[i]
        if step == 0.0:
            encoders.q[i], encoders.dq[i] = q[i], dq[i]
            continue
        counted = step * np.rint(q[i] / step)
        encoders.dq[i] = 0.0 if before < 0.0 else (counted - encoders.counted[i]) / (t - before)
        encoders.q[i] = encoders.counted[i] = counted
    encoders.since[0] = t


class Odometer:
    """The encoder of a belt in one trial."""

    def __init__(self, encoder: BeltEncoder, rng: np.random.Generator) -> None:
        """Draw its errors."""
        self._encoder = encoder
        self._scale = 1.0 + encoder.scale * rng.uniform(-1.0, 1.0)
        self._late = encoder.clock * rng.uniform(-1.0, 1.0)
        self._line: deque[tuple[BeltReading, ...]] = deque()

    def read(self, t: float, travel: float) -> tuple[BeltReading, ...]:
        """Read the true travel [m] at a time [s] and return what arrives; once a tick."""
        of, new = self._encoder, tuple[BeltReading, ...]()
        if floor(t * of.rate + 1e-9) != floor((t - TICK) * of.rate + 1e-9):
            shown = self._scale * travel
            shown = shown if of.step == 0.0 else of.step * floor(shown / of.step)
            new = (BeltReading(t=t + self._late, travel=shown),)
        self._line.append(new)
        return self._line.popleft() if len(self._line) > of.age else ()


class Sensors:
    """Sensors of one trial.

    Frames and points are exposed at every tick, or as often as ``frame_rate`` says, and delivered
    ``latency`` ticks after they are read out, carrying the time of their exposure.
    """

    def __init__(
        self,
        sensing: Sensing,
        radius: float,
        cameras: CameraMaker | None,
        rng: np.random.Generator,
        body: Body,
        steps: Array,
        sight: Viewpoint | None = None,
    ) -> None:
        """Set up the sensors.

        Args:
            sensing: Settings.
            radius: Radius of the ball [m].
            cameras: Sets up the cameras; the ball is seen as points if None.
            rng: Source of all noise.
            body: Arm and hand, in the images or before what is seen as a point.
            steps: As of :func:`encoder_steps`.
            sight: From where points are seen; from everywhere if left out.
        """
        self._body, self._sight = body, sight
        self._sensing, self._radius = sensing, radius
        self._cameras = None if cameras is None else cameras(rng)
        self._rng = rng
        self._latency = sensing.latency if cameras is None else sensing.image_latency
        self._encoders = fresh_encoders(steps)
        self._phase = rng.random() if sensing.frame_rate < 1.0 / TICK else 0.0
        self._line: deque[Exposed] = deque()
        self._covariance = max(sensing.point_noise, 1e-6) ** 2 * np.eye(3)

    @property
    def imager(self) -> Imager | None:
        """The cameras; None where the ball is seen as points."""
        return self._cameras

    @property
    def encoders(self) -> SimulatedEncoders:
        """The encoders, for compiled loops that read them."""
        return self._encoders

    @property
    def covariance(self) -> Array:
        """Covariance of a point [m^2], shape (3, 3)."""
        return self._covariance

    def noise(self, points: int) -> Array:
        """Draw how far off the next points are [m], shape (points, 3)."""
        return self._sensing.point_noise * self._rng.standard_normal((points, 3))

    def exposes(self, t: float) -> bool:
        """Say whether a frame or point is exposed in the tick at a time [s]."""
        rate = self._sensing.frame_rate
        if rate >= 1.0 / TICK:
            return True
        now, before = t * rate + self._phase, (t - TICK) * rate + self._phase
        return floor(now + 1e-9) != floor(before + 1e-9)

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
        if not (look and self.exposes(t)):
            self._line.append(_NOTHING)
        elif self._cameras is None:
            self._line.append(((), self._points(t, r_o)))
        else:
            lay_capsules(self._body, self._body.capsules)
            frames = self._cameras.render(
                t, r_o, self._radius, dr_o=dr_o, capsules=self._body.capsules
            )
            self._line.append((frames, ()))
        arrived = self._line.popleft() if len(self._line) > self._latency else _NOTHING
        read_encoders(self._encoders, t, q, dq)
        q, dq = self._encoders.q.copy(), self._encoders.dq.copy()
        return Senses(t=t, arm=ArmState(t=t, q=q, dq=dq), frames=arrived[0], points=arrived[1])

    def _points(self, t: float, r_o: Array) -> tuple[Sighting, ...]:
        """Return a noisy position; none of what is hidden."""
        seen = r_o + self.noise(1)[0]
        if self._sight is not None:
            lay_capsules(self._body, self._body.capsules)
            if not is_seen(self._sight, r_o, self._body.capsules):
                return ()
        return (Sighting(t=t, found=True, r_o=seen, covariance=self._covariance),)
