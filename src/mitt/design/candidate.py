"""One way for an arm to catch: the choices that a search makes, and the arm and map they give."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mitt.generator.map_design import MapDesign
from mitt.robot.arm import Arm
from mitt.robot.description import mounting, rotation, transform
from mitt.signals import Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidate:
    """A way to catch, over all N joints of an arm.

    Attributes:
        q: Pose at the nominal catch [rad], shape (N,).
        free: The three free joints, from the base outwards.
        A: How far each joint turns per virtual joint, shape (N, 3); zero rows where it is held. The
            rows of the free joints are those of the identity, but for the slope of the catch angle.
        catch: Which of the three is the catch joint, 0 to 2.
        kappa: Velocity-match ratio.
        inward: Share of the ball's line towards the catch joint's axis.
        ready: Ready pose of the free joints [rad], shape (3,).
        aim: Centre and half-widths of the box where balls are aimed [m], shape (2, 3).
        turn: Turn of the hand about the palm's normal [rad].
        match_weight: What a relative velocity at the catch costs in learning [(m/s)^-2].
    """

    q: Array
    free: tuple[int, int, int]
    A: Array
    catch: int
    kappa: float
    inward: float
    ready: Array
    aim: Array
    turn: float = 0.0
    match_weight: float = 0.0

    @property
    def active(self) -> tuple[int, ...]:
        """The joints that move, from the base outwards."""
        return tuple(np.flatnonzero(np.any(self.A != 0.0, axis=1)).tolist())

    @property
    def q_catch(self) -> Array:
        """The active joints at the nominal catch [rad], shape (n,)."""
        return np.array(self.q[list(self.active)])

    @property
    def q_ready(self) -> Array:
        """Ready pose of the active joints [rad], shape (n,); further ones follow from the catch."""
        free = list(self.free)
        swing = self.A @ np.linalg.solve(self.A[free], self.ready - self.q[free])
        return np.array((self.q + swing)[list(self.active)])

    def arm(self, whole: Arm, arrivals: Array | None = None) -> Arm:
        """Return the arm with the other joints held.

        Args:
            whole: The arm with all its joints active.
            arrivals: How balls come, as in :class:`mitt.robot.description.ArmModel`.
        """
        held = {k: float(x) for k, x in enumerate(self.q) if k not in self.active}
        links = tuple(replace(x, held=held.get(k)) for k, x in enumerate(whole.model.links))
        about_z = transform(rotation(np.array([0.0, 0.0, 1.0]), self.turn))
        mount = mounting(whole.model.hand)[1]  # the turn is that of the arm's own plate
        tool = whole.model.tool @ np.linalg.inv(mount) @ about_z @ mount
        model = replace(whole.model, links=links, q_ready=self.q_ready, tool=tool, aim=self.aim,
                        arrivals=arrivals)  # fmt: skip
        return Arm(model, whole.limits)

    @property
    def design(self) -> MapDesign:
        """The choices of the map."""
        active = self.active
        a, b, c = (active.index(k) for k in self.free)
        further = [k for k in active if k not in self.free]
        i, others = self.free[self.catch], [x for x in range(3) if x != self.catch]
        slope = self.A[i, others]
        return MapDesign(
            catch_joint=(a, b, c)[self.catch],
            free=(a, b, c),
            coupling=tuple((x, y, z) for x, y, z in self.A[further].tolist()),
            q_catch=float(self.q[i] - slope @ self.q[[self.free[x] for x in others]]),
            kappa=self.kappa,
            inward=self.inward,
            slope=(float(slope[0]), float(slope[1])),
            match_weight=self.match_weight,
        )


def within(whole: Arm, q: Array, margin: float) -> NDArray[np.bool_]:
    """Say of poses of all joints, shape (..., N), whether each is so far inside its range [rad]."""
    room = np.minimum(margin, 0.25 * (whole.q_max - whole.q_min))
    inside: NDArray[np.bool_] = np.all(
        (q >= whole.q_min + room) & (q <= whole.q_max - room), axis=-1
    )
    return inside
