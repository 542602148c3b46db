"""Trials of batting: a ball is thrown, the paddle sends it to a target, or stops it as a shield.

All that is scored is taken from the true states of the world (:mod:`mitt.lab.trials.landing`).
What the catcher learns from a hit is taken from what it sees and reads: the ball's flight after the
hit, and the joints' encoders. So it gets to know the restitution of this ball on this paddle, which
no data sheet says to the per cent, from hit to hit; trials of a run follow one another in that
order.
"""

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass, replace
from math import inf, isfinite
from typing import Any, Final, final

import numpy as np
from numpy.typing import NDArray

from mitt.core.arm.arm import Arm
from mitt.core.arm.tools import Paddle
from mitt.core.ball.flight import advance, advance_spinning
from mitt.core.ball.spin import spin_shown, steady_lift
from mitt.core.catcher.batting import BattingSettings
from mitt.core.catcher.catcher import Catcher
from mitt.core.catcher.generators import Generator
from mitt.core.catcher.settings import Phase
from mitt.core.catcher.state import LIFT, Result
from mitt.core.errors import InputError
from mitt.core.eyes.eyes import Eyes
from mitt.core.map.striking import Grip, PaddleStrike, Restitution, mass_behind
from mitt.core.signals import GRAVITY, TICK, Array, Senses, Sighting
from mitt.io.about import About
from mitt.io.recordings import Recording
from mitt.lab.rivals.batting import ORACLE, make_batter
from mitt.lab.trials.bat_station import BatStation, impact_of
from mitt.lab.trials.catcher_settings import COMES, eyes_settings
from mitt.lab.trials.landing import CLOSE, Hit, batted, hit_of, paddle_of
from mitt.lab.trials.log import TrialLog, recording_of
from mitt.lab.trials.runner import cameras_of
from mitt.lab.trials.score import measure, reason_of, stop_as_json
from mitt.lab.trials.scored_task import Measure, ScoredTask
from mitt.lab.trials.source import Source
from mitt.lab.trials.statistics import wilson
from mitt.lab.trials.task_runner import TaskRunner
from mitt.lab.world.build import restitution_on
from mitt.lab.world.flights import BallPath
from mitt.lab.world.scene import Scene
from mitt.lab.world.simulation import World
from mitt.lab.world.throws import Throw

STATUSES: Final = ("returned", "wide", "missed", "unreachable", "stopped", "aborted")
_SCORED: Final = ("returned", "wide")

