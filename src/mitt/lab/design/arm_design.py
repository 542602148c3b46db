"""From an arm to its design: what ``mitt design`` does, without a command line.

Besides the best candidate it has the region of balls that it catches and its rate against the speed
of the throws. The balls of the region fly as those of the task do, through the points of an upright
grid about the middle of the box that is thrown at: through each a slow, a middling and a fast one.

| region      | meaning                                                    | unit  | shape     |
|-------------|------------------------------------------------------------|-------|-----------|
| ``across``  | horizontally off the middle of the box, across the balls' way | m  | (C,)      |
| ``height``  | height in the base frame                                   | m     | (H,)      |
| ``caught``  | how many of the balls through a point are caught, as a share | 1   | (H, C)    |
| ``hand``    | where the hand meets those                                 | m     | (K, 3)    |
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from math import isfinite
from pathlib import Path

import numpy as np

import mitt
from mitt.clock import Progress, monotonic
from mitt.core.arm.arm import Arm
from mitt.core.ball.flight import advance
from mitt.core.map.mapping import DirectMap
from mitt.core.map.neighbourhood import Neighbourhood
from mitt.core.signals import Array, BallState
from mitt.io.arm_file import ArmFile, ArrivalSettings, ThrowSettings, digest_of
from mitt.lab.design.candidate import Candidate
from mitt.lab.design.evaluation import (
    ENOUGH,
    FORCE,
    START,
    Evaluation,
    Verdicts,
    learned_map,
    verdicts,
)
from mitt.lab.design.search import (
    NEARER,
    RATE,
    Effort,
    SearchProgress,
    part_of,
    ranked,
    reported,
    search,
    to_report,
)
from mitt.lab.design.search_jobs import Answers, Asked, Evaluator, Procedure
from mitt.lab.design.task import (
    BOX,
    FAR,
    REPORTED,
    Balls,
    DesignTask,
    of_default_throws,
    ranges_of_throws,
    seen,
    shifted,
)
from mitt.lab.trials.catcher_settings import catcher_settings, driven
from mitt.lab.trials.statistics import wilson
from mitt.lab.trials.workers import Engine
from mitt.lab.world.flights import smooth
from mitt.lab.world.throws import ThrowRanges

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
    whole: Arm, c: Candidate, task: DesignTask, progress: Progress, *, each_way: int
) -> Region | None:
    """Return the region of a design; None where it has no map.

    It has ``each_way`` points on each side of the middle.
    """
    f = learned_map(whole, c, task, "full")
    if f is None:
        return None
    steps = np.linspace(-_FARTHEST, _FARTHEST, 2 * each_way + 1)
    caught, hand, binding = list[Array](), list[Array](), list[tuple[str, ...]]()
    progress("region", 0, len(steps))
    for k, up in enumerate(steps):
        said = _row(f, c, task, steps, float(up))
        shares = said.share.reshape(len(steps), len(_SPEEDS))
        caught.append((shares <= 1.0).mean(axis=1))
        hand.append(said.place[said.share <= 1.0])
        names = np.array(said.binding).reshape(shares.shape)
        worst = np.argmax(shares, axis=1)
        binding.append(
            tuple(
                "" if share[n] <= 1.0 else str(name[n])
                for share, name, n in zip(shares, names, worst, strict=True)
            )
        )
        progress("region", k + 1, len(steps))
    return Region(
        across=steps,
        height=c.aim[0, 2] + steps,
        caught=np.array(caught),
        hand=np.concatenate(hand),
        binding=tuple(binding),
        box=(float(c.aim[1, 1]), float(c.aim[1, 2])),
    )


def _row(f: DirectMap, c: Candidate, task: DesignTask, across: Array, up: float) -> Verdicts:
    """Return the verdicts on the balls through the points of one height, point by point."""
    aside = task.balls.azimuth
    beside = np.array([-np.sin(aside), np.cos(aside), 0.0])
    balls = [
        _through(c.aim[0] + x * beside + np.array([0.0, 0.0, up]), task, faster)
        for x in across
        for faster in _SPEEDS
    ]
    return verdicts(f, balls, driven(f.arm, task.scene), catcher_settings(f.arm, task.scene))


def _through(point: Array, task: DesignTask, faster: float) -> BallState:
    """Return a ball that will pass a point, shape (3,) [m], as it is when the arm starts."""
    flight = Neighbourhood().flight if task.arrivals is None else task.arrivals[3]
    r, dr, drag = point.copy(), task.balls.velocity(faster), task.scene.ball.drag
    advance(r, dr, drag, START - float(np.mean(flight)))
    return BallState(t=0.0, r_o=r, dr_o=dr, drag=drag)


#: Seeds: of the throws at several speeds, and of the fresh ones at the fastest of these.
_SPEEDS_SEED = REPORTED + 1000
_SURE_SEED = REPORTED + 5000


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


def task_at(task: DesignTask, speed: float) -> DesignTask:
    """Return a task with throws of one speed at release [m/s], as far away as they fly.

    The time of flight goes with the square root of the speed: were it the same, a slow ball would
    fall more than it flies; were it in proportion, no arm would be in time for it. Least distances
    are such a share of speed and time as those of the default throws (docs/throws.md).
    """
    usual = ThrowRanges()
    longer = float(np.sqrt(speed / np.mean(usual.speed)))
    short, long = (longer * t for t in usual.duration)
    aside = task.balls.azimuth
    ranges = replace(
        usual,
        speed=(0.95 * speed, 1.05 * speed),
        duration=(short, long),
        azimuth=(aside + usual.azimuth[0], aside + usual.azimuth[1]),
        distance=(0.8 * short * speed, long * speed),
        drag=task.scene.ball.drag,
    )
    arrivals = of_default_throws(ranges)
    return replace(
        task,
        balls=arrivals.balls(aim=task.balls.aim),
        ranges=ranges,
        arrivals=arrivals.ranges(),
        throws=(),
        recordings=(),
    )


def release_speed(task: DesignTask) -> float:
    """Return the middle of the speeds at release of a task's throws [m/s]."""
    if task.throws:
        return float(np.median([np.linalg.norm(x.dr) for x in seen(task.throws)]))
    if task.recordings:
        curves = [smooth(x.t, x.r) for x in seen(task.recordings)]
        return float(np.median([np.linalg.norm(x.at(x.release)[1]) for x in curves]))
    return float(np.mean((task.ranges or ThrowRanges()).speed))


