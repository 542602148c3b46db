"""Trials of batting: a ball is thrown, the paddle sends it to a target, or stops it as a shield.

All that is scored is taken from the true states of the world: what the ball touches first and
where, how it leaves, how near it comes to the target before it touches anything else. What the
catcher learns from a hit is taken from what it sees and reads: the ball's flight after the hit,
and the joints' encoders. So it gets to know the restitution of this ball on this paddle, which no
data sheet says to the per cent, from hit to hit; trials of a run follow one another in that order.
"""

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from math import inf
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from mitt.core.arm.arm import Arm
from mitt.core.arm.tools import Paddle
from mitt.core.ball.flight import advance
from mitt.core.catcher.catcher import Catcher
from mitt.core.catcher.generators import Generator
from mitt.core.catcher.settings import Phase
from mitt.core.catcher.state import Result
from mitt.core.errors import InputError, ModelError
from mitt.core.eyes.eyes import Eyes
from mitt.core.map.striking import PaddleStrike, Restitution, mass_behind
from mitt.core.signals import GRAVITY, TICK, Array, Senses, Sighting
from mitt.io.about import About
from mitt.io.recordings import Recording
from mitt.lab.rivals.batting import ORACLE, make_batter
from mitt.lab.trials.bat_station import BatStation
from mitt.lab.trials.catcher_settings import eyes_settings
from mitt.lab.trials.log import TrialLog, recording_of
from mitt.lab.trials.runner import cameras_of
from mitt.lab.trials.score import measure, reason_of, stop_as_json
from mitt.lab.trials.scored_task import Measure, ScoredTask
from mitt.lab.trials.source import Source
from mitt.lab.trials.task_runner import TaskRunner
from mitt.lab.world.build import restitution_on
from mitt.lab.world.engine import BALL_ANY, BALL_ARM, BALL_FLOOR, BALL_HAND
from mitt.lab.world.flights import BallPath
from mitt.lab.world.scene import Scene
from mitt.lab.world.simulation import World
from mitt.lab.world.throws import Throw
from mitt.lab.world.truth import Trace

STATUSES: Final = ("hit", "missed", "unreachable", "stopped", "aborted")

#: By how much the restitution of a run differs from the one that the catcher is told, at most and
#: as share; and what the catcher assumes of that, 1 sigma.
DOUBT = 0.03
_SIGMA = 0.03
#: A trial without contact ends after this time [s], and one with it so long after it.
_LONGEST = 2.5
_AFTER = 2.0
#: How far beyond the target's distance a ball is followed [m].
_BEYOND = 0.3
#: For how long after a hit the ball is looked at [s], from when on [s], and the least number of
#: sightings that tell its velocity.
_LOOK = 0.12
_CLEAR = 0.003
_ENOUGH = 12
#: By how many of its sigmas a hit may change what is believed; more, and it was no clean hit.
_SURPRISE = 3.0
#: Ticks over which joints' readings are compared with their commands.
_MEAN = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class BatTrial:
    """One trial, field by field as in the result.

    Attributes:
        index: Its number.
        status: ``hit``: the ball touches the paddle's face first, and leaves it towards the
            target's half-space; of a shield, the first is enough. ``missed``: it does not.
            ``unreachable``: the arm did not start; ``stopped``, ``aborted``.
        t_hit_s: When the ball was first touched [s].
        miss_m: Least distance of its centre from the target on its way after the hit, before it
            touches anything else.
        passes_m: Where it passes the upright plane through the target, across its way and up from
            the target; None where it does not.
        return_speed_m_s: Its speed after the hit.
        off_middle_mm: How far from the middle of the face it was hit.
        peak_contact_force_n: Largest single contact force on the ball.
        peak_acceleration: Largest commanded acceleration of each joint until the contact [rad/s^2].
        limit_violations: As of :class:`mitt.lab.trials.score.Trial`.
        binding_limit: The limit that the verdict found most used, or what ended the trial.
        restitution: What the catcher believed it to be before the trial.
        stopped_by: Why the catcher stopped; None where it did not.
    """

    index: int
    status: str
    t_hit_s: float | None
    miss_m: float | None
    passes_m: tuple[float, float] | None
    return_speed_m_s: float | None
    off_middle_mm: float | None
    peak_contact_force_n: float | None
    peak_acceleration: list[float]
    limit_violations: int
    binding_limit: str | None
    restitution: float
    stopped_by: dict[str, Any] | None = None


