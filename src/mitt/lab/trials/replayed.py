"""A recording through the catcher once more: the same version commands the same to the bit.

The senses are those of the recording, so the arm does what it did then. With another map or other
settings the first difference is where the other choice would have acted differently; what it
commands after that is for an arm that went on as recorded.

Without images a replay begins behind the eyes: the filter is given the positions that they found.
Where the heads then look is not told again, and not compared.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import final

import numpy as np

from mitt.core import checks
from mitt.core.ball.filter import update
from mitt.core.catcher.catcher import Catcher
from mitt.core.catcher.family import Family
from mitt.core.catcher.generators import Direct, Generator, refining
from mitt.core.catcher.settings import CatcherSettings
from mitt.core.catcher.state import Result, copied, gathered, room_for
from mitt.core.control.health import StoppedBy
from mitt.core.errors import FileError, InputError, MittError
from mitt.core.eyes.eyes import Eyes
from mitt.core.signals import ArmState, Array, Command, Senses
from mitt.core.verdict.feasibility import Verdict
from mitt.io.about import About
from mitt.io.maps import read_map
from mitt.io.messages import torques_in
from mitt.io.reading import read_toml
from mitt.io.recordings import Recorded
from mitt.io.schema import from_plain, merged, to_plain
from mitt.lab.trials.registry import make_generator


@dataclass(frozen=True, slots=True)
class Judged:
    """A verdict, and the time at which it was given [s]."""

    t: float
    verdict: Verdict


@final
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Replayed:
    """What came of a replay, k ticks of n joints.

    Attributes:
        recorded: The recording.
        about: What made the catcher.
        ticks: What each tick brought about.
        differs: Whether a tick commanded something else than in the recording, shape (k,).
        verdicts: Verdicts on the throw, each where it changed.
        stopped_by: Why the catcher stopped; None where it did not.
        t_0: Time at which the arm began to move [s]; infinite if it did not.
    """

    recorded: Recorded
    about: About
    ticks: Result
    differs: Array
    verdicts: tuple[Judged, ...]
    stopped_by: StoppedBy | None
    t_0: float

    @property
    def first_difference(self) -> int | None:
        """Number of the first tick that commanded something else; None where none did."""
        found = np.flatnonzero(self.differs)
        return int(self.recorded.numbers[found[0]]) if len(found) else None

    @property
    def identical(self) -> bool:
        """Whether all commands are those of the recording to the bit, and no tick is missing."""
        numbers = self.recorded.numbers
        all_there = self.recorded.dropped == 0 and np.array_equal(numbers, np.arange(len(numbers)))
        return self.first_difference is None and bool(all_there)

    @property
    def begins(self) -> str:
        """Where the replay began: at the ``images``, behind the ``eyes``, or with ``points``."""
        if self.recorded.has_images:
            return "images"
        return "points" if np.any(self.recorded.ticks["points"]) else "eyes"


def recorded_generator(about: About) -> Generator:
    """Return the generator of a recording.

    Raises:
        InputError: It knew what no recording holds, or is not installed.
    """
    if about.made_of is not None:
        return about.made_of.afresh()
    name, f = about.generator, about.maps[0]
    if about.refines:  # one map; also of when that was called direct
        return refining(f)
    if name == "direct":
        return Family(tuple(Direct(x) for x in about.maps))
    if name == "clairvoyant":
        raise InputError("a replay", "a generator that knows what its catcher was told", name)
    return make_generator(name, f)


def catcher_of(about: About) -> Catcher:
    """Return the catcher of a recording as it was before the throw."""
    eyes = Eyes(about.rig, about.eyes)
    return Catcher(about.driven_arm, recorded_generator(about), eyes, settings=about.settings)


def changed(
    about: About,
    *,
    map_file: Path | None = None,
    settings: Path | None = None,
    generator: str | None = None,
) -> About:
    """Return what makes a catcher, with another choice.

    Args:
        about: Of a recording.
        map_file: Another map for the same arm.
        settings: TOML with keys of :class:`mitt.core.catcher.settings.CatcherSettings`.
        generator: Another generator, made from the first map.
    """
    if not about.maps and (map_file is not None or generator is not None):
        raise InputError("a replay of meeting or batting", "no other map or generator", "one")
    if map_file is not None:
        about = replace(about, maps=(read_map(map_file, about.arm).map,))
    if generator is not None:
        about = replace(about, generator=generator, refines=False)
    if settings is not None:
        given = read_toml(settings, wanted="TOML of catcher settings")
        try:
            raw = merged(to_plain(about.settings), given)
            new = from_plain(CatcherSettings, raw, place=str(settings))
        except InputError as error:
            raise FileError(str(settings), "settings of a catcher", error) from None
        about = replace(about, settings=new)
    return about


def replay(recorded: Recorded, about: About | None = None) -> Replayed:
    """Drive a catcher with the senses of a recording: its own one, or another.

    Raises:
        FileError: The recording holds what no catcher was ever given.
    """
    checks.instance("recorded", recorded, Recorded)
    run = _Run(recorded, about or recorded.about)
    try:
        return run.played()
    except MittError as error:
        raise FileError(str(recorded.path), "senses that a catcher takes", error) from None


class _Run:
    """One replay under way."""

    def __init__(self, recorded: Recorded, about: About) -> None:
        self.recorded, self.about = recorded, about
        self.fresh = catcher_of(about)
        self.catcher = self.fresh
        self.verdicts: list[Judged] = []
        self.stopped_by: StoppedBy | None = None
        self.t_0 = np.inf

    def played(self) -> Replayed:
        """Make all ticks."""
        rows, images = self.recorded.ticks, self.recorded.has_images
        results, differs = list[Result](), np.zeros(len(rows), bool)
        gaze = images and len(self.about.rig.heads) > 0
        for k, senses in enumerate(self._senses()):
            command = self.catcher.step(senses)
            differs[k] = _differs(command, rows[k], gaze=gaze)
            results.append(copied(self.catcher.result))
            self.catcher.think()
            self._note(senses.t)
        return Replayed(
            recorded=self.recorded,
            about=self.about,
            ticks=gathered(results) if results else room_for(self.catcher.result, 0),
            differs=differs,
            verdicts=tuple(self.verdicts),
            stopped_by=self.stopped_by,
            t_0=self.t_0,
        )

    def _senses(self) -> Iterator[Senses]:
        """Yield what each tick took; what else the catcher was told comes before."""
        recorded, rows = self.recorded, self.recorded.ticks
        for row, number in zip(rows, recorded.numbers.tolist(), strict=True):
            for name in recorded.calls.get(number, ()):
                self._call(name)
            frames = recorded.frames(number)
            own = min(int(row["frames"]), len(frames))
            if ground := frames[: len(frames) - own]:
                self.catcher.learn_background([ground])
            if not recorded.has_images:
                self._see(row)
            t, q, dq = float(row["t"]), row["q"].copy(), row["dq"].copy()
            arm = ArmState(t=float(row["t_arm"]), q=q, dq=dq)
            yield Senses(
                t=t,
                arm=arm,
                frames=frames[len(frames) - own :],
                points=recorded.points(number),
                belt=recorded.belt(number),
            )

    def _see(self, row: np.void) -> None:
        """Give the filter what the eyes found in the images of a tick."""
        self.catcher.think()
        s, seen = self.catcher.state, row["sighting"].reshape(4, 3)
        s.z[:], s.R[:] = seen[0], seen[1:]
        if row["out_sighted"] and self.catcher.flying:
            at = float(row["out_t_sighted"])
            update(s.ball_filter, at, s.z, s.R)

    def _call(self, name: str) -> None:
        """Tell the catcher what it was told."""
        if name == "stop":
            self.catcher.stop()
        elif name in ("recover", "recover checked"):
            self.catcher.think()
            self.catcher.recover(checked=name == "recover checked")
        elif name == "again":
            self.catcher = self.fresh.again(recorded_generator(self.about))
        elif (torques := torques_in(name, self.about.arm.n)) is not None and not self.catcher.begun:
            self.catcher.take_over(torques)

    def _note(self, t: float) -> None:
        """Keep the verdict where it has changed, and why the catcher stopped."""
        verdict = self.catcher.verdict if not self.verdicts or self.catcher.flying else None
        if verdict is not None and (not self.verdicts or verdict != self.verdicts[-1].verdict):
            self.verdicts.append(Judged(t, verdict))
        self.stopped_by = self.stopped_by or self.catcher.stopped_by
        self.t_0 = min(self.t_0, self.catcher.t_0)


def _differs(command: Command, row: np.void, *, gaze: bool) -> bool:
    """Say whether a command is not that of the recording, bit by bit."""
    same = (
        command.joints.tobytes() == row["command"].tobytes()
        and np.float64(command.hand).tobytes() == row["hand"].tobytes()
        and command.brakes == bool(row["brakes"])
    )
    if same and gaze and command.gaze is not None:
        same = command.gaze.tobytes() == row["gaze"].tobytes()
    return not same
