"""One throw from release to verdict: world and catcher, a tick at a time."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import final

import numpy as np

from mitt.baselines.clairvoyant import Clairvoyant
from mitt.catcher.catcher import Catcher, CatcherSettings
from mitt.catcher.result import Result, copied, gathered, room_for
from mitt.generator.generators import Generator
from mitt.link.clock import Stopwatch
from mitt.robot.arm import Arm
from mitt.robot.shapes import Surroundings
from mitt.signals import Senses
from mitt.trials.known import driven, known_ball, known_encoders, known_eyes, torque_lead_of
from mitt.trials.log import TrialLog, log_of
from mitt.trials.play import play_out
from mitt.trials.score import (
    HELD_AFTER,
    Measured,
    Trial,
    certificate_of,
    held,
    measure,
    status_of,
    stop_as_json,
)
from mitt.trials.source import Source
from mitt.vision.camera import Rig, fixed_rig
from mitt.vision.eyes import Eyes
from mitt.vision.head import active_rig
from mitt.world.calibration import drawn_rig, error_root
from mitt.world.faults.senses import true_rig
from mitt.world.flights import BallPath
from mitt.world.imaging import Imager, sensor_of
from mitt.world.materials import friction_of, restitution_of
from mitt.world.scene import Scene
from mitt.world.simulation import World
from mitt.world.throws import Throw

#: A trial without contact ends after this time [s], or when the ball is on the floor.
LONGEST = 2.0
#: Looks at the scene before a throw from which the catcher learns its background.
LOOKS = 10
#: Restitution of a soft contact, without a material: 0.18 was measured at 5 m/s.
_SOFT = 0.2
#: Time around the catch in which the map's own time to it is taken for exact [s].
_NEAR_CATCH = 0.006


@dataclass(frozen=True, slots=True)
class LoggedTrial:
    """A scored trial, and its log where one was asked for."""

    trial: Trial
    log: TrialLog | None


@final
class TrialRunner:
    """Arm, generator, eyes and world, built once and used for many throws.

    Attributes:
        arm: The arm.
        world: The simulated world.
        stopwatch: Wall-clock time of the catcher's ticks.
        ticks: Results of all ticks of the last trial.
    """

    def __init__(
        self, arm: Arm, generator: Generator, scene: Scene, *, pixels: bool = True
    ) -> None:
        """Build the runner.

        Args:
            arm: The arm.
            generator: What turns the ball's estimate into joint motion.
            scene: The world's settings.
            pixels: Whether the catcher sees images; noisy points otherwise.
        """
        self.arm, self._generator, self._scene = arm, generator, scene
        self._rig = active_rig() if scene.sensing.cameras == "active" else fixed_rig()
        cameras = cameras_of(self._rig, scene) if pixels else None
        self.world = World(scene, arm.model, cameras=cameras, limits=arm.limits)
        self.stopwatch = Stopwatch()
        self._catcher = self._made()
        self.ticks = room_for(self._catcher.result, 0)

    def _made(self) -> Catcher:
        """Return the catcher that those of all throws begin as."""
        ball = self._scene.ball
        eyes = Eyes(self._rig, known_eyes(self._scene))
        settings = CatcherSettings(
            ball_mass=ball.mass,
            ball_radius=ball.radius,
            ball_restitution=restitution_of(self._scene) or _SOFT,
            ball_friction=friction_of(self._scene),
            flight=known_ball(ball.drag, ball.mass, spread=self._scene.mismatch.drag),
            around=Surroundings(floor=self._scene.floor),
            encoders=known_encoders(self._scene, self.arm),
            stray=_patience(self._generator),
            torque_lead=torque_lead_of(self._scene.actuation),
        )
        return Catcher(driven(self.arm, self._scene), self._generator, eyes, settings=settings)

    def catcher(self) -> Catcher:
        """Return a fresh catcher; one that may is told the flight of the ball just released."""
        generator = self._generator
        if isinstance(generator, Clairvoyant):
            generator = generator.told(self.world.flight)
        return self._catcher.again(generator)

    def release(self, ball: Throw | BallPath, *, seed: int) -> Catcher:
        """Begin a trial and return its catcher, which has looked at the scene before.

        Args:
            ball: What is thrown.
            seed: Seed of the plant's mismatch and of all noise.
        """
        self.world.reset(ball, seed)
        catcher = self.catcher()
        if views := self.world.views_before(LOOKS):
            catcher.learn_background(views)
        return catcher

    def step(self, catcher: Catcher) -> Senses:
        """Make one tick through Python: sense, step, apply, think; return what was sensed."""
        world = self.world
        senses = world.sense(look=catcher.looking)
        with self.stopwatch:
            command = catcher.step(senses)
        if catcher.stopped_by is not None:
            world.watch_on()
        world.apply(command)
        catcher.think()
        return senses

    def run(
        self, index: int, ball: Throw | BallPath, *, seed: int, log: bool = False
    ) -> LoggedTrial:
        """Throw once.

        Args:
            index: Number of the throw, for the result.
            ball: What is thrown.
            seed: Seed of the plant's mismatch and of all noise.
            log: Whether to keep a log.
        """
        catcher = self.release(ball, seed=seed)
        self.ticks = ticks = self._play(catcher)
        truth, t_catch = self.world.trace(), catch_time(ticks)
        trial = self._score(index, catcher, measure(self.arm, ticks, truth), t_catch)
        kept = log_of(self.arm, ticks, truth, t_0=catcher.t_0, t_catch=t_catch) if log else None
        return LoggedTrial(trial, kept)

    def throw(self, source: Source, index: int, *, log: bool = False) -> LoggedTrial:
        """Throw one ball of a source; thrown again, it gives the same trial."""
        return self.run(index, source.ball(index), seed=source.trial_seed(index), log=log)

    def _play(self, catcher: Catcher) -> Result:
        """Play a trial to its end, compiled where that is possible; return all ticks' results."""
        rules = {"longest": LONGEST, "held": HELD_AFTER}
        stage, rows = self.world.stage, list[Result]()
        if stage is not None and catcher.parts is not None:
            return play_out(stage, catcher, self.stopwatch, **rules)
        while not self.world.over(**rules):
            self.step(catcher)
            rows.append(copied(catcher.result))
        return gathered(rows) if rows else room_for(catcher.result, 0)

    def _score(self, index: int, catcher: Catcher, found: Measured, t_catch: float) -> Trial:
        """Score the finished trial."""
        world, verdict = self.world, catcher.verdict
        contact, was_held = world.first_contact, held(world.truth(), world.radius)
        return Trial(
            index=index,
            status=status_of(world, catcher.phase, was_held=was_held),
            t_catch_s=float(t_catch) if np.isfinite(t_catch) else None,
            position_error_mm=None if contact is None else 1e3 * contact.position_error,
            velocity_error_m_s=None if contact is None else contact.velocity_error,
            peak_contact_force_n=None if contact is None else world.peak_force,
            binding_limit="unseen" if verdict is None else verdict.binding_limit,
            certificate=certificate_of(verdict),
            certificate_last=certificate_of(catcher.certificate),
            stopped_by=stop_as_json(catcher.stopped_by),
            **asdict(found),
        )