@final
class BatRunner(TaskRunner[BatTrial]):
    """A station with a paddle and its world, built once and used for many trials.

    Attributes:
        known: What is known of the restitution by now.
    """

    def __init__(
        self,
        station: BatStation,
        source: Source,
        *,
        pixels: bool = True,
        generator: str = "direct",
        keeps: bool = False,
    ) -> None:
        """Build the world.

        Args:
            station: The arm with its paddle.
            source: What is thrown.
            pixels: Whether the catcher sees images; noisy points if not.
            generator: Name of what moves the arm.
            keeps: Whether what the catcher takes is kept, for a recording.
        """
        s, paddle = station, paddle_of(station.arm)
        self._station, self._source, self._named = s, source, generator
        told = restitution_on(s.scene, paddle)
        self.known = Restitution(mean=told, sigma=_SIGMA * told)
        cameras = cameras_of(s.rig, s.scene) if pixels else None
        scene = true_scene(s.scene, told, source.seed)
        self._true = restitution_on(scene, paddle)
        world = World(scene, s.arm.model, cameras=cameras, limits=s.arm.limits)
        super().__init__(s.arm, world, keeps=keeps)
        self._eyes = Eyes(s.rig, eyes_settings(s.scene))
        self._believed = told
        self._hit: Hit | None = None
        self._hit_log: TrialLog | None = None
        self._next = 0

    def run(self) -> Iterator[BatTrial]:
        """Run all trials of the source, one after the other, and learn from each hit."""
        for index in range(self._source.count):
            yield self.trial(index)

    @property
    def scene(self) -> Scene:
        """The world as the catcher is told of it."""
        return self._station.scene

    def log_of_success(self, index: int) -> TrialLog:
        """Return the log of the first trial that was hit, by its number.

        Where it was not run here, all up to it are, as each learns from those before.
        """
        while self._hit_log is None and self._next <= index:
            self.trial(self._next)
        return self.log() if self._hit_log is None else self._hit_log

    def draw(self, index: int) -> tuple[Throw | BallPath, int]:
        """Return the ball of a trial, and its seed."""
        return self._source.ball(index), self._source.trial_seed(index) % 2**31

    def generator(self) -> Generator:
        """Return what moves the arm, by what is known by now; an oracle knows what is true."""
        self._believed = self.known.mean
        knows = self._named == ORACLE
        batting = self._station.generator(self._true if knows else self._believed)
        flight = self.world.flight if knows else None
        return make_batter(self._named, batting, flight=flight)

    def made(self, generator: Generator) -> Catcher:
        """Return the catcher that those of all trials begin as."""
        return Catcher(self.arm, generator, self._eyes, settings=self._station.catcher)

    def looks(self, catcher: Catcher) -> bool:
        """Say whether the eyes look: also at the ball's way after a hit."""
        return catcher.looking or 0.0 <= self._since() < _LOOK

    def over(self, catcher: Catcher) -> bool:  # noqa: ARG002
        """Say whether nothing more can happen, asked every ten ticks."""
        asked = self._rows and len(self._rows) % 10 == 0
        return self.world.diverged or bool(asked and batted(self.world, self._station.target))

    def play(self, catcher: Catcher) -> None:
        """Play a trial to its end, look where the ball goes after a hit, and learn from it."""
        watcher, seen = copy(self._eyes), list[Sighting]()
        if self.views:
            watcher.learn_background(self.views)
        while not self.over(catcher):
            watched = 0.0 <= self._since() < _LOOK
            senses = self.tick(catcher)
            seen += _sighted(senses, watcher) if watched else []
        ticks, s = self.gather(catcher), self._station
        self._hit = hit_of(s.arm, self.world, s.target)
        met = catcher.state.fingers[0]["t_catch"].item()
        if self._hit is not None and np.isfinite(met):
            strike = strike_of(s.arm, ticks, met)
            self.known = learned(self.known, strike, s, seen, met + paddle_of(s.arm).touch)

    def _since(self) -> float:
        """Return the time since the contact [s]; before it it is minus infinity."""
        contact = self.world.first_contact
        return -inf if contact is None else self.world.t - contact.t

    def recording(self, trial: BatTrial) -> Recording:
        """Return the recording of the last trial, which has to be kept.

        Raises:
            InputError: What moved the arm is not the map, and only that is made again by a
                replay; or nothing was kept.
        """
        s = self._station
        if self._named != "direct":
            raise InputError("a recording of batting", "trials of the map", self._named)
        if not self.senses:
            raise InputError(
                "a recording of batting",
                "a trial that was kept",
                "none",
                do="run trials with keeps=True",
            )
        about = About(
            arm=s.arm,
            generator="batting",
            maps=(),
            made_of=s.generator(trial.restitution),
            settings=s.catcher,
            rig=s.rig,
            eyes=eyes_settings(s.scene),
            notes={"scene": s.scene.model_dump_json()},
        )
        return recording_of(self.log(), trial, about, {"seed": self._source.seed})

    def score(self, index: int, catcher: Catcher) -> BatTrial:
        """Score a finished trial."""
        world, s, hit, ticks = self.world, self._station, self._hit, self.ticks
        contact, verdict = world.first_contact, catcher.verdict
        stopped = stop_as_json(catcher.stopped_by)
        why = reason_of(stopped) or ("unseen" if verdict is None else verdict.binding_limit)
        status = _status(world, catcher, hit)
        score = hit if status == "hit" else None
        self._next = index + 1
        if score is not None and self._hit_log is None:
            self._hit_log = self.log()
        until = len(ticks.scalars) if contact is None else int(contact.t / TICK)
        return BatTrial(
            index=index,
            status=status,
            t_hit_s=None if contact is None else contact.t,
            miss_m=None if score is None else score.miss,
            passes_m=None if score is None else score.passes,
            return_speed_m_s=None if score is None else score.speed,
            off_middle_mm=None if hit is None else 1e3 * hit.off_middle,
            peak_contact_force_n=None if contact is None else world.peak_force,
            peak_acceleration=np.abs(ticks.command[:until, 2]).max(axis=0, initial=0.0).tolist(),
            limit_violations=measure(s.arm, ticks, world.trace()).limit_violations,
            binding_limit=why,
            restitution=self._believed,
            stopped_by=stopped,
        )


