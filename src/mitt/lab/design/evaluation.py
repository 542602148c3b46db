"""What a candidate is worth: on paper, learned, and thrown at.

Each step costs more than the one before and is given fewer candidates: whether typical flights are
in the domain of l_c^-1 and the arm can hold its poses (milliseconds), how many thrown balls the
catcher would promise to catch with a learned map (tenths of a second), and how many it catches in
the simulated world (hundredths of a second a throw).

| verdicts    | meaning                                                       | unit  | shape |
|-------------|---------------------------------------------------------------|-------|-------|
| ``share``   | share of the limit that binds; up to 1 the arm can follow     | 1     | (B,)  |
| ``speed``   | relative speed of ball and catch point at the catch           | m/s   | (B,)  |
| ``angle``   | between the way the ball comes in and the palm's normal       | rad   | (B,)  |
| ``place``   | where hand and ball meet                                      | m     | (B, 3) |
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.arm.catch import CaughtBall
from mitt.core.arm.shapes import Surroundings, clearance, shapes_of
from mitt.core.ball.flight import advance
from mitt.core.catcher.generators import Direct
from mitt.core.catcher.settings import CatcherSettings
from mitt.core.errors import MittError
from mitt.core.map.demand import uniform
from mitt.core.map.learn import LearnSettings, lift_flight
from mitt.core.map.mapping import DirectMap, unlearned
from mitt.core.map.neighbourhood import FASTEST_SHARE, Neighbourhood, learn
from mitt.core.signals import Array, BallState, MapStatus
from mitt.core.verdict.feasibility import Approach, Verdict, judge
from mitt.core.verdict.impact import examined, relative_velocity, speed_caps
from mitt.core.verdict.pieces import Pieces
from mitt.lab.design.candidate import Candidate
from mitt.lab.design.poses import touching
from mitt.lab.design.task import DesignTask
from mitt.lab.trials.catcher_settings import catcher_settings, driven
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.score import Trial, reason_of
from mitt.lab.world.flights import CATCH_FRACTION, PlacedFlight
from mitt.lab.world.throws import Throw

#: Time after its release at which the arm starts [s]; of a recorded ball, time before it passes the
#: catch point.
START = 0.05
_BEFORE = 0.4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Verdicts:
    """Verdicts on a set of balls; see the module's table.

    Attributes:
        share: Infinite where the ball does not come to the map's region; so are ``speed``,
            ``angle`` and ``place``, also where the map asks for no motion that an arm could make.
        speed: With joints no faster than limits, impact and brake allow.
        angle: Of that relative velocity, off the palm's normal.
        place: The catch point where the map brings it.
        binding: Name of the limit that binds, ball by ball.
    """

    share: Array
    speed: Array
    angle: Array
    place: Array
    binding: tuple[str, ...]

    def joined(self, other: "Verdicts") -> "Verdicts":
        """Return these and those on other balls."""
        return Verdicts(
            share=np.concatenate([self.share, other.share]),
            speed=np.concatenate([self.speed, other.speed]),
            angle=np.concatenate([self.angle, other.angle]),
            place=np.concatenate([self.place, other.place]),
            binding=self.binding + other.binding,
        )

    @property
    def binds(self) -> str:
        """The limit that binds most often."""
        return Counter(self.binding).most_common(1)[0][0]


def balls_of(f: DirectMap, task: DesignTask, *, count: int, seed: int) -> list[BallState]:
    """Return balls of a task as they are when the arm starts.

    So many are drawn with a seed; a user's balls come once each.
    """
    source = task.source(f, throws=count, seed=seed)
    own = len(source.throws or source.recordings)
    drag = task.scene.ball.drag
    return [_started(source.ball(k), drag) for k in range(min(count, own or count))]


def _started(ball: Throw | PlacedFlight, drag: float) -> BallState:
    """Return a ball as it is when the arm starts.

    A recorded one may bounce: it comes as it would without a bounce to where it is to be caught.
    """
    if isinstance(ball, Throw):
        r, dr, since = ball.r, ball.dr, START
    else:
        (r, dr), since = ball.at(ball.after(CATCH_FRACTION)), -_BEFORE
    r, dr = r.copy(), dr.copy()
    advance(r, dr, drag, since)
    return BallState(t=0.0, r_o=r, dr_o=dr, drag=drag)


def verdicts(
    f: DirectMap, balls: Sequence[BallState], driven: Arm, settings: CatcherSettings
) -> Verdicts:
    """Return the verdicts on balls, the arm at rest in its ready pose.

    They are as when the arm starts, which is ``driven`` as the catcher drives it. From all of a
    limit on the arm's answer is worked out tick by tick: a map that keeps the limits is to be told
    from one that the arm can only just follow.
    """
    q, caught = f.arm.q_ready, settings.caught
    strict = uniform(1.0)
    said, ends = list[Verdict](), list[_End]()
    for ball in balls:
        verdict, pieces = judge(f, ball, q, tolerance=strict), Pieces()
        bandwidth = settings.bandwidth
        said.append(examined(driven, verdict, caught, bandwidth=bandwidth, pieces=pieces))
        ends.append(_end(driven, verdict.approach, caught, pieces))
    return Verdicts(
        share=np.array([v.share for v in said]),
        speed=np.array([end.speed for end in ends]),
        angle=np.array([end.angle for end in ends]),
        place=np.array([end.place for end in ends]).reshape(-1, 3),
        binding=tuple(v.binding_limit for v in said),
    )


class _End(NamedTuple):
    """How a ball is met; see :class:`Verdicts`."""

    speed: float
    angle: float
    place: Array


def _end(arm: Arm, approach: Approach | None, ball: CaughtBall, pieces: Pieces) -> _End:
    """Return how a ball is met; ``pieces`` are those that are known of the approach.

    A map may ask for more speed than the joints have; the hand is then a little late, and the ball
    meets it faster than the map asks for.
    """
    if approach is None or not _possible(arm, approach.motion):
        return _End(np.inf, np.inf, np.full(3, np.inf))
    q = approach.motion[-1, 0]
    relative = relative_velocity(arm, approach, speed_caps(arm, approach, ball, pieces))
    speed = float(np.linalg.norm(relative))
    normal = arm.orientation(q)[:, 2]
    cosine = float(np.clip(-relative @ normal / max(speed, 1e-9), -1.0, 1.0))
    return _End(speed, float(np.arccos(cosine)), arm.position(q))


def _possible(arm: Arm, motion: Array) -> bool:
    """Say whether a motion is finite and ends in the joints' ranges, so that it can be braked."""
    q = motion[-1, 0]
    return bool(np.all(np.isfinite(motion)) and np.all((q >= arm.q_min) & (q <= arm.q_max)))


