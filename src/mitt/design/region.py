"""The region of balls that a design catches: verdicts on balls beside, above and below its place.

The balls fly as those of the task do, through the points of an upright grid about the middle of the
box that is thrown at: through each point a slow, a middling and a fast one.

| here        | meaning                                                    | unit  | shape     |
|-------------|------------------------------------------------------------|-------|-----------|
| ``across``  | horizontally off the middle of the box, across the balls' way | m  | (C,)      |
| ``height``  | height in the base frame                                   | m     | (H,)      |
| ``caught``  | how many of the balls through a point are caught, as a share | 1   | (H, C)    |
| ``hand``    | where the hand meets those                                 | m     | (K, 3)    |
"""

from dataclasses import dataclass

import numpy as np

from mitt.ball.flight import advance
from mitt.design.candidate import Candidate
from mitt.design.evaluation import learned
from mitt.design.evaluator import Progress
from mitt.design.task import Task
from mitt.design.verdicts import START, Verdicts, verdicts
from mitt.generator.mapping import DirectMap
from mitt.robot.arm import Arm
from mitt.signals import Array, BallState
from mitt.trials.catcher_settings import catcher_settings, driven
from mitt.trials.learning import Neighbourhood

#: How far off the middle the outermost points are [m].
_FARTHEST = 0.64
#: Speeds of the balls through a point: the least, the middle and the most of the task's.
_SPEEDS = (-1.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Region:
    """The region of balls that a design catches; see the module's table.

    Attributes:
        across: Of the columns.
        height: Of the rows.
        caught: At each point.
        hand: Where the hand meets those that are caught.
        binding: The limit that binds the ball farthest beyond its limits at each point; empty where
            all are caught. Rows as those of ``caught``.
        box: Half-widths of the box that is thrown at, across and upwards [m].
    """

    across: Array
    height: Array
    caught: Array
    hand: Array
    binding: tuple[tuple[str, ...], ...]
    box: tuple[float, float]


def region_of(
    whole: Arm, c: Candidate, task: Task, progress: Progress, *, each_way: int
) -> Region | None:
    """Return the region of a design; None where it has no map.

    Args:
        whole: The arm with all joints active.
        c: The design.
        task: What is caught.
        progress: Told what is done.
        each_way: Points on each side of the middle.
    """
    f = learned(whole, c, task, "full")
    if f is None:
        return None
    steps = np.linspace(-_FARTHEST, _FARTHEST, 2 * each_way + 1)
    caught, hand, binding = list[Array](), list[Array](), list[tuple[str, ...]]()
    for k, up in enumerate(steps):
        said = _row(f, c, task, steps, float(up))
        shares = said.share.reshape(len(steps), len(_SPEEDS))
        caught.append((shares <= 1.0).mean(axis=1))
        hand.append(said.place[said.share <= 1.0])
        names = np.array(said.binding).reshape(shares.shape)
        worst = np.argmax(shares, axis=1)
        binding.append(tuple(
            "" if share[n] <= 1.0 else str(name[n])
            for share, name, n in zip(shares, names, worst, strict=True)
        ))  # fmt: skip
        progress("region", k + 1, len(steps))
    return Region(
        across=steps, height=c.aim[0, 2] + steps, caught=np.array(caught),
        hand=np.concatenate(hand), binding=tuple(binding),
        box=(float(c.aim[1, 1]), float(c.aim[1, 2])),
    )  # fmt: skip


def _row(f: DirectMap, c: Candidate, task: Task, across: Array, up: float) -> Verdicts:
    """Return the verdicts on the balls through the points of one height, point by point."""
    aside = task.balls.azimuth
    beside = np.array([-np.sin(aside), np.cos(aside), 0.0])
    balls = [
        _through(c.aim[0] + x * beside + np.array([0.0, 0.0, up]), task, faster)
        for x in across
        for faster in _SPEEDS
    ]
    return verdicts(f, balls, driven(f.arm, task.scene), catcher_settings(f.arm, task.scene))


def _through(point: Array, task: Task, faster: float) -> BallState:
    """Return a ball that will pass a point, shape (3,) [m], as it is when the arm starts."""
    flight = Neighbourhood().flight if task.arrivals is None else task.arrivals[3]
    r, dr, drag = point.copy(), task.balls.velocity(faster), task.scene.ball.drag
    advance(r, dr, drag, START - float(np.mean(flight)))
    return BallState(t=0.0, r_o=r, dr_o=dr, drag=drag)
