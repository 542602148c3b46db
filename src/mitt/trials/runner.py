"""One throw from release to verdict: world and catcher, a tick at a time."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import final

import numpy as np

from mitt.arm.arm import Arm
from mitt.catcher.catch_notes import catch_of
from mitt.catcher.catcher import Catcher, CatcherSettings
from mitt.catcher.family import Family
from mitt.catcher.generators import Direct, Generator
from mitt.catcher.state import Result, copied, gathered, room_for
from mitt.clock import Stopwatch
from mitt.eyes.camera import Rig, fixed_rig
from mitt.eyes.clock_offset import CatchSeen
from mitt.eyes.eyes import Eyes
from mitt.eyes.head import active_rig
from mitt.files.about import About
from mitt.map.mapping import DirectMap
from mitt.rivals.clairvoyant import Clairvoyant
from mitt.signals import ArmState, Frame, Senses, Sighting
from mitt.trials.catcher_settings import catcher_settings, driven, eyes_settings
from mitt.trials.log import TrialLog, announced_catch_time, log_of
from mitt.trials.play import play_out
from mitt.trials.score import (
    HELD_AFTER,
    Measured,
    Trial,
    certificate_of,
    measure,
    stop_as_json,
    trial_status,
    was_held,
)
from mitt.trials.source import Source
from mitt.world.calibration_errors import drawn_rig, error_root
from mitt.world.faults import true_rig
from mitt.world.flights import BallPath
from mitt.world.imaging import Imager, sensor_of
from mitt.world.overlap import check_scene
from mitt.world.scene import Scene
from mitt.world.simulation import World
from mitt.world.throws import Throw

#: A trial without contact ends after this time [s], or when the ball is on the floor.
LONGEST = 2.0
#: Looks at the scene before a throw from which the catcher learns its background.
LOOKS = 10


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
        rig: The cameras.
        views: Looks at the scene before the last throw, from which its background was learned.
        clock_offset: What is added to the stamps of what the eyes see [s].
        caught: What arm and eyes said of the catch in the last trial; None where none was tried.
    """

    def __init__(
        self, arm: Arm, generator: Generator, scene: Scene, *, pixels: bool = True
    ) -> None:
        """Build the runner; without ``pixels`` the catcher sees noisy points.

        Raises:
            InputError: The arm stands or waits in the floor, or in what stands around it.
        """
        check_scene(arm, scene)
        self.arm, self._generator, self._scene, self._pixels = arm, generator, scene, pixels
        self.rig = active_rig() if scene.sensing.cameras == "active" else fixed_rig()
        cameras = cameras_of(self.rig, scene) if pixels else None
        self.world = World(scene, arm.model, cameras=cameras, limits=arm.limits)
        self.stopwatch, self.clock_offset = Stopwatch(), 0.0
        self.caught: CatchSeen | None = None
        self._catcher, self.views = self._made(), list[tuple[Frame, ...]]()
        self.ticks = room_for(self._catcher.result, 0)

    def _made(self) -> Catcher:
        """Return the catcher that those of all throws begin as."""
        eyes = Eyes(self.rig, eyes_settings(self._scene))
        return Catcher(
            driven(self.arm, self._scene), self._generator, eyes, settings=self._settings()
        )

    def about(self, generator: str, f: DirectMap) -> About:
        """Return what makes the catcher again: its generator by name, made from a map."""
        limits, used = driven(self.arm, self._scene).limits, self._generator
        maps = tuple(x.map for x in used.maps) if isinstance(used, Family) else (f,)
        return About(
            arm=f.arm,
            generator=generator,
            maps=maps,
            settings=self._settings(),
            rig=self.rig,
            eyes=eyes_settings(self._scene),
            driven=None if limits is f.arm.limits else limits,
            refines=isinstance(used, Direct) and used.refines,
        )

    def _settings(self) -> CatcherSettings:
        """Return the settings of the catcher: what it is told of the scene."""
        most = _max_tracking_error(self._generator)
        return replace(catcher_settings(self.arm, self._scene), max_tracking_error=most)

    def catcher(self) -> Catcher:
        """Return a fresh catcher; the clairvoyant is given the flight of the ball just released."""
        generator = self._generator
        if isinstance(generator, Clairvoyant):
            generator = generator.with_flight(self.world.flight)
        return self._catcher.again(generator)

    def release(self, ball: Throw | BallPath, *, seed: int) -> Catcher:
        """Begin a trial and return its catcher, which has looked at the scene before."""
        self.world.reset(ball, seed)
        catcher = self.catcher()
        self.views = self.world.views_before(LOOKS)
        if self.views:
            catcher.learn_background(self.views)
        return catcher

    def step(self, catcher: Catcher) -> Senses:
        """Make one tick through Python: sense, step, apply, think; return what was sensed."""
        world = self.world
        senses = _shifted(world.sense(look=catcher.looking), self.clock_offset)
        with self.stopwatch:
            command = catcher.step(senses)
        if catcher.stopped_by is not None:
            world.watch_on()
        world.apply(command)
        catcher.think()
        return senses

    def run(
        self,
        index: int,
        ball: Throw | BallPath,
        *,
        seed: int,
        log: bool = False,
        images: bool = False,
    ) -> LoggedTrial:
        """Throw once.

        Args:
            index: Number of the throw, for the result.
            ball: What is thrown.
            seed: Seed of the plant's mismatch and of all noise.
            log: Whether to keep a log.
            images: Whether the log keeps all images, 33 kB a tick; that takes the slower loop.
        """
        catcher, senses = self.release(ball, seed=seed), list[Senses]()
        self.ticks = ticks = self._play(catcher, senses if log else None, images=images)
        truth = self.world.trace()
        trial = self._score(
            index, catcher, measure(self.arm, ticks, truth), announced_catch_time(ticks)
        )
        if not log:
            return LoggedTrial(trial, None)
        ground = tuple(frame for view in self.views for frame in view) if images else ()
        kept = log_of(
            self.arm,
            ticks,
            truth,
            t_0=catcher.t_0,
            senses=tuple(senses),
            background=ground,
            clock_offset=self.clock_offset,
        )
        return LoggedTrial(trial, kept)

    def throw(
        self, source: Source, index: int, *, log: bool = False, images: bool = False
    ) -> LoggedTrial:
        """Throw one ball of a source; thrown again, it gives the same trial."""
        ball, seed = source.ball(index), source.trial_seed(index)
        return self.run(index, ball, seed=seed, log=log, images=images)

    def _play(self, catcher: Catcher, senses: list[Senses] | None, *, images: bool) -> Result:
        """Play a trial to its end, compiled where that is possible; return all ticks' results."""
        rules = {"longest": LONGEST, "held": HELD_AFTER}
        offset = self.clock_offset
        stage, rows, points = self.world.stage, list[Result](), list[Sighting]()
        if stage is not None and catcher.parts is not None and not images:
            ticks = play_out(stage, catcher, self.stopwatch, **rules, offset=offset)
            self.caught = _caught(catcher, ticks, ())
            if senses is not None and not self._pixels:
                senses += _with_points(ticks)
            return ticks
        while not self.world.over(**rules):
            taken = self.step(catcher)
            points += taken.points
            if senses is not None:
                senses.append(taken if images else replace(taken, frames=()))
            rows.append(copied(catcher.result))
        ticks = gathered(rows) if rows else room_for(catcher.result, 0)
        self.caught = _caught(catcher, ticks, points)
        return ticks

    def _score(self, index: int, catcher: Catcher, found: Measured, t_catch: float) -> Trial:
        """Score the finished trial."""
        world, verdict = self.world, catcher.verdict
        contact, most = world.first_contact, self.arm.force
        known = contact is not None and np.isfinite(most)
        return Trial(
            index=index,
            status=trial_status(
                world, catcher.phase, refused=catcher.refused, was_held=was_held(self.arm, world)
            ),
            t_catch_s=float(t_catch) if np.isfinite(t_catch) else None,
            position_error_mm=None if contact is None else 1e3 * contact.position_error,
            velocity_error_m_s=None if contact is None else contact.velocity_error,
            peak_contact_force_n=None if contact is None else world.peak_force,
            over_force=world.peak_load > most if known else None,
            binding_limit="unseen" if verdict is None else verdict.binding_limit,
            certificate=certificate_of(verdict),
            certificate_last=certificate_of(catcher.certificate),
            stopped_by=stop_as_json(catcher.stopped_by),
            **asdict(found),
        )


