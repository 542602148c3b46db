"""One throw from release to verdict: world and catcher, a tick at a time."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import pi, sqrt
from typing import final

import numpy as np

from mitt.catcher import Catcher, CatcherSettings
from mitt.control.encoders import Encoders
from mitt.control.envelope import TICK
from mitt.generator.generators import Generator
from mitt.link.clock import Stopwatch
from mitt.records import Record
from mitt.rivals.clairvoyant import Clairvoyant
from mitt.robot.arm import Arm
from mitt.robot.shapes import Surroundings
from mitt.trials.ending import play_out
from mitt.trials.log import TrialLog, log_of
from mitt.trials.play import Player
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
from mitt.vision.camera import Rig, fixed_rig
from mitt.vision.eyes import Eyes, EyesConfig
from mitt.vision.filter import FilterConfig
from mitt.vision.head import active_rig
from mitt.vision.triangulation import TriangulatorConfig
from mitt.world.calibration import drawn_rig, error_root
from mitt.world.faults.cameras import true_rig
from mitt.world.flights import BallPath
from mitt.world.imaging import Imager, ImageSensor
from mitt.world.materials import friction_of, restitution_of
from mitt.world.scene import Actuation, Scene
from mitt.world.sensors import encoder_steps
from mitt.world.simulation import World
from mitt.world.throws import Throw

#: A trial without contact ends after this time [s], or when the ball is on the floor.
LONGEST = 2.0
#: Share of each torque limit that is not commanded to drives that lag behind their commands: the
#: WAM's command stays within its limits as the motors see them (a choice of this project).
RESERVE = 0.02
#: Looks at the scene before a throw from which the catcher learns its background.
LOOKS = 10
#: Restitution of a soft contact, without a material: 0.18 was measured at 5 m/s.
_SOFT = 0.2
#: Share of a corner's error in the calibration that its result leaves in the images.
_UNCALIBRATED = 0.25
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
        cameras = _cameras(self._rig, scene) if pixels else None
        self.world = World(scene, arm.model, cameras=cameras, limits=arm.limits)
        self.stopwatch = Stopwatch()
        self._player = Player(self.stopwatch, longest=LONGEST, held=HELD_AFTER)
        self._catcher = self._made()

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
            torque_lead=lead_of(self._scene.actuation),
        )
        return Catcher(driven(self.arm, self._scene), self._generator, eyes, settings=settings)

    def catcher(self) -> Catcher:
        """Return a fresh catcher; one that may is told the flight of the ball just released."""
        generator = self._generator
        if isinstance(generator, Clairvoyant):
            generator = generator.told(self.world.flight)
        return self._catcher.again(generator)

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
        world = self.world
        world.reset(ball, seed)
        catcher, stage = self.catcher(), world.stage
        if views := world.views_before(LOOKS):
            catcher.learn_background(views)
        if stage is None or catcher.parts is None:
            ticks = self._step(catcher)
        else:
            ticks = self._player.run(stage, catcher)
        truth = world.trace()
        found, t_catch = measure(self.arm, ticks, truth), catch_time(ticks)
        trial = self._score(index, catcher, found, t_catch)
        kept = (
            log_of(self.arm, ticks.copy(), truth, t_0=catcher.t_0, t_catch=t_catch) if log else None
        )
        return LoggedTrial(trial, kept)

    def _step(self, catcher: Catcher) -> Record:
        """Make a trial through Python, tick by tick, and return the results of all ticks.

        As soon as the catcher does not look any more, the rest is one compiled loop.
        """
        world, rows = self.world, []
        while not world.over(longest=LONGEST, held=HELD_AFTER):
            if not catcher.looking and (ending := world.ending) is not None:
                rules = LONGEST, HELD_AFTER
                rows.append(play_out(ending, catcher, self.stopwatch, rules=rules).tobytes())
                continue
            senses = world.sense(look=catcher.looking)
            with self.stopwatch:
                command = catcher.step(senses)
            if catcher.stopped_by is not None:
                world.watch_on()
            world.apply(command)
            catcher.think()
            rows.append(catcher.result.tobytes())
        return np.frombuffer(bytearray().join(rows), catcher.result.dtype)

    def _score(self, index: int, catcher: Catcher, found: Measured, t_catch: float) -> Trial:
        """Score the finished trial."""
        world, verdict = self.world, catcher.verdict
        contact = world.first_contact
        return Trial(
            index=index,
            status=status_of(
                world,
                catcher.phase,
                was_held=held(world.truth(), world.radius),
            ),
            t_catch_s=float(t_catch) if np.isfinite(t_catch) else None,
            position_error_mm=None if contact is None else 1e3 * contact.position_error,
            velocity_error_m_s=None if contact is None else contact.velocity_error,
            peak_torque_ratio=found.peak_torque_ratio,
            peak_speed_ratio=found.peak_speed_ratio,
            limit_violations=found.limit_violations,
            demand_cost=found.demand_cost,
            peak_contact_force_n=None if contact is None else world.peak_force,
            binding_limit="unseen" if verdict is None else verdict.binding_limit,
            saturated_ticks=found.saturated_ticks,
            range_excess_rad=found.range_excess_rad,
            rms_torque_ratio=found.rms_torque_ratio,
            certificate=certificate_of(verdict),
            certificate_last=certificate_of(catcher.certificate),
            stopped_by=stop_as_json(catcher.stopped_by),
        )


def catch_time(ticks: Record) -> float:
    """Return the time of the catch by the map [s]; infinite without one.

    It is what the map itself announces, the last time it was near.
    """
    left = ticks["time_to_catch"]
    near = np.flatnonzero(np.abs(left) < _NEAR_CATCH)
    return float(ticks["t"][near[-1]] + left[near[-1]]) if len(near) else np.inf


def _patience(generator: Generator) -> float:
    """Return how far the arm may stray [rad]: alpha = 0 is shown as it is, never stopped."""
    f = generator.as_map()
    plain = f is not None and not np.any(f.alpha)
    return np.inf if plain else CatcherSettings().stray


def known_eyes(scene: Scene) -> EyesConfig:
    """Return what the catcher knows of its cameras: a calibration leaves errors in the images.

    A quarter of a corner's error, 0.05 px for corners found to within 0.2 px, is a choice of this
    project.
    """
    sensing, exact = scene.sensing, TriangulatorConfig()
    left = _UNCALIBRATED * sensing.corner_noise if sensing.views > 0 else 0.0
    floor = float(np.hypot(exact.sigma_floor, left))
    return EyesConfig(
        ball_radius=scene.ball.radius, triangulator=TriangulatorConfig(sigma_floor=floor)
    )


def known_encoders(scene: Scene, arm: Arm) -> Encoders:
    """Return what the catcher knows of the encoders: a scene's resolution, or else the arm's."""
    steps = encoder_steps(scene, arm.model)
    return Encoders(step=tuple(np.where(steps > 0.0, steps, arm.encoder_step).tolist()))


def driven(arm: Arm, scene: Scene) -> Arm:
    """Return an arm as its catcher may drive it: with torque in reserve where drives lag.

    A torque that was within the limit of one state acts in another, a millisecond later; and which
    state it is, counts of an encoder do not say exactly.
    """
    if scene.actuation == Actuation() and scene.sensing.encoder_step == 0.0:
        return arm
    limits, left = arm.limits, 1.0 - RESERVE
    weaker = replace(limits, tau_peak=left * limits.tau_peak, tau_stall=left * limits.tau_stall)
    return Arm(arm.model, weaker)


def lead_of(actuation: Actuation) -> float:
    """Return from when joints are read until the torque commanded then ceases to act [s].

    A tick, the delay of the command, and the time constant of the drives.
    """
    rate = 2.0 * pi * actuation.bandwidth
    return TICK * (1.0 + actuation.delay) + (1.0 / rate if rate > 0.0 else 0.0)


def known_ball(drag: float, mass: float, *, spread: float = 0.0) -> FilterConfig:
    """Return what the filter may believe of a ball with known nominal drag [1/m] and mass [kg].

    A quarter of the drag either way, or what a uniform error up to ``spread`` makes. What drag does
    not explain grows as the ball gets lighter: white acceleration (gusts) of 1e-4 m^2/s^3 for the
    thrown ball of 70 g and 0.0026 for one of table tennis, a lasting push (spin) of 0.04 and
    1 m/s^2.
    """
    lightness = max(0.07 / mass, 1.0)
    return FilterConfig(
        drag_mean=drag,
        drag_sigma=max(max(0.25, spread / sqrt(3.0)) * drag, 0.005),
        drag_density=1e-6,
        accel_density=1e-4 * lightness,
        push_sigma=0.04 * lightness,
    )


def _cameras(rig: Rig, scene: Scene) -> Callable[[np.random.Generator], Imager]:
    """Return what sets up the cameras of a trial."""
    sensing = scene.sensing
    sensor = ImageSensor(
        brightness=scene.ball.brightness,
        texture=sensing.texture,
        body=sensing.body,
        exposure=sensing.exposure,
        hand=sensing.hand,
        shading=sensing.shading,
        grain=sensing.grain,
        pattern=sensing.pattern,
        light=sensing.light,
        shadow=sensing.shadow,
        blur=sensing.blur,
    )
    calibrated = sensing.views > 0 and not rig.heads
    k = sensing.distortion
    root = error_root(rig, sensing.views, sensing.corner_noise, k) if calibrated else None

    def made(rng: np.random.Generator) -> Imager:
        true = true_rig(rig if root is None else drawn_rig(rig, root, rng), scene.faults, rng)
        return Imager(
            true, sensor, rng, second=sensing.second, second_velocity=sensing.second_velocity
        )

    return made
