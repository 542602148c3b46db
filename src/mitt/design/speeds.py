"""Rate against the speed of the throws, and the fastest ball that an arm can catch."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mitt.design.arrivals import of_default_throws
from mitt.design.balls import BOX, FAR, Balls
from mitt.design.candidate import Candidate
from mitt.design.effort import Effort
from mitt.design.evaluation import ENOUGH, Evaluation
from mitt.design.evaluator import Evaluator
from mitt.design.search import reported, search
from mitt.design.task import REPORTED, Task, seen
from mitt.world.flights import smooth
from mitt.world.throws import ThrowRanges

#: Seeds: of the throws at several speeds, of the fresh ones at the fastest of these, and of those
#: that accept a design for slower throws.
_SEED, _SURE_SEED, _ACCEPT = REPORTED + 1000, REPORTED + 5000, 2000
#: Half-width of the speeds of the throws of one speed, as a share; least distance of the release as
#: a share of speed and shortest duration: the default throws' (docs/throws.md).
_SPREAD, _NEAREST = 0.05, 0.8
#: Steps of the bisection; slowest throws that are tried [m/s].
_STEPS, _SLOWEST = 3, 1.5


@dataclass(frozen=True, slots=True, kw_only=True)
class AtSpeed:
    """How a design does at one speed of the throws.

    Attributes:
        speed_m_s: Middle of their speeds at release [m/s].
        throws: How many were thrown.
        feasible: Those caught without a tick beyond a limit.
        binding_limit: Why the others most often were not; None where nothing is known.
        force_n: Median of the largest contact forces of the caught ones [N]; None without any.
    """

    speed_m_s: float
    throws: int
    feasible: int
    binding_limit: str | None
    force_n: float | None = None

    @property
    def enough(self) -> bool:
        """Whether enough of them were caught."""
        return self.throws > 0 and self.feasible >= ENOUGH * self.throws


@dataclass(frozen=True, slots=True, kw_only=True)
class Fastest:
    """The fastest throws that a design catches.

    Attributes:
        speed_m_s: Middle of their speeds at release [m/s]; 0 where there are none.
        more: Whether nothing faster was tried, so that it may be more.
    """

    speed_m_s: float
    more: bool = False

    def __str__(self) -> str:
        """Return it in words."""
        if self.speed_m_s == 0.0:
            return "none"
        return f"{'at least ' if self.more else ''}{self.speed_m_s:.1f} m/s"


def task_at(task: Task, speed: float) -> Task:
    """Return a task with throws of one speed at release [m/s], as far away as they fly.

    The time of flight goes with the square root of the speed: were it the same, a slow ball would
    fall more than it flies; were it in proportion, no arm would be in time for it.
    """
    usual = ThrowRanges()
    longer = float(np.sqrt(speed / np.mean(usual.speed)))
    short, long = (longer * t for t in usual.duration)
    aside = task.balls.azimuth
    ranges = replace(
        usual, speed=((1.0 - _SPREAD) * speed, (1.0 + _SPREAD) * speed), duration=(short, long),
        azimuth=(aside + usual.azimuth[0], aside + usual.azimuth[1]),
        distance=(_NEAREST * short * speed, long * speed), drag=task.scene.ball.drag,
    )  # fmt: skip
    arrivals = of_default_throws(ranges)
    return replace(
        task, balls=arrivals.balls(aim=task.balls.aim), ranges=ranges, arrivals=arrivals.ranges(),
        throws=(), recordings=(),
    )  # fmt: skip


def release_speed(task: Task) -> float:
    """Return the middle of the speeds at release of a task's throws [m/s]."""
    if task.throws:
        return float(np.median([np.linalg.norm(x.dr) for x in seen(task.throws)]))
    if task.recordings:
        return float(np.median([np.linalg.norm(smooth(x.t, x.r).at(0.0)[1])
                                for x in seen(task.recordings)]))  # fmt: skip
    return float(np.mean((task.ranges or ThrowRanges()).speed))