def catch_time(ticks: Result) -> float:
    """Return the time of the catch by the map [s]; infinite without one.

    It is what the map itself announces, the last time it was near.
    """
    left = ticks.scalars["time_to_catch"]
    near = np.flatnonzero(np.abs(left) < _NEAR_CATCH)
    return float(ticks.scalars["t"][near[-1]] + left[near[-1]]) if len(near) else np.inf


def _patience(generator: Generator) -> float:
    """Return how far the arm may stray [rad]: alpha = 0 is shown as it is, never stopped."""
    f = generator.as_map()
    plain = f is not None and not np.any(f.alpha)
    return np.inf if plain else CatcherSettings().stray


def cameras_of(rig: Rig, scene: Scene) -> Callable[[np.random.Generator], Imager]:
    """Return what sets up the cameras of a trial."""
    sensing, sensor = scene.sensing, sensor_of(scene)
    calibrated = sensing.views > 0 and not rig.heads
    k = sensing.distortion
    root = error_root(rig, sensing.views, sensing.corner_noise, k) if calibrated else None

    def made(rng: np.random.Generator) -> Imager:
        true = true_rig(rig if root is None else drawn_rig(rig, root, rng), scene.faults, rng)
        return Imager(
            true, sensor, rng, second=sensing.second, second_velocity=sensing.second_velocity
        )

    return made
