"""One way for an arm to catch: the choices that a search makes, and small changes of them."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mitt.core.arm.arm import Arm
from mitt.core.arm.description import mounting, rotation, transform
from mitt.core.errors import InputError
from mitt.core.map.map_design import MapDesign
from mitt.core.map.mapping import unlearned
from mitt.core.signals import Array, MapStatus
from mitt.io.arm_file import ArmFile
from mitt.lab.design.driven_arm import movable


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

        How balls come is as in :class:`mitt.core.arm.description.ArmModel`.
        """
        held = {k: float(x) for k, x in enumerate(self.q) if k not in self.active}
        links = tuple(replace(x, held=held.get(k)) for k, x in enumerate(whole.model.links))
        about_z = transform(rotation(np.array([0.0, 0.0, 1.0]), self.turn))
        mount = mounting(whole.model.hand)[1]  # the turn is that of the arm's own plate
        tool = whole.model.tool @ np.linalg.inv(mount) @ about_z @ mount
        model = replace(
            whole.model,
            links=links,
            q_ready=self.q_ready,
            tool=tool,
            aim=self.aim,
            arrivals=arrivals,
        )
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


def candidate_of(whole: Arm, file: ArmFile) -> Candidate:
    """Return the way to catch that an arm file states.

    Args:
        whole: Its arm, with all joints active.
        file: As ``mitt design`` writes one: with a map, and a box that is aimed at.

    Raises:
        InputError: It says nothing of these, or the map does not reach the middle of the box.
    """
    d, box = file.map, file.throws
    if d is None or box is None or box.at is None or box.around is None:
        raise InputError(
            "--effort refine",
            "an arm with a design, [map] and at of [throws]",
            "one without",
            do="say --effort full",
        )
    arm, names, at = file.load(), list(whole.names), np.array(box.at)
    held = {x.name: x.held for x in arm.model.links if x.held is not None}
    active = [names.index(x) for x in arm.names]
    a, b, c = (active[k] for k in d.free)
    free, catch = [a, b, c], d.free.index(d.catch_joint)
    others = [x for x in range(3) if x != catch]
    A = np.zeros((whole.n, 3))
    A[free, range(3)] = 1.0
    A[free[catch], others] = d.slope
    A[[k for k in active if k not in free]] = np.array(d.coupling).reshape(-1, 3)
    q = np.array([held.get(name, 0.0) for name in names])
    q[active] = arm.q_ready
    ready = q[free]
    status, q_o = unlearned(arm, d).to_joints(at)
    if status is not MapStatus.INSIDE:
        raise InputError("throws.at", "a point in the domain of the map", box.at)
    there = q_o[list(d.free)]
    there[catch] = d.q_catch + np.dot(d.slope, there[others])
    return Candidate(
        q=q + A @ np.linalg.solve(A[free], there - ready),
        free=(a, b, c),
        A=A,
        catch=catch,
        kappa=d.kappa,
        inward=d.inward,
        ready=ready,
        aim=np.array([at, box.around]),
        turn=file.hand_turn,
        match_weight=d.match_weight,
    )


def within(whole: Arm, q: Array, margin: float) -> NDArray[np.bool_]:
    """Say of poses of all joints, shape (..., N), whether each is so far inside its range [rad]."""
    room = np.minimum(margin, 0.25 * (whole.q_max - whole.q_min))
    inside: NDArray[np.bool_] = np.all(
        (q >= whole.q_min + room) & (q <= whole.q_max - room), axis=-1
    )
    return inside


class _Change(NamedTuple):
    """Sizes of small changes, standard deviations unless it says otherwise; found by trial."""

    free: float = 0.12  # of a free joint at the catch [rad]
    held: float = 0.2  # of another joint there [rad]
    ready: float = 0.2  # of the ready pose [rad]
    both: float = 0.3  # of kappa - 1 and inward by one factor, of its logarithm [1]
    each: float = 0.15  # of kappa - 1 and inward each by itself, of its logarithm [1]
    follows: float = 0.1  # of how far a further joint turns per coordinate of the free ones [1]
    slope: float = 0.3  # of the slope of the catch angle [1]
    weight: float = 0.7  # of the match weight, of its logarithm [1]
    aim: float = 0.07  # of the aim against the catch point [m]
    often: float = 0.6  # how often each part is changed, as a share
    square: float = 0.1  # how often a held joint is turned to a right angle
    switched: float = 0.05  # how often the match weight is set to 0, or to 1 where it was 0
    margin: float = 0.06  # room that is left to the ends of the ranges [rad]


