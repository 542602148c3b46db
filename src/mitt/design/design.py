"""From an arm to its design: what ``mitt design`` does, without a command line."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import mitt
from mitt.design.assay import Task, Worth
from mitt.design.search import Effort, reported, search
from mitt.design.speeds import SPEEDS, AtSpeed, by_speed, fastest, release_speed, slower
from mitt.design.workers import Bench, Progress
from mitt.files.arm_file import ArmFile, digest_of
from mitt.files.throws import ThrowSettings
from mitt.link.clock import monotonic
from mitt.robot.arm import Arm
from mitt.sweep.engine import Engine
from mitt.trials.statistics import wilson

SCHEMA = "mitt.design/1"


@dataclass(frozen=True, slots=True, kw_only=True)
class Origin:
    """Where an arm comes from, as its arm file will say.

    Attributes:
        arm: ``wam``, or a description file.
        tip: Frame of the file at the catch point.
        limits: Name or file of its limits; None for those of the file.
    """

    arm: str | Path
    tip: str | None = None
    limits: str | Path | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Design:
    """What was found for an arm.

    Attributes:
        whole: The arm with all its joints active.
        found: Whether it catches enough of the throws within every limit.
        reason: Why not; None where it does.
        best: The best candidate, with what it caught of throws that no search used; None where
            none was found at all.
        fastest: Fastest throws of which it catches enough [m/s]; 0 where there are none.
        rows: How it does at several speeds.
        seconds: How long that took.
        left_out: Which candidates could not be evaluated, in words.
    """

    whole: Arm
    found: bool
    reason: str | None
    best: Worth | None
    fastest: float
    rows: Sequence[AtSpeed] = field(default_factory=tuple)
    seconds: float = 0.0
    left_out: Sequence[str] = ()

    @property
    def rate(self) -> str:
        """The share of the reported throws, with its Wilson 95 % interval, in words."""
        return "" if self.best is None else rate_of(self.best.clean, self.best.thrown)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the active joints."""
        return () if self.best is None else tuple(
            self.whole.names[k] for k in self.best.candidate.free
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
            "fastest_m_s": self.fastest,
            "by_speed": [asdict(row) for row in self.rows],
            "seconds": self.seconds,
        }

    def arm_file(self, origin: Origin) -> ArmFile:
        """Return all that ``--arm`` needs."""
        assert self.best is not None
        c, names = self.best.candidate, self.whole.names
        path = origin.arm if isinstance(origin.arm, Path) else None
        at, around = c.aim.tolist()
        return ArmFile(
            arm=origin.arm,
            sha256=None if path is None else digest_of(path),
            tip=origin.tip,
            joints=self.joints,
            ready=tuple(c.ready.tolist()),
            held={names[k]: float(x) for k, x in enumerate(c.q) if k not in c.free},
            limits=origin.limits,
            hand_turn=c.turn,
            map=c.design,
            throws=ThrowSettings(at=tuple(at), around=tuple(around)),
        )


def rate_of(count: int, of: int) -> str:
    """Return in words how many of so many throws, with the Wilson 95 % interval."""
    low, high = wilson(count, of)
    return f"{count} of {of} (95 % interval {100.0 * low:.1f} to {100.0 * high:.1f} %)"


def design(
    whole: Arm, task: Task, effort: Effort, *, progress: Progress,
    joints: Sequence[str] | None = None, engine: Engine | None = None,
) -> Design:  # fmt: skip
    """Find what an arm can catch and the map that does it.

    Args:
        whole: The arm, all its joints active.
        task: What is to be caught.
        effort: How much is tried.
        progress: Told what is done.
        joints: Joints of which three are active; any if left out.
        engine: Where candidates are tried; in this process if left out.
    """
    start = monotonic()
    bench = Bench(whole, task, engine, progress)
    chosen = search(bench, effort, joints=joints)
    best = None if chosen is None else reported(bench, chosen.candidate, effort)
    found = best is not None and best.enough
    tried, speed = best, 0.0
    if not found:
        again = slower(bench, effort.less(), joints=joints)
        tried = None if again is None else again[0]
        speed = 0.0 if again is None else release_speed(again[1])
    rows = () if tried is None else tuple(by_speed(bench, tried.candidate, task, SPEEDS))
    if tried is not None:
        speed = max(speed, fastest(bench, tried.candidate, task, rows))
    return Design(
        whole=whole,
        found=found,
        reason=None if found else _reason(best, speed),
        best=best,
        fastest=speed,
        rows=rows,
        seconds=monotonic() - start,
        left_out=bench.tally.told(),
    )


def _reason(best: Worth | None, speed: float) -> str:
    """Return in words why nothing was found."""
    if best is None:
        why = "no pose meets the default throws within the joint speeds and ranges"
    else:
        why = f"the best design caught {best.clean} of {best.thrown} throws within every limit"
        why += f", and {best.caught - best.clean} beyond one" if best.caught > best.clean else ""
        why += f", most often lost: {best.binding}" if best.binding else ""
    can = f"the fastest balls that it catches leave at {speed:.1f} m/s" if speed > 0.0 else (
        "no slower ball was caught either"
    )  # fmt: skip
    return f"{why}; {can}"