def bat_trials(
    station: BatStation, source: Source, *, vision: str, generator: str, keeps: bool
) -> BatRunner:
    """Return what runs trials of batting, as options and the files of studies say them.

    Args:
        station: The arm with its paddle.
        source: What is thrown.
        vision: What the catcher sees: ``pixels`` or ``points``.
        generator: Name of what moves the arm.
        keeps: Whether what the catcher takes is kept, for a recording.
    """
    pixels = vision == "pixels"
    return BatRunner(station, source, pixels=pixels, generator=generator, keeps=keeps)


def batted(world: World, target: Array | None) -> bool:
    """Say whether nothing more can happen to the score of a trial.

    Args:
        world: Its world.
        target: Where the ball is sent [m], shape (3,); None for a shield.
    """
    truth, contact = world.truth(), world.first_contact
    if world.diverged or truth.ball_on_floor or (contact is None and truth.t >= _LONGEST):
        return True
    if contact is None:
        return False
    if target is None:
        return truth.t >= contact.t + 0.3
    way = target - contact.r_o
    gone = float((truth.r_o - contact.r_o) @ way) / float(way @ way)
    return gone > 1.0 + _BEYOND / float(np.linalg.norm(way)) or truth.t > contact.t + _AFTER


def paddle_of(arm: Arm) -> Paddle:
    """Return the paddle of an arm.

    Raises:
        ModelError: It has none.
    """
    if not isinstance(arm.model.hand, Paddle):
        raise ModelError(f"arm {arm.model.name}", "a paddle", "none")
    return arm.model.hand