#: For how long after a hit the ball is looked at [s], from when on [s], and the least number of
#: sightings that tell its velocity.
_LOOK = 0.12
_CLEAR = 0.003
_ENOUGH = 12
#: 1-sigma of the spin along the velocity that a flight leaves open, as share of the spin.
_VAGUE = 0.3
#: By how many of its sigmas a hit may change what is believed; more, and it was no clean hit.
_SURPRISE = 3.0
#: Ticks over which joints' readings are compared with their commands.
_MEAN = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class BatTrial:
    """One trial, field by field as in the result.

    Attributes:
        index: Its number.
        status: ``returned``: the ball touches the paddle's face first, and lands within 25 cm of
            the target; of a shield, the first is enough. ``wide``: it touches the face first, and
            lands elsewhere. ``missed``: it does not. ``unreachable``: the arm did not start;
            ``stopped``, ``aborted``.
        t_hit_s: When the ball was first touched [s].
        landing_m: Distance from the target of where its centre comes down to the target's height
            after it has touched the face first, before it touches anything else; None where it
            does not come down there.
        lands_m: The same place, beyond the target along the level way from where it was hit, and
            to the left of the target.
        miss_m: Least distance of its centre from the target on that way.
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
    landing_m: float | None
    lands_m: tuple[float, float] | None
    miss_m: float | None
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
        known: What is known of ball and paddle by now.
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
        self.known = known_of(s)
        cameras = cameras_of(s.rig, s.scene) if pixels else None
        scene = true_scene(s.scene, paddle, source.seed)
        self._true = impact_of(scene, paddle)
        world = World(scene, s.arm.model, cameras=cameras, limits=s.arm.limits)
        super().__init__(s.arm, world, keeps=keeps)
        self._eyes = Eyes(s.rig, eyes_settings(s.scene))
        self._believed = self.known.restitution.mean
        self._told = s.batting.settings
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
        """Return the log of the first ball that was returned, by the number of its trial.

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
        self._believed = self.known.restitution.mean
        knows, told = self._named == ORACLE, self.known.told(self._station.batting.settings)
        if knows:
            x, y, z = self.world.spin.tolist()
            told = replace(told, impact=self._true, spin=(x, y, z))
        self._told = told
        batting = self._station.generator(told)
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
            hit = strike_of(s.arm, ticks, met)
            self.known = learned(self.known, hit, s, seen, met + paddle_of(s.arm).touch)

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
            made_of=s.generator(self._told),
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
        score = hit if status in _SCORED else None
        self._next = index + 1
        if status == BAT.success and self._hit_log is None:
            self._hit_log = self.log()
        until = len(ticks.scalars) if contact is None else int(contact.t / TICK)
        return BatTrial(
            index=index,
            status=status,
            t_hit_s=None if contact is None else contact.t,
            landing_m=None if score is None else score.landing,
            lands_m=None if score is None else score.lands,
            miss_m=None if score is None else score.miss,
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


def true_scene(scene: Scene, paddle: Paddle, seed: int) -> Scene:
    """Return a scene whose ball flies, and bounces off the paddle, otherwise than is told.

    Args:
        scene: The scene.
        paddle: The paddle.
        seed: Seed of the run, from which the errors are drawn.
    """
    told, off, rng = scene.contact, scene.mismatch, np.random.default_rng([seed, 2])
    e, along, fall, lift = rng.uniform(-1.0, 1.0, 4).tolist()
    restitution = restitution_on(scene, paddle) * (1.0 + off.restitution * e)
    tangential = paddle.tangential if told.tangential is None else told.tangential
    falls = paddle.fall if told.fall is None else told.fall
    contact = {
        "restitution": min(max(restitution, 0.17), 0.92),
        "tangential": min(max(tangential * (1.0 + off.tangential * along), -0.5), 0.99),
        "fall": min(falls * (1.0 + off.fall * fall), 0.1),
    }
    ball = {"lift": min(scene.ball.lift * (1.0 + off.lift * lift), 3.0)}
    return scene.model_copy(
        update={
            "contact": told.model_copy(update=contact),
            "ball": scene.ball.model_copy(update=ball),
        }
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Known:
    """What a catcher knows of ball and paddle, better from hit to hit.

    Attributes:
        restitution: Along the normal.
        grip: Along the face, and how much faster balls spin than their flight shows.
        vague: 1-sigma of a spin along the velocity, which no flight shows [rad/s].
    """

    restitution: Restitution
    grip: Grip
    vague: float = 0.0

    def told(self, settings: BattingSettings) -> BattingSettings:
        """Return settings that say so."""
        e, grip = self.restitution.mean, self.grip
        return replace(
            settings,
            impact=replace(settings.impact, restitution=e, loss=grip.loss),
            gain=grip.gain,
        )


def known_of(station: BatStation) -> Known:
    """Return what is known before the first hit: a paddle's data sheet, and how it may be wrong."""
    impact, off, ball = station.batting.settings.impact, station.scene.mismatch, station.scene.ball
    e = impact.restitution
    faster = 1.0 + 2.0 * ball.radius * ball.spin / COMES
    return Known(
        restitution=Restitution(mean=e, sigma=max(off.restitution, 1e-3) * e, fall=impact.fall),
        grip=Grip(
            loss=impact.loss,
            sigma=0.6 * off.tangential / 3.0,
            sigma_gain=0.6 * off.lift * faster,
        ),
        vague=_VAGUE * ball.spin,
    )


def _status(world: World, catcher: Catcher, hit: Hit | None) -> str:
    """Return how a trial has ended."""
    if world.diverged:
        return "aborted"
    if catcher.phase is Phase.STOPPED:
        return "stopped"
    if not np.isfinite(catcher.t_0):
        return "unreachable"
    if hit is None:
        return "missed"
    return "returned" if hit.returned else "wide"


def _sighted(senses: Senses, watcher: Eyes) -> list[Sighting]:
    """Return where the ball was seen: as points, or in images."""
    points = [x for x in senses.points if x.found]
    if senses.frames:
        found = watcher.step(senses.frames)
        points += [found] if found.found else []
    return points


def strike_of(arm: Arm, ticks: Result, met: float) -> tuple[PaddleStrike, Array]:
    """Return a hit as the arm knows it: by its readings, and by the ball that was expected.

    Besides the strike, w of the ball's lift before it [1/s], shape (3,).

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
    ball, drag = ticks.ball[k - 1, :2].copy(), float(ticks.scalars["drag"][k - 1])
    w = np.array([float(ticks.scalars[name][k - 1]) for name in LIFT])
    after = met - float(ticks.scalars["t_ball"][k - 1])
    advance_spinning(ball[0], ball[1], drag, steady_lift(w), after)
    strike = PaddleStrike(
        q=q,
        dq=dq,
        ball=ball,
        normal=arm.orientation(q)[:, 2],
        v_paddle=arm.jacobian(q) @ dq,
        v_out=np.zeros(3),
        T=0.0,
        astray=0.0,
    )
    return strike, w


def learned(
    known: Known,
    hit: tuple[PaddleStrike, Array],
    station: BatStation,
    seen: list[Sighting],
    apart: float,
) -> Known:
    """Return what is known after a hit; nothing new after an odd one.

    Args:
        known: What was known before.
        hit: The hit, of :func:`strike_of`.
        station: Where it was.
        seen: Where the ball was seen about and after it.
        apart: When ball and paddle had parted [s].
    """
    strike, w = hit
    v_out = returned_velocity(seen, apart, station.scene.ball.drag)
    if v_out is None:
        return known
    behind, e = mass_behind(station.arm, strike.q, strike.normal), known.restitution
    told = e.after(strike, behind, station.scene.ball.mass, v_out)
    if abs(told.mean - e.mean) > _SURPRISE * e.sigma:
        return known
    impact = station.batting.settings.impact
    shown = spin_shown(w, strike.ball[1], impact.lift, impact.radius)
    x, y, z = shown.tolist()
    grip = known.grip.after(replace(impact, spin=(x, y, z)), strike, v_out, known.vague)
    return replace(known, restitution=told, grip=grip)


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


def _more(trials: Sequence[BatTrial]) -> dict[str, Any]:
    """Return what the summary of a run says beside counts and rate.

    Landing errors are those of all balls: one that does not land is infinitely far from the
    target, which a result writes as None. A shield has none.
    """
    aimed = not any(t.status == BAT.success and t.landing_m is None for t in trials)
    errors = [inf if t.landing_m is None else t.landing_m for t in trials]
    near = sum(error <= CLOSE for error in errors)
    speeds = [t.return_speed_m_s for t in trials if t.return_speed_m_s is not None]
    return {
        "within_10_cm": near if aimed else None,
        "within_10_cm_rate": near / max(len(trials), 1) if aimed else None,
        "within_10_cm_ci95": list(wilson(near, len(trials))) if aimed else None,
        "median_landing_m": _percentile(errors, 50.0),
        "p90_landing_m": _percentile(errors, 90.0),
        "median_landing_after_20_m": _percentile(errors[20:], 50.0),
        "median_return_speed_m_s": _percentile(speeds, 50.0),
        "limit_violations": sum(t.limit_violations for t in trials),
    }


def _percentile(values: Sequence[float], percent: float) -> float | None:
    """Return the least value that so many of all do not exceed; None where that is infinite."""
    if not values:
        return None
    value = float(np.percentile(values, percent, method="inverted_cdf"))
    return value if isfinite(value) else None


BAT: Final = ScoredTask(
    name="bat",
    schema="mitt.bat-study/1",
    trial=BatTrial,
    trials="trials",
    doing="batting",
    in_result="throws",
    statuses=STATUSES,
    rate="return_rate",
    counted="balls returned",
    measures={
        "landing_cm": Measure("landing error [cm]", "landing_m", 1, factor=100.0),
        "off_middle_mm": Measure("off the paddle's middle [mm]", "off_middle_mm", 1),
        "acceleration": Measure("peak acceleration [rad/s^2]", "peak_acceleration", 0),
        "force_n": Measure("force on the ball [N]", "peak_contact_force_n", 0),
    },
    medians={},
    more=_more,
)
"""The task."""
