"""Throws with random calls in between: command and arm stay clear of everything and in range.

By turns the plant is the exact arm of :mod:`exact_plant`, which feels no impact, and the scene
``lab``: an arm that differs from its model, a ball that strikes it, noise, latency. Balls are aimed
wider than by default. To the exact arm some stand still in the air, or vanish, and between ticks
the catcher is told at random to stop, to recover, to move, to let go, or another takes its place.
Asked of each tick: how near the commanded arm and the arm itself are to themselves and the floor,
and how far either is from the ends of its ranges.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TypeAlias, final

import numpy as np
from exact_plant import FALL, SETTINGS, SIGMA, ExactPlant
from numpy.typing import NDArray

from mitt.core.arm.arm import Arm
from mitt.core.arm.description import STOP_GAP
from mitt.core.arm.shapes import MARGIN, Shapes, Surroundings, clearance, shapes_of
from mitt.core.catcher.catcher import Catcher, Phase
from mitt.core.catcher.generators import Direct
from mitt.core.errors import InputError
from mitt.core.kernels import Record, kernel
from mitt.core.map.mapping import DirectMap
from mitt.core.map.neighbourhood import learn
from mitt.core.signals import TICK, ArmState, Array, Senses, Sighting
from mitt.io.arm_file import load_arm
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.slow_motion import slow_motion
from mitt.lab.trials.source import aim_of, ranges_of
from mitt.lab.world.scene import named_scene
from mitt.lab.world.throws import Throw, default_throw

#: Arms, limit sets and masses of the ball [kg]; an arm's map is learned once.
ROUND: tuple[tuple[str, str | None, float], ...] = (
    ("wam", "paper", 0.034),
    ("wam", "paper", 0.07),
    ("wam", "paper", 0.2),
    ("wam", "paper", 0.5),
    ("wam", "wam-48v", 0.07),
    ("franka-panda", None, 0.07),
    ("ur5e", None, 0.07),
)
Maps: TypeAlias = dict[tuple[str, str | None], tuple[Arm, DirectMap]]
"""Arms and their maps, by name and limit set."""

#: Longest episode [ticks], and share of the episodes in which nothing is called.
_EPISODE = 1200
_QUIET = 0.4
#: Chance of each call in a tick: stop, recover, move, let go, another catcher, another ball.
_CALLS = (0.001, 0.02, 0.003, 0.004, 0.004, 0.002)
#: Share of the balls that stand still in the air, and of those that vanish; when [s].
_FROZEN = 0.25
_GONE = 0.15
_WHEN = (0.2, 0.6)
#: What is rounding [m, rad].
_ROUNDING = 1e-6
#: What is nearer than this to the catch point of the hand was met [m].
_MET = 0.02


@dataclass(frozen=True, slots=True)
class Swing:
    """What a throw came to.

    Attributes:
        arm: Arm, limit set and mass of the ball.
        plant: ``exact`` or ``lab``.
        index: Number of the throw.
        phase: Phase at the end, or status of the trial.
        caught: Whether the ball was met, or caught.
        command, itself: Smallest clearance of the commanded arm and of the arm [m].
        command_end, itself_end: How near they came to the end of a range: of what commands keep to,
            and of the arm's own [rad].
    """

    arm: str
    plant: str
    index: int
    phase: str
    caught: bool
    command: float
    itself: float
    command_end: float
    itself_end: float


@kernel
def _clearances(
    bodies: Record, poses: Array, table: Record, pairs: NDArray[np.int64], ends: Record, out: Array
) -> None:
    """Write the clearance of each pose [m], shape (k,)."""
    for k in range(len(poses)):
        out[k] = clearance(bodies, poses[k], table, pairs, ends)


def nearest(arm: Arm, shapes: Shapes, poses: Array) -> float:
    """Return the smallest clearance along poses [m], shape (k, n)."""
    out, rows = np.zeros(len(poses)), np.ascontiguousarray(poses)
    _clearances(arm.bodies, rows, shapes.table, shapes.pairs, shapes.ends, out)
    return float(out.min())


def left(arm: Arm, poses: Array, gap: float) -> float:
    """Return how near poses come to an end of a range less a gap [rad]; beyond it below zero."""
    return float(np.minimum(poses - arm.q_min - gap, arm.q_max - gap - poses).min())


def wide_throw(arm: Arm, rng: np.random.Generator, drag: float) -> Throw:
    """Return a ball that is aimed wider than by default."""
    ranges = replace(
        ranges_of(arm), azimuth=(-0.35, 0.35), speed=(4.0, 8.0), duration=(0.4, 0.7), drag=drag
    )
    return default_throw(rng, aim_of(arm), ranges)


@final
class Episode:
    """A throw to the exact arm.

    Attributes:
        catcher: The catcher of the moment.
        commands, places: Of each tick, q, dq, ddq, tau, shape (4, n), and where the arm was, (n,).
        gap: Least distance of the ball from the catch point [m].
    """

    def __init__(self, arm: Arm, catcher: Catcher, f: DirectMap, seed: tuple[int, ...]) -> None:
        """Begin at rest."""
        self.catcher, self._arm, self._map = catcher, arm, f
        self._rng = rng = np.random.default_rng(seed)
        self._plant, self._t, self._t_ball = ExactPlant(arm), 0.0, 0.0
        self._ball = wide_throw(arm, rng, 0.0)
        self._quiet = bool(rng.random() < _QUIET)
        self._frozen = rng.uniform(*_WHEN) if rng.random() < _FROZEN else np.inf
        self._gone = rng.uniform(*_WHEN) if rng.random() < _GONE else np.inf
        self.commands, self.places, self.gap = list[Array](), list[Array](), np.inf

    def run(self) -> None:
        """Make all ticks."""
        for _ in range(_EPISODE):
            self._tick()
            if self._quiet and self.catcher.done:
                break
            if not self._quiet:
                self._call()

    def _tick(self) -> None:
        """Make one, and let the arm move."""
        t, since, q = self._t, self._t - self._t_ball, self._plant.state[0].copy()
        s = min(since, self._frozen)
        r_o = self._ball.r + s * self._ball.dr + 0.5 * s * s * FALL
        points: tuple[Sighting, ...] = ()
        if since < self._gone:
            seen = r_o + SIGMA * self._rng.standard_normal(3)
            points = (Sighting(t=t, found=True, r_o=seen, covariance=SIGMA**2 * np.eye(3)),)
        self.gap = min(self.gap, float(np.linalg.norm(self._arm.position(q) - r_o)))
        reading = ArmState(t=t, q=q, dq=self._plant.state[1].copy())
        command = self.catcher.step(Senses(t=t, arm=reading, points=points))
        self.commands.append(command.joints.copy())
        self.places.append(q)
        self.catcher.think()
        self._plant.move(command, TICK)
        self._t += TICK

    def _call(self) -> None:
        """Call something now and then; what is refused is refused."""
        rng, c = self._rng, self.catcher
        stop, recover, move, let_go, again, ball = rng.random(6) < _CALLS
        try:
            if stop:
                c.stop()
            if recover and c.phase is Phase.STOPPED:
                c.recover()
            if move and c.phase is not Phase.FOLLOW:
                c.move(slow_motion(self._arm, c.state.last[0].copy(), self._goal(), 0.5))
            if let_go and c.phase is Phase.BRAKE:
                c.let_go()
            if again and c.done:
                self.catcher = c.again(Direct(self._map))
                self.catcher.take_over(self.commands[-1][3], self._t - TICK)
        except InputError:
            pass
        if ball:
            self._ball, self._t_ball = wide_throw(self._arm, rng, 0.0), self._t
            self._frozen = self._gone = np.inf

    def _goal(self) -> Array:
        """Return where a move is to lead [rad], (n,)."""
        low, high, rng = self._arm.q_min + 0.1, self._arm.q_max - 0.1, self._rng
        goal: Array = rng.uniform(low, high) if rng.random() < 0.5 else self._arm.q_ready
        return goal


def soak(
    throws: int,
    *,
    seed: int,
    maps: Maps,
    chosen: tuple[tuple[str, str | None, float], ...] = ROUND,
) -> Iterator[Swing]:
    """Throw so many balls to the chosen arms in turn, every other time in the lab.

    Args:
        throws: How many in all.
        seed: Seed of everything.
        maps: Arms and maps that were learned by now; those that are not are learned and added.
        chosen: Arms, limit sets and masses.
    """
    ready: dict[int, tuple[Arm, DirectMap, Catcher, TrialRunner, Shapes]] = {}
    for k in range(throws):
        which, plant = k % len(chosen), ("exact", "lab")[k // len(chosen) % 2]
        name, limits, mass = chosen[which]
        if which not in ready:
            if (name, limits) not in maps:
                arm = load_arm(name) if limits is None else load_arm(name, limits=limits)
                maps[name, limits] = arm, learn(arm).map
            arm, f = maps[name, limits]
            first = Catcher(arm, f, settings=replace(SETTINGS, ball_mass=mass))
            lab = named_scene("lab")
            scene = lab.model_copy(update={"ball": lab.ball.model_copy(update={"mass": mass})})
            runner = TrialRunner(arm, Direct(f), scene, pixels=False)
            ready[which] = arm, f, first, runner, shapes_of(arm, Surroundings())
        arm, f, first, runner, shapes = ready[which]
        if plant == "exact":
            episode = Episode(arm, first.again(Direct(f)), f, (seed, k))
            episode.run()
            commands, places = np.array(episode.commands)[:, 0], np.array(episode.places)
            phase, met = episode.catcher.phase.value, episode.gap < _MET
        else:
            rng = np.random.default_rng((seed, k))
            made = runner.run(k, wide_throw(arm, rng, 0.12), seed=k, log=True)
            assert made.log is not None
            commands, places = made.log.command[:, 0], made.log.truth.q
            phase = made.trial.status
            met = phase == "caught"
        yield Swing(
            ":".join(str(x) for x in chosen[which]),
            plant,
            k,
            phase,
            met,
            nearest(arm, shapes, commands),
            nearest(arm, shapes, places),
            left(arm, commands, STOP_GAP),
            left(arm, places, 0.0),
        )


def table(swings: list[Swing]) -> list[str]:
    """Return what came nearest, a line for each arm and plant."""
    lines = []
    for key in sorted({(x.arm, x.plant) for x in swings}):
        of = [x for x in swings if (x.arm, x.plant) == key]
        found = []
        for name, values in (
            ("command", [x.command for x in of]),
            ("arm", [x.itself for x in of]),
            ("end, command", [x.command_end for x in of]),
            ("end, arm", [x.itself_end for x in of]),
        ):
            k = int(np.argmin(values))
            found.append(f"{name} {1e3 * values[k]:.2f} (throw {of[k].index})")
        bad, astray = (len(x) for x in faults(of))
        met, ends = sum(x.caught for x in of), dict(Counter(x.phase for x in of))
        lines.append(
            f"{' '.join(key)}: {len(of)} throws, {met} met; mm, mrad: {', '.join(found)};"
            f" broken by the command in {bad}, by the arm in {astray}; {ends}"
        )
    return lines


def faults(swings: list[Swing]) -> tuple[list[str], list[str]]:
    """Return the throws in which a command, and those in which the arm, was too near or beyond."""
    commands = [x for x in swings if x.command < MARGIN - _ROUNDING or x.command_end < -_ROUNDING]
    arms = [x for x in swings if x.itself < MARGIN - _ROUNDING or x.itself_end < 0.0]
    return [f"command: {x}" for x in commands], [f"arm: {x}" for x in arms]
