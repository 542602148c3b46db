"""``mitt see``: two cameras to a track, with what went wrong on the way, and a picture of both."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import pi, sqrt

import numpy as np

from mitt.clock import Progress
from mitt.core.ball.filter import TABLE_TENNIS_BALL, THROWN_BALL, BallFilter, FilterConfig
from mitt.core.errors import InputError
from mitt.core.eyes.background import mean_background
from mitt.core.eyes.groups import MOST_GROUPS
from mitt.core.eyes.lens import Lens
from mitt.core.eyes.segmentation import Segmenter
from mitt.core.eyes.triangulation import Triangulator, TriangulatorConfig
from mitt.core.signals import Array, BallState, Frame, Image, Moments, Sighting
from mitt.io.rig import CalibratedRig
from mitt.robot.cameras.ball_colour import BallColour
from mitt.robot.cameras.cameras import ImageSource, film_looks, open_cameras, optional
from mitt.robot.cameras.other_rigs import FALL, fall_error, meant_rig
from mitt.robot.cameras.synchrony import Synchrony, synchrony
from mitt.robot.cameras.video_writer import VideoWriter

BALLS = {"any": FilterConfig(), "thrown": THROWN_BALL, "table-tennis": TABLE_TENNIS_BALL}
#: Frames a second at which people watch [Hz].
WATCHED = 30.0
#: Share of the instants with two targets below which the cameras disagree.
_AGREE = 0.5
_NOTHING = np.empty((0, 0), np.uint8)
#: What an unknown offset may move the ball by, one sigma, before it is said [m].
_UNKNOWN = 5e-3
#: Images of a film from which its background is learned, and the fewest that tell one.
_LOOKS = 16
_FEWEST_LOOKS = 8
#: First images of each live camera from which its background is learned.
_LIVE_LOOKS = 32
#: Share of the frames with more bright things than are looked at, above which it is said.
_CROWDED = 0.1
#: Brightest pixel below which a camera sees nothing.
_DARK = 50
#: Colours (red, green, blue): both cameras agree, one sees something alone, text, ground.
_AGREED = (80, 220, 120)
_ALONE = (250, 170, 50)
_TEXT = (225, 230, 235)
_GROUND = (24, 30, 36)
#: Height of the strip of text, and the gap between the pictures [px].
_STRIP = 52
_GAP = 8


@dataclass(slots=True)
class PairCounts:
    """What became of the frames.

    Attributes:
        frames: Frames of the left and of the right camera.
        paired: Instants at which both gave a frame.
        ended: Name of the camera that ended while the other went on; empty if none did.
        left_over: Frames of the other after that.
        backward: Frames dropped because their time did not rise.
        first_gap: Time of the first left frame less that of the first right one [s].
    """

    frames: list[int] = field(default_factory=lambda: [0, 0])
    paired: int = 0
    ended: str = ""
    left_over: int = 0
    backward: int = 0
    first_gap: float = 0.0


def pairs(
    cameras: tuple[ImageSource, ImageSource],
    counts: PairCounts,
    *,
    max_skew: float,
    most: int | None,
) -> Iterator[tuple[Frame, ...]]:
    """Yield the frames of each instant, left before right; one where the other camera has none.

    The stamps of both count from the first frame of either. Two times that differ by up to
    ``max_skew`` [s] are one instant; ``counts`` are kept up to date.
    """
    cameras[1].zero = cameras[0].zero
    sources = [_rising(camera, k, counts, most) for k, camera in enumerate(cameras)]
    left, right = (next(source, None) for source in sources)
    if left is not None and right is not None:
        counts.first_gap = left.t - right.t
    while left is not None and right is not None:
        gap = left.t - right.t
        if abs(gap) <= max_skew:
            counts.paired += 1
            yield left, right
            left, right = (next(source, None) for source in sources)
        elif gap < 0.0:
            yield (left,)
            left = next(sources[0], None)
        else:
            yield (right,)
            right = next(sources[1], None)
    if left is not None or right is not None:
        ended = 0 if left is None else 1
        counts.ended, counts.left_over = cameras[ended].name, 1
        if not cameras[1 - ended].live:
            counts.left_over += sum(1 for _ in sources[1 - ended])


def _rising(camera: ImageSource, k: int, counts: PairCounts, most: int | None) -> Iterator[Frame]:
    """Yield the frames of camera k whose time rises."""
    last = -float("inf")
    while most is None or counts.frames[k] < most:
        frame = camera.read()
        if frame is None:
            return
        counts.frames[k] += 1
        if frame.t > last:
            last = frame.t
            yield frame
        else:
            counts.backward += 1


@dataclass(slots=True, kw_only=True)
class SeenSoFar:
    """What was seen so far.

    Attributes:
        states: Time, position, velocity, acceleration, standard deviation, shape (13,) each.
        points: Time and position of each sighting, shape (4,).
        targets: Frames of each camera with a target in them.
        brightest: Largest value of a pixel of each camera.
        crowded: Frames of each camera with more bright things than are looked at.
        both: Instants at which both cameras had one.
        agreed: Instants at which they agreed on a ball.
        exchanged: Time and position of the sightings with left and right exchanged.
        pairs: Time, left and right image point without distortion, of instants with both,
            shape (5,) each.
        synchrony: What these say of the time between the cameras; None before the end, or where
            they are too few.
        out_of_step: Whether the cameras are not in step, by more than the track knows.
        meant: Which poses the rig's seem to be instead, and what to do; empty where they are right,
            or none is found.
        counts: What became of the frames.
    """

    states: list[Array] = field(default_factory=list)
    points: list[Array] = field(default_factory=list)
    targets: list[int] = field(default_factory=lambda: [0, 0])
    brightest: list[int] = field(default_factory=lambda: [0, 0])
    crowded: list[int] = field(default_factory=lambda: [0, 0])
    both: int = 0
    agreed: int = 0
    exchanged: list[Array] = field(default_factory=list)
    pairs: list[Array] = field(default_factory=list)
    synchrony: Synchrony | None = None
    out_of_step: bool = False
    meant: str = ""
    counts: PairCounts = field(default_factory=PairCounts)


class Watcher:
    """Segmentation and triangulation of the catcher, on images of calibrated cameras.

    Centroids are straightened by the lens, images are left as they are. Each camera has a
    background where it was told one; without, the ball is to be brighter than what is behind it.
    """

    def __init__(
        self,
        rig: CalibratedRig,
        *,
        radius: float,
        max_skew: float,
        looks: tuple[list[Image], ...] = (),
        least: int = _FEWEST_LOOKS,
    ) -> None:
        """Take two cameras in a frame with z up, and a ball's radius [m].

        ``looks`` are images of each camera, from which its background is learned where there are
        ``least`` or more of one size.
        """
        worst = max(c.rms_px for c in rig.cameras)
        # A real camera's centroid is 0.05 px off besides what its calibration left. The cameras
        # disagree where it is 2 px from the projected ball, or six times what calibration left.
        config = TriangulatorConfig(
            sigma_floor=float(np.hypot(0.05, worst)),
            max_skew=max_skew,
            max_residual=max(2.0, 6.0 * worst),
        )
        self._cameras, self._calibrated, self._radius = rig.cameras, rig, radius
        self._rig, self._config = rig.rig(), config
        self._segmenters = [Segmenter() for _ in rig.cameras]
        for segmenter, images in zip(self._segmenters, looks, strict=False):
            if len({image.shape for image in images}) == 1 and len(images) >= least:
                segmenter.learn_background(mean_background(images))
        self._triangulator = Triangulator(rig.rig(), radius, config)

    def step(
        self, frames: tuple[Frame, ...], seen: SeenSoFar
    ) -> tuple[tuple[Moments, ...], Sighting]:
        """Return what each camera sees [px] and the ball in the world; count it in ``seen``."""
        moments = tuple(self._moments(frame) for frame in frames)
        for frame in frames:
            largest = int(frame.pixels.max(initial=0))
            seen.brightest[frame.camera] = max(seen.brightest[frame.camera], largest)
            seen.crowded[frame.camera] += self._segmenters[frame.camera].left_out > 0
        straight = tuple(self._straight(m) for m in moments)
        sighting = self._triangulator.step(straight)
        if len(straight) == 2 and all(m.found and not (m.clipped or m.merged) for m in straight):
            a, b = straight
            seen.pairs.append(np.array((a.t, a.u, a.v, b.u, b.v)))
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

    def judge(self, seen: SeenSoFar) -> None:
        """Judge the rig and the time between its cameras, which is added to the track's sigmas."""
        if not seen.pairs:
            return
        points = np.array(seen.pairs)
        fall = fall_error(seen.points)
        if seen.agreed < _AGREE * seen.both or (fall is not None and fall > FALL):
            seen.meant = meant_rig(points, self._calibrated, self._radius, self._config)
        noise = self._config.sigma_floor
        found = synchrony(points, self._rig, radius=self._radius, noise=noise)
        seen.synchrony = found
        if found is None:
            return
        own = float(np.median([row[10:13] for row in seen.states])) if seen.states else 0.0
        seen.out_of_step = not seen.meant and found.shifted and found.moved(found.worst) > own
        for row in seen.states:
            row[10:13] = np.hypot(row[10:13], found.error(float(row[0])))

    def _moments(self, frame: Frame) -> Moments:
        """Return what a camera sees in one image."""
        camera = self._cameras[frame.camera]
        _check_size(f"images of camera {camera.name}", frame.pixels, camera.lens)
        return self._segmenters[frame.camera].step(frame)

    def _straight(self, m: Moments) -> Moments:
        """Return moments in the image of the camera without distortion."""
        if not m.found:
            return m
        ((u, v),) = self._cameras[m.camera].lens.straighten(np.array(((m.u, m.v),)))
        return replace(m, u=float(u), v=float(v), found=bool(np.isfinite(u + v)))