def by_speed(
    evaluator: Evaluator, c: Candidate, task: Task, speeds: Sequence[float], *, throws: int
) -> list[AtSpeed]:
    """Return how a design does at several speeds, its map learned for each.

    Args:
        evaluator: Where it is thrown at.
        c: The design.
        task: What is caught; the speed is changed.
        speeds: At release [m/s].
        throws: At each speed.
    """
    worth = evaluator.try_each(
        "speeds", [(c, task_at(task, speed)) for speed in speeds], throws=throws, seed=_SEED
    )
    return [_at(speed, w) for speed, w in zip(speeds, worth, strict=True)]


def _at(speed: float, w: Evaluation) -> AtSpeed:
    """Return one row; what was not thrown at has no throws, and says why."""
    limit = w.failed or w.binding or None
    return AtSpeed(speed_m_s=speed, throws=w.thrown, feasible=w.clean,
                   force_n=w.force if w.caught else None, binding_limit=limit)  # fmt: skip


def fastest(
    evaluator: Evaluator, c: Candidate, task: Task, rows: Sequence[AtSpeed], effort: Effort, *,
    own: float,
) -> Fastest:  # fmt: skip
    """Return the last speed before the first failure, and what fresh throws say of it.

    Args:
        evaluator: Where it is thrown at.
        c: The design.
        task: What is caught; the speed is changed.
        rows: How it does at several speeds, rising.
        effort: How much is thrown.
        own: Speed of the throws that it was found to catch [m/s]; failures at slower ones do not
            count. 0 where there are none.
    """
    failed = next((x.speed_m_s for x in rows if x.speed_m_s > own and not x.enough), None)
    end = np.inf if failed is None else failed
    good = {x.speed_m_s for x in rows if x.enough and x.speed_m_s < end} | ({own} if own else set())
    low = max(good, default=0.0)
    if failed is not None and good:
        for _ in range(_STEPS):
            middle = 0.5 * (low + failed)
            if by_speed(evaluator, c, task, [middle], throws=effort.each_speed)[0].enough:
                low = middle
                good.add(middle)
            else:
                failed = middle
    for speed in sorted(good, reverse=True):
        again = [(c, task_at(task, speed))]
        worth = evaluator.try_each("fastest", again, throws=effort.sure, seed=_SURE_SEED)[0]
        if worth.enough:
            return Fastest(speed_m_s=speed, more=failed is None and speed == rows[-1].speed_m_s)
    return Fastest(speed_m_s=0.0)


def slower(
    evaluator: Evaluator, effort: Effort, *, joints: Sequence[str] | None, rate: float
) -> tuple[Evaluation, Task] | None:
    """Search again for slower throws until an arm catches enough of them; None where it never does.

    The speeds are bisected between the default throws' and the slowest, each design accepted by
    throws of its own. The throws of the answer are fresh ones, so they may be fewer than enough.
    """
    low, high = _SLOWEST, release_speed(evaluator.task)
    best: tuple[Candidate, Evaluator] | None = None
    for _ in range(effort.slower):
        middle = 0.5 * (low + high)
        at = evaluator.at(task_at(evaluator.task, middle))
        found = search(at, effort, joints=joints, rate=rate)
        if found and _accepted(at, found[0].candidate, effort):
            best, low = (found[0].candidate, at), middle
        else:
            high = middle
    worth = None if best is None else reported(best[1], best[0], effort)
    return None if best is None or worth is None else (worth, best[1].task)


def _accepted(evaluator: Evaluator, c: Candidate, effort: Effort) -> bool:
    """Say whether a design catches enough of throws that are neither its search's nor reported."""
    worth = evaluator.try_all("accepting", [c], throws=effort.report, seed=_ACCEPT, how="full")
    return bool(worth) and worth[0].enough


def default_balls(aim: Sequence[float] | None, reach: float) -> Balls:
    """Return default balls, aimed at a box about a point [m], as wide as the arm's reach asks."""
    if aim is None:
        return Balls()
    half = min(reach, FAR) * np.array(BOX)
    return Balls(aim=np.array([np.asarray(aim, dtype=np.float64), half]))