def by_speed(
    evaluator: Evaluator,
    c: Candidate,
    task: DesignTask,
    speeds: Sequence[float],
    *,
    throws: int,
    stage: str = "speeds",
) -> list[AtSpeed]:
    """Return how a design does at several speeds, its map learned for each.

    Speeds are those at release [m/s]; ``stage`` is what the progress calls it.
    """
    worth = evaluator.try_each(stage, _at_speeds(c, task, speeds, throws=throws))
    return [_at(speed, w) for speed, w in zip(speeds, worth, strict=True)]


def _at_speeds(
    c: Candidate, task: DesignTask, speeds: Sequence[float], *, throws: int
) -> list[Asked]:
    """Return what is asked of a design to say how it does at several speeds."""
    by = Procedure(throws=throws, seed=_SPEEDS_SEED, give_up=False, images=True)
    return [(c, task_at(task, speed), by) for speed in speeds]


def _described(
    evaluator: Evaluator, c: Candidate, effort: Effort
) -> tuple[Evaluation | None, tuple[AtSpeed, ...]]:
    """Return a design's reported throws and how it does at several speeds, thrown side by side.

    None, and no rows, where it is not thrown at.
    """
    task = evaluator.task
    asked = [
        to_report(c, task, effort),
        *_at_speeds(c, task, effort.speeds, throws=effort.each_speed),
    ]
    worth, *rest = evaluator.try_each("reporting", asked)
    if worth.failed:
        return None, ()
    return worth, tuple(_at(x, w) for x, w in zip(effort.speeds, rest, strict=True))


def _at(speed: float, w: Evaluation) -> AtSpeed:
    """Return one row; what was not thrown at has no throws, and says why."""
    limit = w.failed or w.binding or None
    return AtSpeed(
        speed_m_s=speed,
        throws=w.thrown,
        feasible=w.clean,
        force_n=w.force if w.caught else None,
        binding_limit=limit,
    )