def _check_size(name: str, pixels: Image, lens: Lens) -> None:
    """Refuse images of another size than the rig's."""
    if pixels.shape != (lens.height, lens.width):
        raise InputError(
            name,
            f"{lens.width} x {lens.height} pixels as the rig says",
            f"{pixels.shape[1]} x {pixels.shape[0]}",
        )


def see_ball(
    left: str,
    right: str,
    rig: CalibratedRig,
    seen: SeenSoFar,
    writer: VideoWriter | None,
    *,
    ball: str,
    radius: float,
    max_skew: float,
    fps: float | None,
    frames: int | None,
    background: tuple[str, str] | None,
    colour: Array | None,
    progress: Progress,
) -> None:
    """Follow the ball to the end of the frames; what is found stands in ``seen`` as it comes.

    ``ball`` is what is assumed of the flight, a key of ``BALLS``, ``radius`` its radius [m]. Frames
    whose times differ by up to ``max_skew`` [s] are taken as one instant; ``fps`` says the rate
    where files and cameras do not tell the time, ``frames`` the most to take from each camera.
    ``background`` are films or images of the two without the ball, ``colour`` is the ball's: red,
    green, blue, shape (3,). ``progress`` is told how far it is.
    """
    colours = tuple(None if colour is None else BallColour(colour) for _ in (left, right))
    shown = background or (left, right)
    looks = tuple(film_looks(x, _LOOKS, of) for x, of in zip(shown, colours, strict=True))
    if background is not None:
        for name, seen_there, camera in zip(background, looks, rig.cameras, strict=True):
            _check_size(name, seen_there[0] if seen_there else _NOTHING, camera.lens)
    track = BallFilter(BALLS[ball])
    sizes = tuple((c.lens.width, c.lens.height) for c in rig.cameras)
    overlay = None if writer is None else Overlay(sizes, tuple(c.name for c in rig.cameras))
    with open_cameras((left, right), fps=fps, colours=colours) as (a, b):
        if background is None and (a.live or b.live):
            looks = _first_looks((a, b), looks)
        least = _FEWEST_LOOKS if background is None else 1
        watcher = Watcher(rig, radius=radius, max_skew=max_skew, looks=looks, least=least)
        most = frames or (1000 if a.live or b.live else None)
        instants = pairs((a, b), seen.counts, max_skew=max_skew, most=most)
        try:
            for n, images in enumerate(instants):
                moments, sighting = watcher.step(images, seen)
                if sighting.found:
                    track.update(sighting)
                state = track.state(images[0].t)
                if sighting.found and state.tracked:
                    sigma = np.sqrt(np.diag(state.covariance)[:3])
                    row = ((state.t,), state.r_o, state.dr_o, state.ddr_o, sigma)
                    seen.states.append(np.concatenate(row))
                if writer is not None and overlay is not None:
                    writer.write(overlay.draw(images[0].t, images, moments, sighting, state))
                progress("frames", n + 1, n + 2)
        finally:  # what is kept of an interrupted run is judged as well
            watcher.judge(seen)