BEYOND = "beyond a limit"
"""Why a ball does not count that was caught, in :attr:`Evaluation.binding`."""
FORCE = "force"
"""And where it pressed harder than hand and arm take."""


def cause_of(trials: list[Trial]) -> str:
    """Return why balls most often were not caught within every limit; nothing where all were."""
    causes = [x for x in map(_cause, trials) if x]
    return max(sorted(set(causes)), key=causes.count) if causes else ""


def _cause(trial: Trial) -> str:
    """Return why a ball was not caught within every limit; nothing where it was.

    The limit that the verdict names is the cause only where the throw was refused for it.
    """
    match trial.status:
        case "caught":
            return BEYOND if trial.limit_violations else FORCE if trial.over_force else ""
        case "unreachable":
            return trial.binding_limit or trial.status
        case "stopped":
            why = reason_of(trial.stopped_by)
            return f"stopped: {why}" if why else trial.status
        case _:
            return trial.status


class _Paper(NamedTuple):
    """What a candidate may ask for before it has a map; choices of this project."""

    holding: float = 0.85  # share of each torque to hold a pose
    speeding: float = 2.5  # share of each torque to speed up to the catch
    rise: float = 0.25  # time in which the hand reaches its speed there [s]
    speed: float = 1.6  # share of a joint's speed at the catch
    speed_weighed: float = FASTEST_SHARE  # the same where learning weighs the match
    same: float = 1e-3  # largest difference of one pose from itself by l_c^-1 [rad]
    gap: float = 0.012  # of own shapes and floor in ready pose and at the catch [m]
    poses: int = 4  # looked at from ready pose to catch, both included


