"""One throw from release to verdict: world and catcher, a tick at a time."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import final

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.catcher.catch_notes import catch_of
from mitt.core.catcher.catcher import Catcher, CatcherSettings
from mitt.core.catcher.family import Family
from mitt.core.catcher.generators import Direct, Generator
from mitt.core.catcher.state import Result
from mitt.core.errors import InputError
from mitt.core.eyes.camera import Rig, fixed_rig
from mitt.core.eyes.clock_offset import CatchSeen
from mitt.core.eyes.eyes import Eyes
from mitt.core.eyes.head import active_rig
from mitt.core.map.mapping import DirectMap
from mitt.core.signals import ArmState, Senses, Sighting
from mitt.io.about import About
from mitt.lab.rivals.clairvoyant import Clairvoyant
from mitt.lab.trials.catcher_settings import catcher_settings, driven, eyes_settings, rig_in
from mitt.lab.trials.log import TrialLog, announced_catch_time
from mitt.lab.trials.play import play_out
from mitt.lab.trials.score import (
    HELD_AFTER,
    Trial,
    certificate_of,
    measure,
    stop_as_json,
    trial_status,
    was_held,
)
from mitt.lab.trials.source import Source
from mitt.lab.trials.task_runner import TaskRunner
from mitt.lab.world.calibration_errors import drawn_rig, error_root
from mitt.lab.world.faults import true_rig
from mitt.lab.world.flights import BallPath
from mitt.lab.world.imaging import Imager, sensor_of
from mitt.lab.world.overlap import check_scene
from mitt.lab.world.scene import Scene
from mitt.lab.world.simulation import World
from mitt.lab.world.throws import Throw

#: A trial without contact ends after this time [s], or when the ball is on the floor.
LONGEST = 2.0


@dataclass(frozen=True, slots=True)
class LoggedTrial:
    """A scored trial, and its log where one was asked for."""

    trial: Trial
    log: TrialLog | None


@final
class TrialRunner(TaskRunner[Trial]):
    """Throws at an arm: generator, eyes and world, built once and used for many.

    Attributes:
        rig: The cameras.
        caught: What arm and eyes said of the catch in the last trial; None where none was tried.
    """

    def __init__(
        self,
        arm: Arm,
        generator: Generator,
        scene: Scene,
        *,
        pixels: bool = True,
        source: Source | None = None,
    ) -> None:
        """Build the runner; without ``pixels`` the catcher sees noisy points.

        Raises:
            InputError: The arm stands or waits in the floor, or in what stands around it.
        """
        check_scene(arm, scene)
        self._generator, self._scene, self._pixels = generator, scene, pixels
        rig = active_rig() if scene.sensing.cameras == "active" else fixed_rig()
        self.rig = rig_in(rig, scene)
        cameras = cameras_of(self.rig, scene) if pixels else None
        super().__init__(arm, World(scene, arm.model, cameras=cameras, limits=arm.limits))
        self.keeps_images = False
        self._source = source
        self.caught: CatchSeen | None = None
        self._first = self.made(generator)

    def draw(self, index: int) -> tuple[Throw | BallPath, int]:
        """Return a ball of the source, and the seed of its throw."""
        if self._source is None:
            raise InputError("source", "what is thrown", "none")
        return self._source.ball(index), self._source.trial_seed(index)

    def generator(self) -> Generator:
        """Return the generator; the clairvoyant is given the flight of the ball just released."""
        generator = self._generator
        if isinstance(generator, Clairvoyant):
            return generator.with_flight(self.world.flight)
        return generator

    def made(self, generator: Generator) -> Catcher:
        """Return the catcher that those of all throws begin as."""
        eyes = Eyes(self.rig, eyes_settings(self._scene))
        return Catcher(driven(self.arm, self._scene), generator, eyes, settings=self._settings())

    def over(self, catcher: Catcher) -> bool:  # noqa: ARG002
        """Say whether the ball was held for long enough, or can be touched no more."""
        return self.world.over(longest=LONGEST, held=HELD_AFTER)

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
        catcher = self.release(ball, seed=seed)
        self.keeps, self.keeps_images = log, images
        self.play(catcher)
        trial = self.score(index, catcher)
        return LoggedTrial(trial, self.log() if log else None)

    def throw(
        self, source: Source, index: int, *, log: bool = False, images: bool = False
    ) -> LoggedTrial:
        """Throw one ball of a source; thrown again, it gives the same trial."""
        ball, seed = source.ball(index), source.trial_seed(index)
        return self.run(index, ball, seed=seed, log=log, images=images)

    def play(self, catcher: Catcher) -> None:
        """Play a throw to its end, compiled where that is possible and no images are kept."""
        stage, points = self.world.stage, list[Sighting]()
        if stage is not None and catcher.parts is not None and not self.keeps_images:
            rules = {"longest": LONGEST, "held": HELD_AFTER}
            ticks = play_out(stage, catcher, self.stopwatch, **rules, offset=self.clock_offset)
            self._ticks, self._t_0 = ticks, catcher.t_0
            self.caught = _caught(catcher, ticks, ())
            if self.keeps and not self._pixels:
                self.senses += _with_points(ticks)
            return
        while not self.over(catcher):
            points += self.tick(catcher).points
        self.caught = _caught(catcher, self.gather(catcher), points)

    def score(self, index: int, catcher: Catcher) -> Trial:
        """Score the finished trial."""
        world, verdict = self.world, catcher.verdict
        found = measure(self.arm, self.ticks, world.trace())
        t_catch = announced_catch_time(self.ticks)
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