def true_scene(scene: Scene, told: float, seed: int) -> Scene:
    """Return a scene whose ball bounces off the paddle a little otherwise than the catcher is told.

    Args:
        scene: The scene.
        told: Restitution of ball and paddle as it is told.
        seed: Seed of the run.
    """
    off = DOUBT * float(np.random.default_rng([seed, 2]).uniform(-1.0, 1.0))
    restitution = min(max(told * (1.0 + off), 0.17), 0.92)
    return scene.model_copy(
        update={"contact": scene.contact.model_copy(update={"restitution": restitution})}
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hit:
    """What became of a ball that touched the paddle's face first.

    Attributes:
        off_middle: Distance of the contact from the middle of the face [m].
        returned: Whether it left towards the target's half-space; true of a shield.
        speed: Of the ball after it [m/s].
        miss: As of :class:`BatTrial`, and ``passes``.
        passes: See ``miss``.
    """

    off_middle: float
    returned: bool
    speed: float
    miss: float | None
    passes: tuple[float, float] | None


def hit_of(arm: Arm, world: World, target: Array | None) -> Hit | None:
    """Return what became of a ball that touched the paddle's face first; None where it did not."""
    truth, contact, paddle = world.trace(), world.first_contact, paddle_of(arm)
    if contact is None:
        return None
    first = min(int(np.ceil(contact.t / TICK - 1e-6)), len(truth.t) - 1)
    if np.any(truth.seen[: first + 1] & (BALL_ARM | BALL_FLOOR)):
        return None
    normal = arm.orientation(truth.q[first])[:, 2]
    away = contact.r_o - contact.position
    deep = float(away @ normal)
    off = float(np.linalg.norm(away - deep * normal))
    if deep + world.radius < 0.0 or off > paddle.radius:
        return None
    apart = np.flatnonzero(truth.seen[first:] & BALL_HAND == 0)
    if len(apart) == 0:
        return None
    left = first + int(apart[0])
    speed = float(np.linalg.norm(truth.dr_o[left]))
    if target is None:
        return Hit(off_middle=off, returned=True, speed=speed, miss=None, passes=None)
    to = target - truth.r_o[left]
    path = _free_path(truth, left)
    return Hit(
        off_middle=off,
        returned=float(truth.dr_o[left] @ to) > 0.0,
        speed=speed,
        miss=nearest(path, target),
        passes=passing(path, target),
    )


def _free_path(truth: Trace, left: int) -> Array:
    """Return where a ball is from a tick on until it touches anything, shape (k, 3) [m]."""
    touches = np.flatnonzero(truth.seen[left + 1 :] & BALL_ANY)
    end = len(truth.t) if len(touches) == 0 else left + 1 + int(touches[0])
    return truth.r_o[left:end]


def nearest(path: Array, target: Array) -> float:
    """Return the least distance of a path of straight pieces, (k, 3), from a point, (3,) [m]."""
    start, way = path[:-1], np.diff(path, axis=0)
    if len(way) == 0:
        return float(np.linalg.norm(path[0] - target))
    squared = np.maximum(np.sum(way**2, axis=1), 1e-18)
    share = np.clip(np.sum((target - start) * way, axis=1) / squared, 0.0, 1.0)
    return float(np.linalg.norm(start + share[:, None] * way - target, axis=1).min())


def passing(path: Array, target: Array) -> tuple[float, float] | None:
    """Return where a path passes the upright plane through a target: across and up from it [m].

    The plane is across the way from the path's start to the target; to the left of that way is
    positive. None where the path ends before it.
    """
    along = np.array([*(target - path[0])[:2], 0.0])
    along /= max(float(np.linalg.norm(along)), 1e-9)
    across = np.array([-along[1], along[0], 0.0])
    ahead = (path - target) @ along
    beyond = np.flatnonzero(ahead >= 0.0)
    if len(beyond) == 0 or beyond[0] == 0:
        return None
    k = int(beyond[0])
    share = ahead[k - 1] / (ahead[k - 1] - ahead[k])
    off = path[k - 1] + share * (path[k] - path[k - 1]) - target
    return float(off @ across), float(off[2])


def _status(world: World, catcher: Catcher, hit: Hit | None) -> str:
    """Return how a trial has ended."""
    if world.diverged:
        return "aborted"
    if catcher.phase is Phase.STOPPED:
        return "stopped"
    if not np.isfinite(catcher.t_0):
        return "unreachable"
    return "hit" if hit is not None and hit.returned else "missed"


def _sighted(senses: Senses, watcher: Eyes) -> list[Sighting]:
    """Return where the ball was seen: as points, or in images."""
    points = [x for x in senses.points if x.found]
    if senses.frames:
        found = watcher.step(senses.frames)
        points += [found] if found.found else []
    return points


def strike_of(arm: Arm, ticks: Result, met: float) -> PaddleStrike:
    """Return a hit as the arm knows it: by its readings, and by the ball that was expected.

    What the joints lag behind their commands is taken from the ticks before the contact, as its
    force is in those after it.

    Args:
        arm: The arm.
        ticks: Results of all ticks.
        met: When ball and paddle met [s].
    """
    k = min(max(int(met / TICK), _MEAN + 1), len(ticks.scalars) - 1)
    rows = slice(k - _MEAN, k)
    read, command = ticks.encoders[rows], ticks.command[rows]
    middle = 0.5 * paddle_of(arm).touch
    behind = (
        np.mean(read[:, 0] - command[:, 0], axis=0),
        np.mean(np.diff(read[:, 0], axis=0) / TICK - command[1:, 1], axis=0),
    )
    dq = ticks.command[k, 1] + behind[1] + middle * ticks.command[k, 2]
    q = ticks.command[k, 0] + behind[0] + middle * dq
    ball = ticks.ball[k - 1, :2].copy()
    advance(
        ball[0],
        ball[1],
        float(ticks.scalars["drag"][k - 1]),
        met - float(ticks.scalars["t_ball"][k - 1]),
    )
    return PaddleStrike(
        q=q,
        dq=dq,
        ball=ball,
        normal=arm.orientation(q)[:, 2],
        v_paddle=arm.jacobian(q) @ dq,
        v_out=np.zeros(3),
        T=0.0,
        astray=0.0,
    )


def learned(
    known: Restitution,
    strike: PaddleStrike,
    station: BatStation,
    seen: list[Sighting],
    apart: float,
) -> Restitution:
    """Return what is known of the restitution after a hit; nothing new after an odd one.

    Args:
        known: What was known before.
        strike: The hit.
        station: Where it was.
        seen: Where the ball was seen about and after it.
        apart: When ball and paddle had parted [s].
    """
    v_out = returned_velocity(seen, apart, station.scene.ball.drag)
    if v_out is None:
        return known
    behind = mass_behind(station.arm, strike.q, strike.normal)
    told = known.after(strike, behind, station.scene.ball.mass, v_out)
    surprising = abs(told.mean - known.mean) > _SURPRISE * known.sigma
    return known if surprising else told


def returned_velocity(seen: list[Sighting], apart: float, drag: float) -> Array | None:
    """Return the velocity of a ball when it left the paddle [m/s], (3,), by a fit of its flight.

    Three rounds of least squares: what gravity and drag do is taken from the round before, and
    sightings far off the flight are left out. None where the ball was seen too rarely.

    Args:
        seen: Where it was seen, and when.
        apart: When it had left the paddle [s].
        drag: Its drag coefficient [1/m].
    """
    used = [x for x in seen if x.t > apart + _CLEAR]
    if len(used) < _ENOUGH:
        return None
    t, r = np.array([x.t - apart for x in used]), np.array([x.r_o for x in used])
    keep: NDArray[np.bool_] = np.ones(len(t), np.bool_)
    start, bent = np.zeros((2, 3)), np.zeros((len(t), 3))
    bent[:, 2] = -0.5 * GRAVITY * t**2
    for _ in range(3):
        rows = np.column_stack([np.ones(len(t)), t])
        start = np.linalg.lstsq(rows[keep], (r - bent)[keep], rcond=None)[0]
        off = np.linalg.norm(r - bent - rows @ start, axis=1)
        keep = off <= max(4.0 * float(np.median(off)), 1e-4)
        if np.sum(keep) < _ENOUGH:
            return None
        for k, after in enumerate(t.tolist()):
            flight = start.copy()
            advance(flight[0], flight[1], drag, after)
            bent[k] = flight[0] - start[0] - after * start[1]
    return np.asarray(start[1])


def _share(values: list[float], percent: float) -> float | None:
    """Return a percentile; None of nothing."""
    return float(np.percentile(values, percent)) if values else None


def _more(trials: Sequence[BatTrial]) -> dict[str, Any]:
    """Return what the summary of a run says beside counts and rate."""
    misses = [t.miss_m for t in trials if t.miss_m is not None]
    later = [t.miss_m for t in trials[20:] if t.miss_m is not None]
    speeds = [t.return_speed_m_s for t in trials if t.return_speed_m_s is not None]
    return {
        "median_miss_m": _share(misses, 50.0),
        "p90_miss_m": _share(misses, 90.0),
        "median_miss_after_20_m": _share(later, 50.0),
        "median_return_speed_m_s": _share(speeds, 50.0),
        "limit_violations": sum(t.limit_violations for t in trials),
    }


BAT: Final = ScoredTask(
    name="bat",
    schema="mitt.bat-study/1",
    trial=BatTrial,
    trials="trials",
    doing="batting",
    in_result="throws",
    statuses=STATUSES,
    rate="hit_rate",
    counted="balls hit",
    measures={
        "miss_cm": Measure("miss at the target [cm]", "miss_m", 1, factor=100.0),
        "off_middle_mm": Measure("off the paddle's middle [mm]", "off_middle_mm", 1),
        "acceleration": Measure("peak acceleration [rad/s^2]", "peak_acceleration", 0),
        "force_n": Measure("force on the ball [N]", "peak_contact_force_n", 0),
    },
    medians={},
    more=_more,
)
"""The task."""
