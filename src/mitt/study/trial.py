"""One throw from release to verdict: world and catcher, a tick at a time."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import final

import numpy as np

from mitt.catcher import Catcher, CatcherSettings, Phase
from mitt.generator.generators import Generator
from mitt.link.clock import Stopwatch
from mitt.robot.arm import Arm
from mitt.study.log import Logger, TrialLog
from mitt.study.score import HELD_AFTER, Meter, Trial, held, status_of
from mitt.vision.camera import Rig, fixed_rig
from mitt.vision.eyes import Eyes, EyesConfig
from mitt.world.flights import BallPath
from mitt.world.imaging import Imager, ImageSensor
from mitt.world.scene import Scene
from mitt.world.simulation import World
from mitt.world.throws import Throw

#: A trial without contact ends after this time [s], or when the ball is on the floor.
_LONGEST = 2.0


@dataclass(frozen=True, slots=True)
class Outcome:
    """A scored trial, and its log where one was asked for."""

    trial: Trial
    log: TrialLog | None


@final
class Bench:
    """Arm, generator, eyes and world, built once and used for many throws.

    Attributes:
        arm: The arm.
        world: The simulated world.
        stopwatch: Wall-clock time of the catcher's ticks.
    """

    def __init__(
        self, arm: Arm, generator: Generator, scene: Scene, *, pixels: bool = True
    ) -> None:
        """Build the bench.

        Args:
            arm: The arm.
            generator: What turns the ball's estimate into joint motion.
            scene: The world's settings.
            pixels: Whether the catcher sees images; noisy points otherwise.
        """
        self.arm, self._generator, self._scene = arm, generator, scene
        self._rig = fixed_rig()
        cameras = _cameras(self._rig, scene) if pixels else None
        self.world = World(scene, arm.model, cameras=cameras)
        self.stopwatch = Stopwatch()

    def catcher(self) -> Catcher:
        """Return a fresh catcher."""
        ball = self._scene.ball
        eyes = Eyes(self._rig, EyesConfig(ball_radius=ball.radius))
        settings = CatcherSettings(ball_mass=ball.mass, ball_radius=ball.radius)
        return Catcher(self.arm, self._generator, eyes, settings=settings)

    def run(self, index: int, ball: Throw | BallPath, *, seed: int, log: bool = False) -> Outcome:
        """Throw once.

        Args:
            index: Number of the throw, for the result.
            ball: What is thrown.
            seed: Seed of the plant's mismatch and of all noise.
            log: Whether to keep a log.
        """
        world, catcher, meter = self.world, self.catcher(), Meter(self.arm)
        logger = Logger() if log else None
        world.reset(ball, seed)
        t_catch, over = np.inf, False
        while not over:
            senses = world.sense()
            with self.stopwatch:
                command = catcher.step(senses)
            tick = catcher.tick
            if tick is None:
                raise RuntimeError("the catcher left no tick")
            world.apply(command)
            truth = world.truth()
            if tick.reference is not None:
                meter.ask(tick.reference)
                if tick.reference.time_to_catch < 0.0 and np.isinf(t_catch):
                    t_catch = senses.t
            commanded = meter.command(command.q, command.dq, command.tau)
            meter.violations += meter.plant(truth) or commanded
            meter.saturated += tick.tracked.saturated
            if logger is not None:
                logger.add(senses, tick, command)
            over = self._over(truth.ball_on_floor)
        trial = self._score(index, catcher, meter, t_catch)
        kept = None if logger is None else logger.finish(
            world.trace(), t_0=catcher.t_0, t_catch=t_catch)  # fmt: skip
        return Outcome(trial, kept)

    def _over(self, ball_on_floor: bool) -> bool:
        """Say whether the trial is at its end."""
        world, contact = self.world, self.world.first_contact
        if world.diverged:
            return True
        if contact is not None:
            return world.t >= contact.t + HELD_AFTER
        return world.t >= _LONGEST or ball_on_floor

    def _score(self, index: int, catcher: Catcher, meter: Meter, t_catch: float) -> Trial:
        """Score the finished trial."""
        world, verdict = self.world, catcher.verdict
        refused = catcher.tick is not None and catcher.tick.phase is Phase.REFUSED
        contact = world.first_contact
        return Trial(
            index=index,
            status=status_of(
                world,
                refused=refused,
                was_held=held(world.truth(), self._scene.ball.radius),
            ),
            t_catch_s=float(t_catch) if np.isfinite(t_catch) else None,
            position_error_mm=None if contact is None else 1e3 * contact.position_error,
            velocity_error_m_s=None if contact is None else contact.velocity_error,
            peak_torque_ratio=[float(x) for x in meter.torque],
            peak_speed_ratio=[float(x) for x in meter.speed],
            limit_violations=meter.violations,
            demand_cost=meter.cost,
            peak_contact_force_n=None if contact is None else world.peak_force,
            binding_limit="time" if verdict is None else verdict.binding_limit,
            saturated_ticks=meter.saturated,
            range_excess_rad=meter.excess,
        )


def _cameras(rig: Rig, scene: Scene) -> Callable[[np.random.Generator], Imager]:
    """Return what sets up the cameras of a trial."""
    sensor = ImageSensor(brightness=scene.ball.brightness)
    return lambda rng: Imager(rig, sensor, rng)
