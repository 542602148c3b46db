"""``mitt see``: two cameras to a track, with what went wrong on the way."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from mitt.ball.filter import TABLE_TENNIS_BALL, THROWN_BALL, BallFilter, FilterConfig
from mitt.cameras.opening import open_cameras
from mitt.cameras.video_writer import VideoWriter
from mitt.errors import InputError
from mitt.files.rig import CalibratedRig
from mitt.signals import GRAVITY, Array, Frame, Moments, Sighting
from mitt.tracks.overlay import Overlay
from mitt.tracks.pairs import PairCounts, pairs
from mitt.vision.segmentation import Segmenter
from mitt.vision.triangulation import Triangulator, TriangulatorConfig

BALLS = {"any": FilterConfig(), "thrown": THROWN_BALL, "table-tennis": TABLE_TENNIS_BALL}
#: Frames taken from live cameras; frames a second at which people watch [Hz].
LIVE_FRAMES, WATCHED = 1000, 30.0
#: A real camera's error of centroid, besides what its calibration left [px].
_FLOOR = 0.05
#: Distance of centroid and projected ball at which the cameras disagree, in calibration errors
#: and at least [px].
_RESIDUAL, _LEAST = 6.0, 2.0
#: Share of the instants with two targets below which the cameras disagree.
_AGREE = 0.5
#: Length of the pieces whose fall is looked at [s], fewest sightings in one, and the error beyond
#: which it is no fall [m/s^2]; drag makes 2 at 7 m/s.
_PIECE, _FEWEST, _FALL = 0.15, 8, 5.0


@dataclass(slots=True, kw_only=True)
class Seen:
    """What was seen so far.

    Attributes:
        states: Time, position, velocity, acceleration, standard deviation, shape (13,) each.
        points: Time and position of each sighting, shape (4,).
        targets: Frames of each camera with a target in them.
        both: Instants at which both cameras had one.
        agreed: Instants at which they agreed on a ball.
        exchanged: Time and position of the sightings with left and right exchanged.
        counts: What became of the frames.
    """

    states: list[Array] = field(default_factory=list)
    points: list[Array] = field(default_factory=list)
    targets: list[int] = field(default_factory=lambda: [0, 0])
    both: int = 0
    agreed: int = 0
    exchanged: list[Array] = field(default_factory=list)
    counts: PairCounts = field(default_factory=PairCounts)


class Watcher:
    """Segmentation and triangulation of the catcher, on images of calibrated cameras.

    Centroids are straightened by the lens, images are left as they are.
    """

    def __init__(self, rig: CalibratedRig, *, radius: float, max_skew: float) -> None:
        """Take two cameras in a frame with z up, and a ball's radius [m]."""
        worst = max(c.rms_px for c in rig.cameras)
        config = TriangulatorConfig(
            sigma_floor=float(np.hypot(_FLOOR, worst)),
            max_residual=max(_LEAST, _RESIDUAL * worst),
            max_skew=max_skew,
        )
        self._cameras = rig.cameras
        self._segmenters = [Segmenter() for _ in rig.cameras]
        self._triangulator = Triangulator(rig.rig(), radius, config)

    def step(self, frames: tuple[Frame, ...], seen: Seen) -> tuple[tuple[Moments, ...], Sighting]:
        """Return what each camera sees [px] and the ball in the world; count it in ``seen``.

        Raises:
            InputError: An image has another size than the rig says.
        """
        moments = tuple(self._moments(frame) for frame in frames)
        sighting = self._triangulator.step(tuple(self._straight(m) for m in moments))
        other = tuple(self._straight(replace(m, camera=1 - m.camera)) for m in moments)
        exchanged = self._triangulator.step(other)
        for m in moments:
            seen.targets[m.camera] += m.found
        seen.both += len(moments) == 2 and all(m.found for m in moments)
        seen.agreed += sighting.found
        for found, rows in ((sighting, seen.points), (exchanged, seen.exchanged)):
            if found.found:
                rows.append(np.array((found.t, *found.r_o)))
        return moments, sighting

    def _moments(self, frame: Frame) -> Moments:
        """Return what a camera sees in one image."""
        camera = self._cameras[frame.camera]
        width, height = camera.lens.width, camera.lens.height
        if frame.pixels.shape != (height, width):
            raise InputError(f"images of camera {camera.name}",
                             f"{width} x {height} pixels as the rig says",
                             f"{frame.pixels.shape[1]} x {frame.pixels.shape[0]}")  # fmt: skip
        return self._segmenters[frame.camera].step(frame)

    def _straight(self, m: Moments) -> Moments:
        """Return moments in the image of the camera without distortion."""
        if not m.found:
            return m
        ((u, v),) = self._cameras[m.camera].lens.straighten(np.array(((m.u, m.v),)))
        return replace(m, u=float(u), v=float(v), found=bool(np.isfinite(u + v)))