def fastest(
    evaluator: Evaluator,
    c: Candidate,
    task: DesignTask,
    rows: Sequence[AtSpeed],
    effort: Effort,
    *,
    own: float,
) -> Fastest:
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
        for k in range(NEARER):
            middle = 0.5 * (low + failed)
            at = by_speed(
                evaluator,
                c,
                task,
                [middle],
                throws=effort.each_speed,
                stage=part_of("nearer", k, NEARER),
            )
            if at[0].enough:
                low = middle
                good.add(middle)
            else:
                failed = middle
    first = effort.sure // 2  # two halves, thrown side by side
    halves = [
        Procedure(throws=n, seed=_SURE_SEED + k, give_up=False, images=True)
        for k, n in enumerate((first, effort.sure - first))
    ]
    for speed in sorted(good, reverse=True):
        there = task_at(task, speed)
        one, other = evaluator.try_each("fastest", [(c, there, by) for by in halves])
        if one.with_more(other).enough:
            return Fastest(speed_m_s=speed, more=failed is None and speed == rows[-1].speed_m_s)
    return Fastest(speed_m_s=0.0)


def slower(
    evaluator: Evaluator, effort: Effort, *, joints: Sequence[str] | None, rate: float
) -> tuple[Evaluation, DesignTask] | None:
    """Search again for slower throws until an arm catches enough of them; None where it never does.

    The speeds are bisected between the default throws' and 1.5 m/s, each design accepted by
    throws of its own. The throws of the answer are fresh ones, so they may be fewer than enough.
    """
    low, high = 1.5, release_speed(evaluator.task)
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
    by = Procedure(throws=effort.report, seed=2000, how="full", images=True)
    worth = evaluator.try_all("accepting", [c], by)
    return bool(worth) and worth[0].enough


def default_balls(aim: Sequence[float] | None, reach: float) -> Balls:
    """Return default balls, aimed at a box about a point [m], as wide as the arm's reach asks."""
    if aim is None:
        return Balls()
    half = min(reach, FAR) * np.array(BOX)
    return Balls(aim=np.array([np.asarray(aim, dtype=np.float64), half]))


