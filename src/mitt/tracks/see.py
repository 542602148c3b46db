"""``mitt see``: two cameras to a track, with what went wrong on the way."""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from mitt.link.cameras.opening import open_cameras
from mitt.link.rig import CalibratedRig
from mitt.link.video import VideoWriter
from mitt.signals import Array, Frame
from mitt.tracks.fall import fall_error
from mitt.tracks.overlay import Overlay
from mitt.tracks.pairs import PairCounts, Pairing
from mitt.tracks.table import point_row, state_row
from mitt.tracks.watcher import Look, Watcher
from mitt.vision.filter import TABLE_TENNIS_BALL, THROWN_BALL, BallFilter, FilterConfig

BALLS = {"any": FilterConfig(), "thrown": THROWN_BALL, "table-tennis": TABLE_TENNIS_BALL}
#: Frames taken from live cameras; frames a second at which people watch [Hz].
LIVE_FRAMES, WATCHED = 1000, 30.0
#: Share of the instants with two targets below which the eyes disagree.
_AGREE = 0.5
#: Error of the fall beyond which it is none [m/s^2]; drag makes 2 at 7 m/s.
_FALL = 5.0

Progress = Callable[[str, int, int], None]


@dataclass(slots=True, kw_only=True)
class Seen:
    """What was seen so far.

    Attributes:
        states: Rows of ``track_table.STATE``.
        points: Rows of ``track_table.POINTS``.
        targets: Frames of each camera with a target in them.
        both: Instants at which both cameras had one.
        agreed: Instants at which they agreed on a ball.
        exchanged: Points with left and right exchanged.
        counts: What became of the frames.
    """

    states: list[Array] = field(default_factory=list)
    points: list[Array] = field(default_factory=list)
    targets: list[int] = field(default_factory=lambda: [0, 0])
    both: int = 0
    agreed: int = 0
    exchanged: list[Array] = field(default_factory=list)
    counts: PairCounts = field(default_factory=PairCounts)

    def note(self, look: Look) -> None:
        """Count what one instant brought."""
        for m in look.moments:
            self.targets[m.camera] += m.found
        self.both += len(look.moments) == 2 and all(m.found for m in look.moments)
        if look.exchanged.found:
            self.exchanged.append(point_row(look.exchanged))
        if look.sighting.found:
            self.agreed += 1
            self.points.append(point_row(look.sighting))


@dataclass(frozen=True, slots=True, kw_only=True)
class SeeSettings:
    """What is looked at, and how.

    Attributes:
        left: Video, folder of images or camera.
        right: The same of the right camera.
        ball: What is assumed of the flight: a key of ``BALLS``.
        ball_radius: Radius of the ball [m].
        max_skew: Largest difference of two frames' times that are taken as one instant [s].
        fps: Frames a second, where files and cameras do not tell the time.
        frames: Most frames to take from each camera.
    """

    left: str
    right: str
    ball: str
    ball_radius: float
    max_skew: float
    fps: float | None
    frames: int | None


def see(
    settings: SeeSettings, rig: CalibratedRig, seen: Seen, writer: VideoWriter | None,
    progress: Progress,
) -> None:  # fmt: skip
    """Follow the ball to the end of the frames; what is found stands in ``seen`` as it comes.

    Args:
        settings: What is looked at.
        rig: Two cameras.
        seen: Result.
        writer: Where the pictures go; None for none.
        progress: Told how far it is.
    """
    watcher = Watcher(rig, radius=settings.ball_radius, max_skew=settings.max_skew)
    track = BallFilter(BALLS[settings.ball])
    sizes = tuple((c.lens.width, c.lens.height) for c in rig.cameras)
    overlay = None if writer is None else Overlay(sizes, tuple(c.name for c in rig.cameras))
    with open_cameras((settings.left, settings.right), fps=settings.fps) as (left, right):
        most = settings.frames or (LIVE_FRAMES if left.live or right.live else None)
        pairing = Pairing(left, right, max_skew=settings.max_skew, most=most)
        seen.counts = pairing.counts
        for n, pair in enumerate(pairing):
            frames: tuple[Frame, ...] = tuple(f for f in pair if f is not None)
            look = watcher.step(frames)
            seen.note(look)
            if look.sighting.found:
                track.update(look.sighting)
            ball = track.state(frames[0].t)
            if look.sighting.found and ball.tracked:
                seen.states.append(state_row(ball))
            if writer is not None and overlay is not None:
                writer.write(overlay.draw(frames[0].t, frames, look.moments, look.sighting, ball))
            progress("frames", n + 1, n + 2)


def complaints(seen: Seen, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return what went wrong, each with its likely cause."""
    said, counts = [], seen.counts
    a, b = counts.frames
    if counts.ended:
        said.append(
            f"{counts.ended} ended early: {a} frames left, {b} right; "
            f"{counts.left_over} without a partner are left out"
        )
    alone = min(a, b) - counts.paired
    if alone > 0.05 * max(min(a, b), 1):
        said.append(
            f"{alone} of {min(a, b)} frames have no partner in time: "
            "say --fps, or a larger --max-skew"
        )
    if counts.backward:
        said.append(f"{counts.backward} frames dropped, as their time did not rise")
    for name, count in zip(names, seen.targets, strict=True):
        if count == 0:
            said.append(f"camera {name} saw no ball in any frame: is it dark or covered?")
    return (*said, *_doubts(seen))


def _doubts(seen: Seen) -> tuple[str, ...]:
    """Return what speaks against the sightings themselves."""
    if exchanged(seen):
        return (
            f"left and right seem exchanged: {len(seen.exchanged)} sightings the other way "
            f"round, {seen.agreed} as given, which do not fall as a ball does",
        )
    if seen.agreed < _AGREE * seen.both:
        return (
            f"the cameras agree on a ball in {seen.agreed} of {seen.both} instants only: "
            "the rig is another's, a camera was moved, or something else is bright",
        )
    error = fall_error(seen.points)
    if error is not None and error > _FALL:
        return (
            f"what was seen does not fly: its acceleration is {error:.0f} m/s^2 off gravity; "
            "a hand that carries the ball, or a rig that is another's",
        )
    return ()


def exchanged(seen: Seen) -> bool:
    """Say whether left and right seem exchanged: more sightings that way, or a truer fall."""
    if len(seen.exchanged) > 2 * seen.agreed:
        return True
    as_given, other = fall_error(seen.points), fall_error(seen.exchanged)
    if as_given is None or other is None or 2 * len(seen.exchanged) < seen.agreed:
        return False
    return as_given > _FALL and other < 0.5 * as_given


def status_of(seen: Seen) -> str:
    """Return ok, or what is wrong: no_frames, no_ball, exchanged, disagree, short."""
    if seen.counts.paired == 0:
        return "no_frames"
    if seen.both == 0:
        return "no_ball"
    if exchanged(seen):
        return "exchanged"
    if seen.agreed < _AGREE * seen.both:
        return "disagree"
    return "ok" if seen.states else "short"


def rate_of(points: list[Array]) -> float | None:
    """Return the median rate of the sightings [Hz]; None without two."""
    gaps = [b[0] - a[0] for a, b in pairwise(points)]
    return 1.0 / float(np.median(gaps)) if gaps else None