class _Discount(NamedTuple):
    """From where on a ball counts less in what is judged, and how fast."""

    share: float = 0.95  # of a limit
    steep: float = 5.0  # a ball counts 1 / (1 + steep excess)
    angle: float = float(np.deg2rad(25.0))  # off the palm's normal [rad]
    aslant: float = 0.3  # the same beyond that angle [1/rad]
    slow: float = 1.0  # relative speed up to which the angle does not matter [m/s]
    # One from the side or behind touches the fingers before it is in the hand. Of 200 throws at one
    # design 8 of 9 beyond 95 degrees were lost, none below.
    side: float = float(np.deg2rad(80.0))  # off the normal [rad]
    behind: float = 10.0  # the same beyond that angle [1/rad]


_PAPER = _Paper()
_DISCOUNT = _Discount()
#: Seed and number of the balls that candidates are judged by, and the share of them from which a
#: candidate may be among the best: half of those that geometry finds are below it.
_JUDGE_SEED = 32
_JUDGED = 30
_HOPELESS = 0.2
#: Flights on which a candidate is tried on paper: a few show whether balls come to where it can
#: meet them.
_ON_PAPER = Neighbourhood(flights=6, instants=7, kicked=0.0, bounced=0.0)
#: From which flights a map is learned, and in how many steps. What is best on maps learned from 30
#: flights need not be with 120: of one design 98 and 86 % were caught.
_LEARNING = {
    "glance": (Neighbourhood(flights=16, instants=9), LearnSettings(steps=3, tolerance=0.05)),
    "quick": (Neighbourhood(flights=30, instants=12), LearnSettings(steps=5, tolerance=0.02)),
    "many": (Neighbourhood(instants=12), LearnSettings(steps=5, tolerance=0.02)),
    "full": (Neighbourhood(), LearnSettings()),
}
#: Share of the throws that has to be caught, within every limit, for an arm to count as one that
#: can catch them.
ENOUGH = 0.8
#: What a ball counts that is caught beyond a limit, while candidates are compared.
_BEYOND = 0.7