SCHEMA = "mitt.design/1"
Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Design:
    """What was found for an arm.

    Attributes:
        whole: The arm with all its joints active.
        task: What the best candidate is for: what was asked, or slower throws.
        found: Whether it catches enough of the throws that were asked for within every limit.
        reason: Why not; None where it does.
        best: The best candidate for the task, with what it caught of throws that no search used;
            None where none was found at all.
        fastest: Fastest throws of which it catches enough.
        rows: How it does at several speeds.
        seconds: How long that took.
        left_out: Which candidates could not be evaluated, in words.
        confirmed: What it was chosen from, the chosen one first, with the throws that decided.
        region: Where balls may pass; None without a design.
    """

    whole: Arm
    task: DesignTask
    found: bool
    reason: str | None
    best: Evaluation | None
    fastest: Fastest
    rows: Sequence[AtSpeed] = field(default_factory=tuple)
    seconds: float = 0.0
    left_out: Sequence[str] = ()
    confirmed: Sequence[Evaluation] = ()
    region: Region | None = None

    @property
    def usable(self) -> bool:
        """Whether the best candidate catches enough of what it is for: then it has an arm file."""
        return self.best is not None and self.best.enough

    @property
    def rate(self) -> str:
        """The share of the reported throws, with its Wilson 95 % interval, in words."""
        return "" if self.best is None else rate_in_words(self.best.clean, self.best.thrown)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the active joints."""
        return (
            ()
            if self.best is None
            else tuple(self.whole.names[k] for k in self.best.candidate.active)
        )

    def as_json(self) -> dict[str, object]:
        """Return what ``mitt design --json`` prints."""
        w = self.best if self.found else None
        return {
            "schema": SCHEMA,
            "version": mitt.__version__,
            "arm": self.whole.model.name,
            "found": self.found,
            "reason": self.reason,
            "joints": list(self.joints),
            "throws": 0 if self.best is None else self.best.thrown,
            "feasible": 0 if self.best is None else self.best.clean,
            "caught": 0 if self.best is None else self.best.caught,
            "relative_speed_m_s": None if w is None else w.speed,
            "force_n": None if w is None else w.force,
            "force_limit_n": self.whole.force if isfinite(self.whole.force) else None,
            "over_force": 0 if self.best is None else self.best.hard,
            "fastest_m_s": self.fastest.speed_m_s,
            "by_speed": [asdict(row) for row in self.rows],
            "seconds": self.seconds,
        }

    def arm_file(self, origin: ArmFile) -> ArmFile:
        """Return all that ``--arm`` needs, with the ranges of slower throws if it is for those.

        Args:
            origin: Where the arm comes from, its limits and its hand.
        """
        assert self.best is not None
        c, names = self.best.candidate, self.whole.names
        path = origin.arm if isinstance(origin.arm, Path) else None
        at, around = c.aim.tolist()
        return replace(
            origin,
            sha256=None if path is None else digest_of(path),
            joints=self.joints,
            ready=tuple(c.q_ready.tolist()),
            held={names[k]: float(x) for k, x in enumerate(c.q) if k not in c.active},
            hand_turn=c.turn,
            hand_mount="catch" if origin.arm == "wam" else origin.hand_mount,
            map=c.design,
            throws=self._throws(tuple(at), tuple(around)),
            arrivals=self._arrivals(),
        )

    def _arrivals(self) -> ArrivalSettings | None:
        """Return what maps are to be learned for; None for default throws."""
        if self.task.arrivals is None:
            return None
        speed, descent, azimuth, flight = map(tuple, self.task.arrivals.tolist())
        return ArrivalSettings(speed=speed, descent=descent, azimuth=azimuth, flight=flight)

    def _throws(self, at: Point, around: Point) -> ThrowSettings:
        """Return a box to aim at [m], with the ranges of throws if they are no default ones."""
        assert self.best is not None
        task, c = self.task, self.best.candidate
        if task.throws:
            ranges = ranges_of_throws(seen(task.throws), c.aim, task.scene.ball.drag)
        elif task.ranges is not None:
            ranges = shifted(task.ranges, c.arm(self.whole))
        else:
            return ThrowSettings(at=at, around=around)
        return ThrowSettings(
            at=at,
            around=around,
            duration=ranges.duration,
            speed=ranges.speed,
            distance=ranges.distance,
            azimuth=ranges.azimuth,
            height=ranges.height,
        )


def rate_in_words(count: int, of: int) -> str:
    """Return in words how many of so many throws, with the Wilson 95 % interval."""
    low, high = wilson(count, of)
    return f"{count} of {of} (95 % interval {100.0 * low:.1f} to {100.0 * high:.1f} %)"


def design(
    whole: Arm,
    task: DesignTask,
    effort: Effort,
    *,
    progress: Progress,
    joints: Sequence[str] | None = None,
    engine: Engine | None = None,
    rate: float = RATE,
    answers: Answers | None = None,
    start: Candidate | None = None,
) -> Design:
    """Find what an arm can catch and the map that does it.

    Args:
        whole: The arm, all its joints active.
        task: What is to be caught.
        effort: How much is tried.
        progress: Told what is done of the whole search.
        joints: Joints of which three are active; any if left out.
        engine: Where candidates are tried; in this process if left out.
        rate: Share of the throws that is asked for: the softest design that catches as many is
            taken.
        answers: Where answers are kept, and those of a search that was broken off are found.
        start: A design to change a little; it looks for one from nothing if left out.
    """
    began, answers = monotonic(), answers or Answers()
    total = SearchProgress(effort, progress, answers, rate)
    evaluator = Evaluator(whole, task, engine, total, answers=answers)
    confirmed = search(evaluator, effort, joints=joints, rate=rate, start=start)
    usual, rows = _described(evaluator, confirmed[0].candidate, effort) if confirmed else (None, ())
    found = usual is not None and usual.enough
    best, own, reason = usual, release_speed(task) if found else 0.0, None
    lost = "" if found else _lost(whole, usual or answers.most, evaluator.tally.hindrance)
    weak = usual is None and answers.most is None and _kind(evaluator.tally.hindrance) == "hold"
    if not found and (task.own or start is not None or weak):  # slower throws would not help
        reason = lost
    elif not found:
        total.again(effort.less())
        again = slower(evaluator, effort.less(), joints=joints, rate=rate)
        if again is not None:
            best, task = again
            own = release_speed(task)
            rows = tuple(
                by_speed(evaluator, best.candidate, task, effort.speeds, throws=effort.each_speed)
            )
        reason = _reason(lost, None if again is None else best, own)
    most, region = Fastest(speed_m_s=own), None
    if best is not None:
        region = region_of(whole, best.candidate, task, total, each_way=effort.grid)
        most = fastest(evaluator, best.candidate, task, rows, effort, own=own)
    return Design(
        whole=whole,
        task=task,
        found=found,
        reason=reason,
        best=best,
        fastest=most,
        rows=rows,
        seconds=monotonic() - began,
        left_out=evaluator.tally.told(),
        confirmed=tuple(confirmed) if found else (),
        region=region,
    )


def best_so_far(whole: Arm, answers: Answers, rate: float) -> Design | None:
    """Return the best of a search that is broken off; None where none caught enough yet.

    Its throws are mostly those by which it was chosen, so no fair figures.
    """
    if answers.best is None:
        return None
    task, worth = answers.best
    return Design(
        whole=whole,
        task=task,
        found=False,
        reason="the search was broken off",
        best=ranked(worth, rate)[0],
        fastest=Fastest(speed_m_s=0.0),
    )


def softer(whole: Arm) -> str:
    """Return in words what makes catches softer than hand and arm take."""
    basket = whole.model.hand is not None and not whole.model.hand.closes
    net = "" if basket else "a basket (--hand basket), whose net gives way, "
    lead = "" if basket else ", fingers that meet the ball before the palm does"
    return (
        f"hand or arm take {whole.force:.0f} N: {net}slower throws, joints that leave less relative"
        f" speed{lead} or a lighter ball help"
    )


#: Why most candidates had no pose, by the kind of what hindered them.
_HINDERED = {
    "hold": "{0} is too weak to hold the arm in most of them; are the torques those of its drives?"
    " others go into a limits file (--limits FILE.toml)",
    "torque": "{0} is too weak to bring the hand to the speed of the ball",
    "speed": "{0} is too slow to bring the hand to the speed of the ball",
    "range": "they begin at the end of a range",
    "clearance": "the arm touches itself or the floor in most of them",
    "domain": "the flights leave the domain of most of their maps",
}


def _kind(hindrance: str) -> str:
    """Return the kind of a hindrance, without its joint."""
    return hindrance.partition(":")[0]


def _lost(whole: Arm, usual: Evaluation | None, hindrance: str) -> str:
    """Return in words why nothing was found for the throws that were asked for.

    ``usual`` is the best design for them, with throws that no search used or, where none was worth
    these, with those by which it was chosen; ``hindrance`` is what kept most candidates from a pose
    (:func:`mitt.lab.design.evaluation.hindrance`).
    """
    if usual is None and hindrance:
        joint = hindrance.partition(":")[2]
        return f"no pose meets the throws: {_HINDERED[_kind(hindrance)].format(joint)}"
    if usual is None:
        return "no pose meets the throws within the joint speeds and ranges"
    why = f"the best design caught {usual.clean} of {usual.thrown} throws within every limit"
    over = usual.caught - usual.clean
    why += f", and {over} beyond a limit" if over else ""
    why += f", {usual.hard} of them by their force" if usual.hard else ""
    why += f"; most were lost by: {usual.binding}" if usual.binding else ""
    pressed = usual.hard or usual.binding == FORCE
    return why + (f"; {softer(whole)}" if pressed else "")


def _reason(lost: str, slow: Evaluation | None, speed: float) -> str:
    """Return in words why nothing was found for default throws, and what was for slower ones.

    ``lost`` is the former; ``slow`` is the best design for slower throws, with throws that no
    search used; ``speed`` is theirs at release [m/s].
    """
    if slow is None or not slow.enough:
        return f"{lost}; no design for slower throws catches enough of them either"
    rate = rate_in_words(slow.clean, slow.thrown)
    return f"{lost}; the design given is for slower throws: {rate} that leave at {speed:.1f} m/s"