_CHANGE = _Change()


def mutated(
    whole: Arm, c: Candidate, rng: np.random.Generator, *, size: float, moves: bool
) -> Candidate:
    """Return a candidate a little different.

    Changes have ``size`` 1 at first. Where ``moves``, the aim goes with the catch point.
    """
    free = list(c.free)
    q, ready, A = c.q.copy(), c.ready.copy(), c.A.copy()
    if rng.random() < _CHANGE.often:
        sigma = np.full(whole.n, _CHANGE.held)
        sigma[free] = _CHANGE.free
        sigma[~movable(whole)] = 0.0
        q = q + size * sigma * rng.standard_normal(whole.n) * (rng.random(whole.n) < _CHANGE.often)
        q = _inside(whole, _squared(q, free, rng), np.arange(whole.n))
        ready = ready + (q - c.q)[free]
    if len(c.active) > 3 and rng.random() < _CHANGE.often:
        further = [k for k in c.active if k not in free]
        A[further] += size * _CHANGE.follows * rng.standard_normal((len(further), 3))
    if rng.random() < _CHANGE.often:
        others = [x for x in range(3) if x != c.catch]
        slope = c.A[free[c.catch], others]
        change = np.clip(slope + size * _CHANGE.slope * rng.standard_normal(2), -10.0, 10.0) - slope
        A[:, others] += np.outer(A[:, c.catch], change)
    if rng.random() < _CHANGE.often:
        ready = ready + size * _CHANGE.ready * rng.standard_normal(3)
    kappa, inward = c.kappa, c.inward
    if (
        rng.random() < _CHANGE.often
    ):  # harder or softer: both by one factor, the ball's way in stays
        factor = float(np.exp(size * _CHANGE.both * rng.standard_normal()))
        kappa, inward = 1.0 + (kappa - 1.0 + 0.02) * factor, inward * factor
    if rng.random() < _CHANGE.often:
        kappa = 1.0 + (kappa - 1.0) * float(np.exp(size * _CHANGE.each * rng.standard_normal()))
        inward += (
            size * _CHANGE.each * (kappa - 1.0 + abs(inward) + 0.1) * float(rng.standard_normal())
        )
    aim = _aim(c.aim, whole.position(q) - whole.position(c.q), size, rng) if moves else c.aim
    turn = c.turn + (np.pi / 3.0 if rng.random() < 0.1 else 0.0)
    return replace(
        c,
        q=q,
        A=A,
        ready=_inside(whole, ready, np.array(free)),
        kappa=min(kappa, 50.0),
        inward=float(np.clip(inward, -50.0, 50.0)),
        aim=aim,
        match_weight=_weight(c, size, rng),
        turn=float(np.mod(turn, 2.0 * np.pi / 3.0)),
    )


def _weight(c: Candidate, size: float, rng: np.random.Generator) -> float:
    """Return a match weight that is a little larger or smaller, and now and then 0."""
    weight = c.match_weight * float(np.exp(size * _CHANGE.weight * rng.standard_normal()))
    if rng.random() < _CHANGE.switched:
        weight = 0.0 if weight > 0.0 else 1.0
    return min(weight, 1000.0)


def _squared(q: Array, free: list[int], rng: np.random.Generator) -> Array:
    """Return a pose of which some held joints are turned to the next right angle."""
    square = np.round(q / (0.5 * np.pi)) * (0.5 * np.pi)
    held = np.ones(len(q), dtype=bool)
    held[free] = False
    out: Array = np.where(held & (rng.random(len(q)) < _CHANGE.square), square, q)
    return out


def _aim(aim: Array, moved: Array, size: float, rng: np.random.Generator) -> Array:
    """Return an aim that goes with the catch point, and sometimes is shifted against it."""
    out = aim.copy()
    out[0] += moved
    if rng.random() < _CHANGE.often:
        out[0] += size * _CHANGE.aim * rng.standard_normal(3)
    return out


def _inside(whole: Arm, q: Array, joints: NDArray[np.int64]) -> Array:
    """Return angles of some joints, kept in their ranges [rad]."""
    room = np.minimum(_CHANGE.margin, 0.1 * (whole.q_max - whole.q_min))[joints]
    out: Array = np.clip(q, whole.q_min[joints] + room, whole.q_max[joints] - room)
    return out