def see(
    left: str, right: str, rig: CalibratedRig, seen: Seen, writer: VideoWriter | None, *,
    ball: str, radius: float, max_skew: float, fps: float | None, frames: int | None,
    progress: Callable[[str, int, int], None],
) -> None:  # fmt: skip
    """Follow the ball to the end of the frames; what is found stands in ``seen`` as it comes.

    Args:
        left: Video, folder of images or camera.
        right: The same of the right camera.
        rig: Two cameras.
        seen: Result.
        writer: Where the pictures go; None for none.
        ball: What is assumed of the flight: a key of ``BALLS``.
        radius: Radius of the ball [m].
        max_skew: Largest difference of two frames' times that are taken as one instant [s].
        fps: Frames a second, where files and cameras do not tell the time.
        frames: Most frames to take from each camera.
        progress: Told how far it is.
    """
    watcher = Watcher(rig, radius=radius, max_skew=max_skew)
    track = BallFilter(BALLS[ball])
    sizes = tuple((c.lens.width, c.lens.height) for c in rig.cameras)
    overlay = None if writer is None else Overlay(sizes, tuple(c.name for c in rig.cameras))
    with open_cameras((left, right), fps=fps) as (a, b):
        most = frames or (LIVE_FRAMES if a.live or b.live else None)
        instants = pairs((a, b), seen.counts, max_skew=max_skew, most=most)
        for n, images in enumerate(instants):
            moments, sighting = watcher.step(images, seen)
            if sighting.found:
                track.update(sighting)
            state = track.state(images[0].t)
            if sighting.found and state.tracked:
                sigma = np.sqrt(np.diag(state.covariance)[:3])
                seen.states.append(
                    np.concatenate(((state.t,), state.r_o, state.dr_o, state.ddr_o, sigma))
                )
            if writer is not None and overlay is not None:
                writer.write(overlay.draw(images[0].t, images, moments, sighting, state))
            progress("frames", n + 1, n + 2)


def complaints(seen: Seen, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return what went wrong, each with its likely cause."""
    said, counts = [], seen.counts
    a, b = counts.frames
    if counts.ended:
        said.append(f"{counts.ended} ended early: {a} frames left, {b} right; "
                    f"{counts.left_over} without a partner are left out")  # fmt: skip
    alone = min(a, b) - counts.paired
    if alone > 0.05 * max(min(a, b), 1):
        early = "left" if counts.first_gap < 0.0 else "right"
        said.append(f"{alone} of {min(a, b)} frames have no partner in time, and the first {early}"
                    f" one is {abs(counts.first_gap):.4g} s early: start both by one trigger, set"
                    " their clocks alike, say --fps, or a larger --max-skew")  # fmt: skip
    if counts.backward:
        said.append(f"{counts.backward} frames dropped, as their time did not rise")
    for name, count in zip(names, seen.targets, strict=True):
        if count == 0:
            said.append(f"camera {name} saw no ball in any frame: is it dark or covered?")
    if _exchanged(seen):
        said.append(f"left and right seem exchanged: {len(seen.exchanged)} sightings the other way "
                    f"round, {seen.agreed} as given, which do not fall as a ball does")  # fmt: skip
    elif seen.agreed < _AGREE * seen.both:
        said.append(f"the cameras agree on a ball in {seen.agreed} of {seen.both} instants only: "
                    "the rig is another's, a camera was moved, or something else is "
                    "bright")  # fmt: skip
    elif (error := fall_error(seen.points)) is not None and error > _FALL:
        said.append(f"what was seen does not fly: its acceleration is {error:.0f} m/s^2 off "
                    "gravity; a hand that carries the ball, or a rig that is "
                    "another's")  # fmt: skip
    return tuple(said)


def _exchanged(seen: Seen) -> bool:
    """Say whether left and right seem exchanged: more sightings that way, or a truer fall."""
    if len(seen.exchanged) > 2 * seen.agreed:
        return True
    as_given, other = fall_error(seen.points), fall_error(seen.exchanged)
    if as_given is None or other is None or 2 * len(seen.exchanged) < seen.agreed:
        return False
    return as_given > _FALL and other < 0.5 * as_given


def fall_error(points: Sequence[Array]) -> float | None:
    """Return how far from gravity the acceleration of the points is [m/s^2].

    The median over pieces of 0.15 s of |a - g|, a from a parabola; drag makes it 1 to 2 m/s^2 at
    the speeds of a throw. None where no piece has enough points. It tells a wrong rig, or left and
    right exchanged.

    Args:
        points: Rows t, x, y, z [s, m], each shape (4,), in the order of time.
    """
    errors, start = [], 0
    for n in range(len(points)):
        if points[n][0] - points[start][0] < _PIECE:
            continue
        piece = np.array(points[start : n + 1])
        start = n + 1 if n + 1 < len(points) else n
        if len(piece) < _FEWEST:
            continue
        t = piece[:, 0] - piece[:, 0].mean()
        a = 2.0 * np.polyfit(t, piece[:, 1:], 2)[0]
        errors.append(float(np.linalg.norm(a - np.array((0.0, 0.0, -GRAVITY)))))
    return float(np.median(errors)) if errors else None


def status_of(seen: Seen) -> str:
    """Return ok, or what is wrong: no_frames, no_ball, exchanged, disagree, short."""
    if seen.counts.paired == 0:
        return "no_frames"
    if seen.both == 0:
        return "no_ball"
    if _exchanged(seen):
        return "exchanged"
    if seen.agreed < _AGREE * seen.both:
        return "disagree"
    return "ok" if seen.states else "short"


def rate_of(points: list[Array]) -> float | None:
    """Return the median rate of the sightings [Hz]; None without two."""
    gaps = [b[0] - a[0] for a, b in pairwise(points)]
    return 1.0 / float(np.median(gaps)) if gaps else None
