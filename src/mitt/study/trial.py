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
from mitt.study.score import HELD_AFTER, Meter, Trial, certificate_of, held, status_of
from mitt.vision.camera import Rig, fixed_rig
from mitt.vision.eyes import Eyes, EyesConfig
from mitt.vision.filter import FilterConfig
from mitt.world.flights import BallPath
from mitt.world.imaging import Imager, ImageSensor
from mitt.world.scene import Scene
from mitt.world.simulation import World
from mitt.world.throws import Throw

#: A trial without contact ends after this time [s], or when the ball is on the floor.
_LONGEST = 2.0
#: Time around the catch in which the map's own time to it is taken for exact [s].
_NEAR_CATCH = 0.006


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
        settings = CatcherSettings(
            ball_mass=ball.mass, ball_radius=ball.radius, flight=known_ball(ball.drag, ball.mass)
        )
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
        logger = Logger(self.arm) if log else None
        world.reset(ball, seed)
        t_catch, over = np.inf, False
        while not over:
            senses = world.sense(look=catcher.looking)
            with self.stopwatch:
                command = catcher.step(senses)
            tick = catcher.tick
            if tick is None:
                raise RuntimeError("the catcher left no tick")
            world.apply(command)
            meter.add(tick.reference, tick.tracked)
            if tick.reference is not None and abs(tick.reference.time_to_catch) < _NEAR_CATCH:
                t_catch = senses.t + tick.reference.time_to_catch
            if logger is not None:
                logger.add(senses, tick, command)
            over = self._over()
        trial = self._score(index, catcher, meter, t_catch)
        kept = None if logger is None else logger.finish(
            world.trace(), t_0=catcher.t_0, t_catch=t_catch)  # fmt: skip
        return Outcome(trial, kept)

    def _over(self) -> bool:
        """Say whether the trial is at its end."""
        world, contact = self.world, self.world.first_contact
        if world.diverged:
            return True
        if contact is not None:
            return world.t >= contact.t + HELD_AFTER
        return world.t >= _LONGEST or world.ball_on_floor

    def _score(self, index: int, catcher: Catcher, meter: Meter, t_catch: float) -> Trial:
        """Score the finished trial."""
        world, verdict, truth = self.world, catcher.verdict, self.world.trace()
        torque, speed = meter.peaks(truth)
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
            peak_torque_ratio=torque,
            peak_speed_ratio=speed,
            limit_violations=meter.violations(truth),
            demand_cost=meter.demand_cost(),
            peak_contact_force_n=None if contact is None else world.peak_force,
            binding_limit="unseen" if verdict is None else verdict.binding_limit,
            saturated_ticks=meter.saturated,
            range_excess_rad=meter.excess(),
            certificate=certificate_of(verdict),
        )


def known_ball(drag: float, mass: float) -> FilterConfig:
    """Return what the filter may believe of a ball with known nominal drag [1/m] and mass [kg].

    A quarter of the drag either way; the acceleration that drag does not explain (spin, gusts)
    grows as the ball gets lighter, 0.001 m^2/s^3 for the thrown ball of 70 g and 0.026 for one of
    table tennis.
    """
    return FilterConfig(
        drag_mean=drag,
        drag_sigma=max(0.25 * drag, 0.005),
        accel_density=0.001 * max(0.07 / mass, 1.0),
    )


def _cameras(rig: Rig, scene: Scene) -> Callable[[np.random.Generator], Imager]:
    """Return what sets up the cameras of a trial."""
    sensor = ImageSensor(brightness=scene.ball.brightness)
    return lambda rng: Imager(rig, sensor, rng)