How = Literal["paper", "glance", "quick", "many", "full"]
"""How thoroughly a map is learned; on paper not at all."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Evaluation:
    """What is known of a candidate; of throws nothing where none were made.

    Attributes:
        candidate: The candidate.
        able: About how many of the balls its learned map catches, as a share.
        speed: Median relative speed of hand and ball [m/s]: by the verdicts, or of throws.
        thrown: Number of throws.
        caught: Those caught.
        clean: Those caught without a tick beyond a limit, and with no more force than hand and arm
            take.
        hard: Those caught with more force than that.
        force: Median of their largest contact forces [N].
        binding: Why balls most often were not caught within every limit; nothing where all were.
        failed: Why it was not thrown at: ``no pose``, ``no map``, ``error`` or ``lost``.
        said: What the error said, or what :func:`hindrance` says where there is no pose.
    """

    candidate: Candidate
    able: float
    speed: float
    thrown: int = 0
    caught: int = 0
    clean: int = 0
    hard: int = 0
    force: float = 0.0
    binding: str = ""
    failed: str = ""
    said: str = ""

    @property
    def enough(self) -> bool:
        """Whether it catches enough of the throws, each without a tick beyond a limit."""
        return self.thrown > 0 and self.clean >= ENOUGH * self.thrown

    @property
    def share(self) -> float:
        """Share caught, or about to be caught by verdicts where nothing was thrown.

        A ball caught beyond a limit counts in part: where one of acceleration, jerk or torque rate
        is exceeded in every throw, the others are still to be told apart.
        """
        within = _BEYOND * self.caught + (1.0 - _BEYOND) * self.clean
        return within / self.thrown if self.thrown else self.able

    @property
    def within(self) -> float:
        """Share caught without a tick beyond a limit; 0 where nothing was thrown."""
        return self.clean / self.thrown if self.thrown else 0.0

    def with_more(self, other: "Evaluation") -> "Evaluation":
        """Return it with further throws at the same candidate; medians are averaged."""
        caught = self.caught + other.caught
        mine = 0.5 if caught == 0 else self.caught / caught
        return replace(
            self,
            thrown=self.thrown + other.thrown,
            caught=caught,
            clean=self.clean + other.clean,
            hard=self.hard + other.hard,
            speed=mine * self.speed + (1.0 - mine) * other.speed,
            force=mine * self.force + (1.0 - mine) * other.force,
        )

    def __str__(self) -> str:
        """Say in a few words what it catches, as ``12 of 12 caught, 1.2 m/s, 140 N``."""
        how = f", {self.speed:.1f} m/s, {self.force:.0f} N" if self.caught else ""
        return f"{self.clean} of {self.thrown} caught{how}"

    @property
    def hardness(self) -> float:
        """Relative speed [m/s]; 200 N of force count as 1 m/s."""
        return self.speed + self.force / 200.0

    def score(self, price: float) -> float:
        """Return the share caught, less what a hard catch costs; larger is better.

        ``price`` is that of 1 m/s of :attr:`hardness`, in shares of throws.
        """
        return self.share - price * self.hardness


def hindrance(whole: Arm, c: Candidate, task: DesignTask) -> str:
    """Return what keeps a candidate from its poses, or typical flights from its domain, on paper.

    As limits are named: ``hold:J`` and ``torque:J`` where the drive of a joint is too weak to hold
    the arm, or to speed up to the catch, ``speed:J``, ``range``, ``clearance``, ``domain``; nothing
    where nothing does.
    """
    try:
        arm = c.arm(whole, task.arrivals)
        start = unlearned(arm, c.design)
        flights = task.flights(start, np.random.default_rng(_JUDGE_SEED), _ON_PAPER)
    except MittError:
        return "domain"
    if len(flights) < _ON_PAPER.flights:
        return "domain"
    why = _unheld(arm, c, task.scene.floor)
    if why:
        return why
    if touching(arm, task.scene, _to_catch(c)):
        return "clearance"
    inside = [x for x in (lift_flight(start, flight) for flight in flights) if x is not None]
    if not _on_branch(arm, start, c) or len(inside) < 4:
        return "domain"
    most = _PAPER.speed_weighed if c.match_weight > 0.0 else _PAPER.speed
    beyond = [x for x in (_asks_much(arm, x.virtual[-1], most) for x in inside) if x]
    return Counter(beyond).most_common(1)[0][0] if len(inside) - len(beyond) < 3 else ""


def _to_catch(c: Candidate) -> Array:
    """Return poses of the active joints from the ready pose to the catch [rad], shape (k, n)."""
    share = np.linspace(0.0, 1.0, _PAPER.poses)[:, None]
    return np.asarray((1.0 - share) * c.q_ready + share * c.q_catch)


def _on_branch(arm: Arm, start: DirectMap, c: Candidate) -> bool:
    """Say whether l_c^-1 of the nominal catch point is the pose that the candidate means."""
    status, q_o = start.to_joints(arm.position(c.q_catch))
    return status is MapStatus.INSIDE and bool(np.abs(q_o - c.q_catch).max() < _PAPER.same)


def _unheld(arm: Arm, c: Candidate, floor: float) -> str:
    """Return why the arm cannot rest in its ready pose and at the catch, clear of itself."""
    still, ready = np.zeros(arm.n), c.q_ready
    shapes = shapes_of(arm, Surroundings(floor=floor))
    for q in (ready, c.q_catch):
        share = arm.limits.torque_ratio(arm.torque(q, still, still), np.zeros(len(arm.bodies)))
        if float(share.max()) > _PAPER.holding:
            return f"hold:{arm.model.links[int(share.argmax())].name}"
        if clearance(arm.bodies, q, shapes.table, shapes.pairs, shapes.ends) < _PAPER.gap:
            return "clearance"
    return "" if np.all((ready > arm.q_min) & (ready < arm.q_max)) else "range"


def _asks_much(arm: Arm, virtual: Array, most: float) -> str:
    """Return what keeps the arm from about reaching the joint speeds of l_c^-1 at a catch.

    ``virtual`` has the rows q_o, dq_o, ddq_o there; ``most`` is a share of a joint's speed.
    """
    q, dq = virtual[0], virtual[1]
    tau = arm.torque(q, np.zeros(arm.n), dq / _PAPER.rise)
    share, fast = arm.limits.torque_ratio(tau, np.zeros(len(arm.bodies))), np.abs(dq / arm.dq_max)
    if float(share.max()) > _PAPER.speeding:
        return f"torque:{arm.model.links[int(share.argmax())].name}"
    return f"speed:{arm.names[int(fast.argmax())]}" if fast.max() > most else ""


def learned_map(whole: Arm, c: Candidate, task: DesignTask, how: How = "quick") -> DirectMap | None:
    """Return a candidate's learned map; None where it has none.

    In full it is the one that ``mitt catch`` learns.
    """
    usual, steps = _LEARNING[how]
    around = task.around(usual)
    try:
        arm = c.arm(whole, task.arrivals)
        found = learn(arm, design=c.design, around=around, settings=steps)
    except (MittError, np.linalg.LinAlgError):
        return None
    return found.map if found.flights >= around.flights // 2 else None


def judged(c: Candidate, f: DirectMap, task: DesignTask) -> Evaluation:
    """Return what a learned map is worth by the catcher's verdicts on balls that are thrown at it.

    They are balls of the task, as throws are: drawn flights would leave out those that a map cannot
    meet, and so judge a map by what suits it. A third of them suffices where it meets few of these.
    """
    balls = balls_of(f, task, count=_JUDGED, seed=_JUDGE_SEED)
    arm, settings = driven(f.arm, task.scene), catcher_settings(f.arm, task.scene)
    said = verdicts(f, balls[: _JUDGED // 3], arm, settings)
    if _able(said) >= _HOPELESS:
        said = said.joined(verdicts(f, balls[_JUDGED // 3 :], arm, settings))
    return Evaluation(candidate=c, able=_able(said), speed=_middle(said.speed), binding=said.binds)


def _able(said: Verdicts) -> float:
    """Return about how many of the balls are caught: the farther beyond a limit, the less.

    It falls smoothly, so that of two candidates that are both beyond a limit the nearer one is
    seen.
    """
    beyond = np.maximum(said.share - _DISCOUNT.share, 0.0)
    aslant = np.where(
        said.speed <= _DISCOUNT.slow, 0.0, np.maximum(said.angle - _DISCOUNT.angle, 0.0)
    )
    behind = np.maximum(said.angle - _DISCOUNT.side, 0.0)
    within = (
        (1.0 + _DISCOUNT.steep * beyond)
        * (1.0 + _DISCOUNT.aslant * aslant)
        * (1.0 + _DISCOUNT.behind * behind)
    )
    return float(np.mean(1.0 / within))


def _middle(x: Array) -> float:
    """Return the median of what is finite; 99 where nothing is."""
    known = x[np.isfinite(x)]
    return float(np.median(known)) if len(known) else 99.0


def thrown(
    c: Candidate,
    f: DirectMap,
    task: DesignTask,
    *,
    throws: int,
    seed: int,
    give_up: bool = True,
    images: bool = False,
) -> Evaluation:
    """Return what a learned map is worth in the simulated world; see :func:`trials_of`."""
    trials = trials_of(f, task, throws=throws, seed=seed, give_up=give_up, images=images)
    throws = len(trials)
    good = [x for x in trials if x.status == "caught"]
    speeds = np.array([x.velocity_error_m_s for x in good], dtype=np.float64)
    forces = np.array([x.peak_contact_force_n for x in good], dtype=np.float64)
    return Evaluation(
        candidate=c,
        able=len(good) / throws,
        speed=_middle(speeds) if good else 9.0,
        thrown=throws,
        caught=len(good),
        clean=sum(x.limit_violations == 0 and not x.over_force for x in good),
        hard=sum(x.over_force is True for x in good),
        force=_middle(forces) if good else 999.0,
        binding=cause_of(trials),
    )


def trials_of(
    f: DirectMap,
    task: DesignTask,
    *,
    throws: int,
    seed: int,
    give_up: bool = False,
    images: bool = False,
) -> list[Trial]:
    """Return scored throws at a map: default throws at its arm's aim, or those of the task.

    Where ``give_up``, a third of them suffices where less than 70 % of these are caught. The ball
    is seen in ``images``, as ``mitt catch`` does, or as points, which take less time.
    """
    source = task.source(f, throws=throws, seed=seed)
    runner = TrialRunner(f.arm, Direct(f), task.scene, pixels=images)
    first = throws // 3 if give_up else throws
    trials = [runner.throw(source, k).trial for k in range(first)]
    if sum(trial.status == "caught" for trial in trials) < 0.7 * first:
        return trials
    return trials + [runner.throw(source, k).trial for k in range(first, throws)]
