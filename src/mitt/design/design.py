"""From an arm to its design: what ``mitt design`` does, without a command line."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from math import isfinite
from pathlib import Path

import mitt
from mitt.design.arrivals import ranges_of_throws, shifted
from mitt.design.causes import FORCE
from mitt.design.effort import Effort
from mitt.design.evaluation import Evaluation
from mitt.design.evaluator import Evaluator, Progress
from mitt.design.kept import Kept
from mitt.design.region import Region, region_of
from mitt.design.search import RATE, ranked, reported, search
from mitt.design.speeds import AtSpeed, Fastest, by_speed, fastest, release_speed, slower
from mitt.design.task import Task, seen
from mitt.design.total import Total
from mitt.files.arm_file import ArmFile, ArrivalSettings, ThrowSettings, digest_of
from mitt.link.clock import monotonic
from mitt.robot.arm import Arm
from mitt.robot.basket import Basket
from mitt.trials.statistics import wilson
from mitt.trials.workers import Engine

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
    task: Task
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
        return "" if self.best is None else rate_of(self.best.clean, self.best.thrown)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the active joints."""
        return () if self.best is None else tuple(
            self.whole.names[k] for k in self.best.candidate.active
        )  # fmt: skip

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
            hand_mount="catch" if path is None else origin.hand_mount,
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
            at=at, around=around, duration=ranges.duration, speed=ranges.speed,
            distance=ranges.distance, azimuth=ranges.azimuth, height=ranges.height,
        )  # fmt: skip


def rate_of(count: int, of: int) -> str:
    """Return in words how many of so many throws, with the Wilson 95 % interval."""
    low, high = wilson(count, of)
    return f"{count} of {of} (95 % interval {100.0 * low:.1f} to {100.0 * high:.1f} %)"


def design(
    whole: Arm, task: Task, effort: Effort, *, progress: Progress,
    joints: Sequence[str] | None = None, engine: Engine | None = None, rate: float = RATE,
    kept: Kept | None = None,
) -> Design:  # fmt: skip
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
        kept: Where answers are kept, and those of a search that was broken off are found.
    """
    start, total = monotonic(), Total(effort, progress)
    evaluator = Evaluator(whole, task, engine, total, kept=kept)
    confirmed = search(evaluator, effort, joints=joints, rate=rate)
    usual = reported(evaluator, confirmed[0].candidate, effort) if confirmed else None
    found = usual is not None and usual.enough
    best, own, reason = usual, release_speed(task) if found else 0.0, None
    if not found and task.own:
        reason = _lost(whole, usual)
    elif not found:
        total.again(effort.less())
        again = slower(evaluator, effort.less(), joints=joints, rate=rate)
        if again is not None:
            best, task = again
            own = release_speed(task)
        reason = _reason(whole, usual, None if again is None else best, own)
    rows, most, region = tuple[AtSpeed, ...](), Fastest(speed_m_s=own), None
    if best is not None:
        region = region_of(whole, best.candidate, task, total, each_way=effort.grid)
        rows = tuple(
            by_speed(evaluator, best.candidate, task, effort.speeds, throws=effort.each_speed)
        )
        most = fastest(evaluator, best.candidate, task, rows, effort, own=own)
    return Design(
        whole=whole, task=task, found=found, reason=reason, best=best, fastest=most, rows=rows,
        seconds=monotonic() - start, left_out=evaluator.tally.told(),
        confirmed=tuple(confirmed) if found else (), region=region,
    )  # fmt: skip


def best_so_far(whole: Arm, kept: Kept, rate: float) -> Design | None:
    """Return the best of a search that is broken off; None where none caught enough yet.

    Its throws are mostly those by which it was chosen, so no fair figures.
    """
    if kept.best is None:
        return None
    task, worth = kept.best
    return Design(whole=whole, task=task, found=False, reason="the search was broken off",
                  best=ranked(worth, rate)[0], fastest=Fastest(speed_m_s=0.0))  # fmt: skip


def softer(whole: Arm) -> str:
    """Return in words what makes catches softer than hand and arm take."""
    basket = isinstance(whole.model.hand, Basket)
    net = "" if basket else "a basket (--hand basket), whose net gives way, "
    lead = "" if basket else ", fingers that meet the ball before the palm does"
    return (
        f"hand or arm take {whole.force:.0f} N: {net}slower throws, joints that leave less relative"
        f" speed{lead} or a lighter ball help"
    )


def _lost(whole: Arm, usual: Evaluation | None) -> str:
    """Return in words why nothing was found for the throws that were asked for.

    Args:
        whole: The arm.
        usual: The best design for them, with throws that no search used.
    """
    if usual is None:
        return "no design meets the throws within the joint speeds and ranges"
    why = f"the best design caught {usual.clean} of {usual.thrown} throws within every limit"
    over = usual.caught - usual.clean
    why += f", and {over} beyond a limit" if over else ""
    why += f", {usual.hard} of them by their force" if usual.hard else ""
    why += f"; most were lost by: {usual.binding}" if usual.binding else ""
    pressed = usual.hard or usual.binding == FORCE
    return why + (f"; {softer(whole)}" if pressed else "")


def _reason(whole: Arm, usual: Evaluation | None, slow: Evaluation | None, speed: float) -> str:
    """Return in words why nothing was found for default throws, and what was for slower ones.

    Args:
        whole: The arm.
        usual: The best design for default throws, with throws that no search used.
        slow: The best design for slower throws, if one catches enough of them.
        speed: Speed of these at release [m/s].
    """
    why = _lost(whole, usual)
    if slow is None or not slow.enough:
        return f"{why}; no design for slower throws catches enough of them either"
    return (
        f"{why}; the design given is for slower throws: {rate_of(slow.clean, slow.thrown)} that"
        f" leave at {speed:.1f} m/s"
    )