def _caught(catcher: Catcher, ticks: Result, points: Sequence[Sighting]) -> CatchSeen | None:
    """Return what arm and eyes said of a catch; None where the arm never braked for one."""
    s = ticks.scalars
    if not np.isfinite(catcher.state.scalars[0]["t_rest"]):
        return None
    seen = s["sighted"]
    found = s["t_sighted"][seen], ticks.sighting[seen, 0], ticks.sighting[seen, 1:]
    if given := [p for p in points if p.found]:
        found = (
            np.array([p.t for p in given]),
            np.array([p.r_o for p in given]),
            np.array([p.covariance for p in given]),
        )
    return catch_of(catcher.state, s["t"], ticks.encoders[:, 0], found)


def _shifted(senses: Senses, by: float) -> Senses:
    """Return senses with other stamps of what is seen, by a time [s]."""
    if by == 0.0:
        return senses
    frames = tuple(replace(x, t=x.t + by) for x in senses.frames)
    points = tuple(replace(x, t=x.t + by) for x in senses.points)
    return replace(senses, frames=frames, points=points)


def _with_points(ticks: Result) -> list[Senses]:
    """Return what the ticks of a compiled loop took, where they were given points."""
    s, rows = ticks.scalars, zip(ticks.scalars, ticks.encoders, ticks.sighting, strict=True)
    out = []
    for one, (q, dq), seen in rows:
        t, at = one["t"].item(), one["t_sighted"].item()
        point = Sighting(t=at, found=True, r_o=seen[0].copy(), covariance=seen[1:].copy())
        points = (point,) if one["sighted"] else ()
        out.append(Senses(t=t, arm=ArmState(t=t, q=q, dq=dq), points=points))
    s["sighted"], ticks.sighting[:] = False, 0.0
    return out


def _max_tracking_error(generator: Generator) -> float:
    """Return the largest tracking error [rad]; alpha = 0 is shown as it is, never stopped."""
    f = generator.as_map()
    plain = f is not None and not np.any(f.alpha)
    return np.inf if plain else CatcherSettings().max_tracking_error


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
