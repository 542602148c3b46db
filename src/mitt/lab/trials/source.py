"""Where the balls of a run come from: drawn by seed, read as throws, or recorded."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import final

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.map.map_design import catch_place, nominal_catch
from mitt.core.signals import Array
from mitt.io.arm_file import ThrowSettings
from mitt.lab.world.flights import (
    CATCH_FRACTION,
    BallPath,
    PlacedFlight,
    RecordedFlight,
    place_flight,
    read_flights,
)
from mitt.lab.world.throws import (
    Aim,
    Spinning,
    Throw,
    ThrowRanges,
    default_throw,
    read_throws,
)

#: Streams drawn from one seed and index, so that no use of one disturbs another.
_BALL = 0
_TRIAL = 1
#: Half-widths of the box of joint angles that is aimed at, first and second joint [rad].
_HALF = (0.3, 0.22)
#: Height of the WAM's aim above its shoulder [m]: l(q) of the centre of that box.
_AIM_HEIGHT = 0.0566


def aim_of(arm: Arm) -> Aim:
    """Return where default throws are aimed: q1 +-0.3, q2 pi/4 +-0.22, q4 = q_alpha for the WAM.

    The ready pose gives the centre of the box, so other arms have theirs (docs/throws.md). An arm
    whose description says where it wants the balls has a box in space instead.
    """
    if arm.model.aim is not None:
        return _box(arm.model.aim)
    middle, half = nominal_catch(arm), np.zeros(arm.n)
    half[: len(_HALF)] = _HALF
    return Aim(position=arm.position, q_low=middle - half, q_high=middle + half)


def _box(aim: Array) -> Aim:
    """Return a box in space to aim at: centre and half-widths [m], shape (2, 3)."""
    return Aim(position=np.copy, q_low=aim[0] - aim[1], q_high=aim[0] + aim[1])


def ranges_of(arm: Arm) -> ThrowRanges:
    """Return the ranges of an arm's default throws: released as high above its aim as the WAM's."""
    usual = ThrowRanges()
    if arm.model.aim is None:
        return usual
    raised = float(arm.model.aim[0, 2]) - _AIM_HEIGHT
    return replace(usual, height=(usual.height[0] + raised, usual.height[1] + raised))


@final
@dataclass(frozen=True, kw_only=True)
class Source:
    """Balls of a run, each a pure function of seed and index.

    Attributes:
        seed: Seed of the run.
        count: Number of trials.
        aim: Where default throws are aimed.
        catch_point: Where recorded flights are led past [m], shape (3,).
        throws: Throws from a file, empty otherwise.
        recordings: Recorded flights, empty otherwise.
        drag: Drag of the balls [1/m]: default throws are aimed with it, and recorded balls have
            it after their last sample.
        ranges: Ranges of the default throws; the contract's if left out.
        spinning: How default throws spin, and the lift by which the spin of recorded flights is
            fitted; none spins if left out.
        shares: Of each recorded flight, the share of its time since the release after which it
            passes the catch point; the usual one if empty.
    """

    seed: int
    count: int
    aim: Aim
    catch_point: Array
    throws: tuple[Throw, ...] = ()
    recordings: tuple[RecordedFlight, ...] = ()
    drag: float = 0.12
    ranges: ThrowRanges | None = None
    spinning: Spinning | None = None
    shares: tuple[float, ...] = ()

    def ball(self, index: int) -> Throw | PlacedFlight:
        """Return what is thrown in a trial."""
        rng = np.random.default_rng([self.seed, index, _BALL])
        if self.recordings:
            k = index % len(self.recordings)
            share = self.shares[k] if self.shares else CATCH_FRACTION
            return place_flight(
                self.recordings[k],
                self.catch_point,
                rng=rng,
                drag=self.drag,
                share=share,
                spinning=self.spinning,
            )
        if self.throws:
            return self.throws[index % len(self.throws)]
        return self.drawn(rng)

    def drawn(self, rng: np.random.Generator) -> Throw:
        """Return a default throw that is drawn."""
        ranges = replace(self.ranges or ThrowRanges(), drag=self.drag)
        return default_throw(rng, self.aim, ranges, spinning=self.spinning)

    def trial_seed(self, index: int) -> int:
        """Return the seed of a trial's plant and noise."""
        state = np.random.SeedSequence([self.seed, index, _TRIAL]).generate_state(1, np.uint64)
        return int(state[0])

    def name(self, index: int) -> str:
        """Return what the ball of a trial is called."""
        if self.recordings:
            return self.recordings[index % len(self.recordings)].name
        return f"row {index % len(self.throws) + 1}" if self.throws else f"throw {index}"


def source_of(
    arm: Arm,
    *,
    seed: int,
    drag: float,
    count: int | None = None,
    throws_file: Path | None = None,
    flights_file: Path | None = None,
    recordings: tuple[RecordedFlight, ...] = (),
    ranges: ThrowRanges | None = None,
    spinning: Spinning | None = None,
) -> Source:
    """Return balls for an arm: those of a file, recordings, or else default throws.

    Args:
        arm: The arm that they are thrown to.
        seed: Seed of the run.
        drag: Drag of the balls [1/m].
        count: Number of trials; each throw or flight once if left out, or 10 default throws.
        throws_file: CSV file of throws.
        flights_file: CSV file of recorded flights.
        recordings: Recorded flights that are read already.
        ranges: Ranges of the default throws; those of the arm if left out.
        spinning: How default throws spin; not if left out.

    Raises:
        FileError: A file cannot be read, or holds no throws or flights.
    """
    throws = () if throws_file is None else read_throws(throws_file)
    recordings = recordings if flights_file is None else read_flights(flights_file)
    return Source(
        seed=seed,
        count=count or len(throws) or len(recordings) or 10,
        aim=aim_of(arm),
        catch_point=catch_place(arm),
        throws=throws,
        recordings=recordings,
        drag=drag,
        ranges=ranges or ranges_of(arm),
        spinning=spinning,
    )


def widened(source: Source, throws: ThrowSettings) -> Source:
    """Return a source with other ranges of throws."""
    given = throws.model_dump(exclude={"spread", "at", "around"}, exclude_none=True)
    aim = source.aim
    if throws.at is not None and throws.around is not None:
        aim = _box(np.array([throws.at, throws.around]))
        raised = throws.at[2] - _AIM_HEIGHT
        low, high = ThrowRanges().height
        given = {"height": (low + raised, high + raised)} | given
        source = replace(source, catch_point=np.array(throws.at))
    middle, half = 0.5 * (aim.q_low + aim.q_high), 0.5 * throws.spread * (aim.q_high - aim.q_low)
    if throws.spread != 1.0:
        aim = Aim(position=aim.position, q_low=middle - half, q_high=middle + half)
    return replace(source, aim=aim, ranges=replace(source.ranges or ThrowRanges(), **given))


def release_of(ball: Throw | BallPath) -> Array:
    """Return where a ball is released [m], shape (3,)."""
    return ball.r if isinstance(ball, Throw) else ball.at(0.0)[0]