def _first_looks(
    cameras: tuple[ImageSource, ImageSource], looks: tuple[list[Image], ...]
) -> tuple[list[Image], ...]:
    """Return looks of two cameras; of those that are live the images that come first."""
    for _ in range(_LIVE_LOOKS):
        for camera, images in zip(cameras, looks, strict=True):
            frame = camera.read() if camera.live else None
            if frame is not None:
                images.append(frame.pixels)
    return looks


def complaints(seen: SeenSoFar, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return what went wrong, each with its likely cause."""
    counts, exchanged = seen.counts, _exchanged(seen)
    said = [] if exchanged or seen.meant else list(_out_of_step(seen))
    a, b = counts.frames
    if counts.ended:
        said.append(
            f"{counts.ended} ended first: {a} frames left, {b} right; "
            f"{counts.left_over} without a partner are left out"
        )
    alone = min(a, b) - counts.paired
    if alone > 0.05 * max(min(a, b), 1):
        early = "left" if counts.first_gap < 0.0 else "right"
        said.append(
            f"{alone} of {min(a, b)} frames have no partner in time, and the first {early}"
            f" one is {abs(counts.first_gap):.4g} s early: start both by one trigger, set"
            " their clocks alike, say --fps, or a larger --max-skew"
        )
    if counts.backward:
        said.append(f"{counts.backward} frames dropped, as their time did not rise")
    for name, count, most in zip(names, seen.targets, seen.brightest, strict=True):
        if count == 0:
            why = "is it dark or covered?" if most < _DARK else "is something else as bright?"
            said.append(f"camera {name} saw no ball (brightest pixel {most} of 255): {why}")
    for name, crowded, frames in zip(names, seen.crowded, counts.frames, strict=True):
        if crowded > _CROWDED * frames:
            said.append(
                f"camera {name} shows more than {MOST_GROUPS} bright things in {crowded} of"
                f" {frames} frames: only those most like a ball are looked at"
            )
    if exchanged:
        said.append(
            f"left and right seem exchanged: {len(seen.exchanged)} sightings the other way "
            f"round, {seen.agreed} as given, which do not fall as a ball does"
        )
    elif seen.agreed < _AGREE * seen.both:
        why = "the rig is another's, a camera was moved, or something else is bright"
        said.append(
            f"the cameras agree on a ball in {seen.agreed} of {seen.both} instants only: "
            f"{seen.meant or why}"
        )
    elif not seen.out_of_step and (error := fall_error(seen.points) or 0.0) > FALL:
        why = "a hand that carries the ball, or a rig that is another's"
        said.append(
            f"what was seen does not fly: its acceleration is {error:.0f} m/s^2 off "
            f"gravity; {seen.meant or why}"
        )
    return tuple(said)


def _out_of_step(seen: SeenSoFar) -> Iterator[str]:
    """Yield what the images say of the time between the cameras, where it is worth a word."""
    found = seen.synchrony
    if found is None:
        if seen.states:
            yield (
                "too few instants in a row to tell whether the cameras are in step: the"
                " standard deviations hold only if they are"
            )
        return
    if seen.out_of_step:
        worst = found.worst
        offset = float(found.offset[worst])
        frames = abs(offset) / float(np.median(np.diff(found.t)))
        side = "late" if offset > 0.0 else "early"
        yield (
            f"the cameras are not in step: about {found.t[worst]:.2f} s the right images are"
            f" {1e3 * abs(offset):.1f} ms ({frames:.1f} frames) {side}, which moves the ball by"
            f" {1e3 * found.moved(worst):.0f} mm: a lost frame, or starts, rates or clocks that"
            " differ; take one trigger, and images named by their own times"
        )
    elif found.mean_sigma * found.speed > _UNKNOWN:
        yield (
            f"whether the cameras are in step shows to +-{2e3 * found.mean_sigma:.1f} ms only,"
            f" {2e3 * found.mean_sigma * found.speed:.0f} mm of the ball"
        )


def _exchanged(seen: SeenSoFar) -> bool:
    """Say whether left and right seem exchanged: more sightings that way, or a truer fall."""
    if seen.meant:
        return False
    if len(seen.exchanged) > 2 * seen.agreed:
        return True
    as_given, other = fall_error(seen.points), fall_error(seen.exchanged)
    if as_given is None or other is None or 2 * len(seen.exchanged) < seen.agreed:
        return False
    return as_given > FALL and other < 0.5 * as_given


def seen_status(seen: SeenSoFar) -> str:
    """Return ok, or what is wrong: no_frames, no_ball, exchanged, disagree, out_of_step, short."""
    if seen.counts.paired == 0:
        return "no_frames"
    if seen.both == 0:
        return "no_ball"
    if _exchanged(seen):
        return "exchanged"
    if seen.agreed < _AGREE * seen.both:
        return "disagree"
    if seen.out_of_step:
        return "out_of_step"
    return "ok" if seen.states else "short"


def sighting_rate(points: list[Array]) -> float | None:
    """Return the median rate of the sightings [Hz]; None without two."""
    gaps = [b[0] - a[0] for a, b in pairwise(points)]
    return 1.0 / float(np.median(gaps)) if gaps else None


class Overlay:
    """Draws pictures of one size."""

    def __init__(self, sizes: tuple[tuple[int, int], ...], names: tuple[str, ...]) -> None:
        """Lay the pictures out, 384 px high at least."""
        self._cv2 = optional("cv2")
        self._names, self._sizes = names, sizes
        self._scale = max(1, -(-384 // max(height for _, height in sizes)))
        self._shapes = [(self._scale * h, self._scale * w) for w, h in sizes]
        total = sum(w for _, w in self._shapes) + _GAP * (len(sizes) - 1)
        self._size = (max(h for h, _ in self._shapes) + _STRIP, max(total, 760))

    def draw(
        self,
        t: float,
        frames: tuple[Frame, ...],
        moments: tuple[Moments, ...],
        sighting: Sighting,
        ball: BallState,
    ) -> Image:
        """Return a picture in red, green, blue, shape (height, width, 3); both sizes even."""
        height, width = (n + n % 2 for n in self._size)
        canvas = np.full((height, width, 3), _GROUND, dtype=np.uint8)
        seen = {m.camera: m for m in moments}
        for frame in frames:
            k = frame.camera
            start = sum(w for _, w in self._shapes[:k]) + _GAP * k
            h, w = self._shapes[k]
            canvas[:h, start : start + w] = self._picture(frame, seen[k], sighting.found)
        for k, text in enumerate((f"t = {t:8.4f} s", _told(sighting, ball))):
            self._write(canvas, text, (10, height - _STRIP + 20 + 22 * k))
        return canvas

    def _picture(self, frame: Frame, m: Moments, agreed: bool) -> Image:
        """Return one camera's image enlarged, its detection circled."""
        cv2, s = self._cv2, self._scale
        grey = np.repeat(np.repeat(frame.pixels, s, axis=0), s, axis=1)
        picture = cv2.cvtColor(grey, cv2.COLOR_GRAY2RGB)
        if m.found:
            colour = _AGREED if agreed else _ALONE
            # Pixel u covers s columns of the picture, its centre is half of them further.
            at = (round(s * (m.u + 0.5) - 0.5), round(s * (m.v + 0.5) - 0.5))
            radius = max(round(s * (sqrt(m.area / pi) + 2.0)), 5)
            cv2.circle(picture, at, radius, colour, 1, cv2.LINE_AA)
            for du, dv in ((1, 0), (-1, 0), (0, 1), (0, -1)):
                begin = (at[0] + du * (radius + 2), at[1] + dv * (radius + 2))
                end = (at[0] + du * (radius + 9), at[1] + dv * (radius + 9))
                cv2.line(picture, begin, end, colour, 1, cv2.LINE_AA)
        self._write(picture, f"{self._names[frame.camera]}  {frame.number}", (8, 20))
        return np.asarray(picture, dtype=np.uint8)

    def _write(self, picture: Image, text: str, at: tuple[int, int]) -> None:
        """Write text into a picture."""
        cv2 = self._cv2
        cv2.putText(picture, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.5, _TEXT, 1, cv2.LINE_AA)


def _told(sighting: Sighting, ball: BallState) -> str:
    """Return the second line of text."""
    if not (ball.tracked or sighting.found):
        return "no ball that both cameras agree on"
    x, y, z = ball.r_o if ball.tracked else sighting.r_o
    speed = f"speed {np.linalg.norm(ball.dr_o):5.2f} m/s" if ball.tracked else "no track yet"
    return f"x {x:7.3f}  y {y:7.3f}  z {z:7.3f} m   {speed}"
