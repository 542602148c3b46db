"""Where the rig stands before the robot, and how far its clock is off.

Both from a ball in the hand: it is held at known places, and its centroids (of pinhole cameras,
``Lens.straighten``) fix the pose (``HandProblem``); it is carried about at a constant gap from the
catch point, and its path fixes the clock (``ClockProblem``). The clock also follows from recorded
catches, where the ball rides on the braking hand.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mitt.core.arm.arm import Arm
from mitt.core.catcher.settings import BRAKE
from mitt.core.errors import InputError
from mitt.core.eyes.background import mean_background
from mitt.core.eyes.camera import Camera as Pinhole
from mitt.core.eyes.camera import applied, by_pose, inverse, laid, turned
from mitt.core.eyes.clock_offset import CatchSeen, LearnedClock, caught_offset
from mitt.core.eyes.segmentation import Segmenter
from mitt.core.eyes.triangulation import Triangulator, TriangulatorConfig
from mitt.core.signals import Array, Moments, Sighting
from mitt.io.cdr import Rows
from mitt.io.csv_table import header_of, read_table, times_of
from mitt.io.messages import clock_in
from mitt.io.recordings import Recorded
from mitt.io.rig import CalibratedRig
from mitt.robot.cameras.cameras import ImageSource
from mitt.robot.cameras.least_squares import POSE, CalibrationStage, Fit, fit, weak

POINT = ("x_m", "y_m", "z_m")
"""Columns of a place [m]."""
#: Fewest places of the ball that fix a pose, with one to spare, and sightings that fix a clock.
_FEWEST_PLACES = 4
_FEWEST_SIGHTINGS = 20
#: Fewest images that tell the background.
_FEWEST_LOOKS = 8
#: Step in which a carried ball's offset is looked for first [s].
_SEARCH = 0.002
#: Error of the clock that is worth a warning [s].
_CLOCK = 5e-4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HandProblem:
    """Centroids of a ball at known places, and the pose that should explain them.

    Attributes:
        cameras: Cameras of the rig; their poses are in the rig's frame.
        camera: Camera of each centroid, shape (n,).
        p_world: Ball centre in the world [m], shape (n, 3).
        uv: Centroid [px], shape (n, 2).
        radius: Ball radius [m].
        T_rig_world: p_rig = T_rig_world @ p_world [m], shape (4, 4).
    """

    cameras: tuple[Pinhole, ...]
    camera: NDArray[np.int64]
    p_world: Array
    uv: Array
    radius: float
    T_rig_world: Array

    @property
    def names(self) -> tuple[str, ...]:
        """The six of a pose."""
        return POSE

    def _optical(self) -> tuple[Array, Array, Array]:
        """Return points [m], (n, 3), rotations from the rig, (n, 3, 3), f, cu, cv [px], (n, 3)."""
        R = np.array([c.rotation.T for c in self.cameras])[self.camera]
        at = np.array([c.centre for c in self.cameras])[self.camera]
        lens = np.array([(c.f_px, c.cu, c.cv) for c in self.cameras])[self.camera]
        p = np.einsum("nij,nj->ni", R, applied(self.T_rig_world, self.p_world) - at)
        return p, R, lens

    def residuals(self) -> Array:
        """Return seen minus predicted [px], shape (2 n,); the centroid as in ``triangulation``."""
        p, _, lens = self._optical()
        if np.any(p[:, 2] <= self.radius):
            return np.full(2 * len(p), np.inf)
        xy = p[:, :2] * p[:, 2:] / (p[:, 2:] ** 2 - self.radius**2)
        return np.asarray((self.uv - lens[:, :1] * xy - lens[:, 1:]).ravel())

    def jacobian(self) -> Array:
        """Return the derivative of the centroids with respect to a step, shape (2 n, 6)."""
        p, R, lens = self._optical()
        z, gap = p[:, 2], p[:, 2] ** 2 - self.radius**2
        by_p = np.zeros((len(p), 2, 3))
        by_p[:, 0, 0] = by_p[:, 1, 1] = z / gap
        by_p[:, :, 2] = -p[:, :2] * ((z * z + self.radius**2) / gap**2)[:, None]
        by_step = by_pose(self.p_world @ self.T_rig_world[:3, :3].T)
        return np.asarray((lens[:, :1, None] * (by_p @ R @ by_step)).reshape(-1, 6))

    def moved(self, step: Array) -> "HandProblem":
        """Return the problem with the pose moved by a step."""
        return replace(self, T_rig_world=turned(self.T_rig_world, step))


def _first_pose(seen: Array, p_world: Array) -> Array:
    """Return a first T_rig_world, (4, 4), that a few wrong points, (k, 3) [m], do not spoil."""
    if len(seen) < _FEWEST_PLACES:
        wanted = f"{_FEWEST_PLACES} places or more that two cameras saw"
        raise InputError("ball in the hand", wanted, len(seen))
    spread = np.linalg.svd(p_world - p_world.mean(axis=0), compute_uv=False)
    if spread[1] < 0.02 * np.sqrt(len(seen)):
        raise InputError(
            "ball in the hand",
            "places that do not lie on one line, 0.1 m apart",
            f"{1e3 * spread[1] / np.sqrt(len(seen)):.0f} mm across it",
        )
    weights = np.ones(len(seen))
    for _ in range(20):
        T = laid(p_world, seen, weights)
        error = np.linalg.norm(applied(T, p_world) - seen, axis=1)
        weights = 1.0 / np.maximum(error, max(0.2 * float(np.median(error)), 1e-9))
    return T


def placed(cameras: tuple[Pinhole, ...], T_rig_world: Array) -> tuple[Pinhole, ...]:
    """Return the cameras with their poses in the world."""
    T_world_rig = inverse(T_rig_world)
    return tuple(replace(c, T_world_cam=T_world_rig @ c.T_world_cam) for c in cameras)


def centroid_columns(rig: CalibratedRig) -> tuple[str, ...]:
    """Return the columns of centroids: u_left_px,v_left_px,u_right_px,v_right_px."""
    return tuple(f"{axis}_{c.name}_px" for c in rig.cameras for axis in "uv")


def centroids_in(sources: Sequence[ImageSource], count: int) -> Array:
    """Return the centroid of the ball in the first frames of cameras, shape (count, 2 cameras).

    NaN where no ball is seen whole. What all images have in common is the background.
    """
    out = np.full((count, 2 * len(sources)), np.nan)
    for k, source in enumerate(sources):
        frames = [frame for _ in range(count) if (frame := source.read()) is not None]
        if len(frames) < count:
            wanted = f"{count} images, one a row of --hand"
            raise InputError(source.name, wanted, len(frames))
        segmenter = Segmenter()
        if len(frames) >= _FEWEST_LOOKS:
            segmenter.learn_background(mean_background([frame.pixels for frame in frames]))
        for n, frame in enumerate(frames):
            segmenter.forget_target()  # the hand jumps from place to place
            m = segmenter.step(frame)
            if m.found and not m.clipped:
                out[n, 2 * k : 2 * k + 2] = m.u, m.v
    return out


def hand_problem(
    rig: CalibratedRig, p_world: Array, centroids: Array, radius: float
) -> HandProblem:
    """Return the problem at its first guess, of a rig in a frame of its own.

    Ball centres ``p_world`` have shape (k, 3) [m]; centroids are u and v of each camera [px], NaN
    where there is none, shape (k, 2 cameras); ``radius`` is the ball's [m].
    """
    straight = np.stack(
        [c.lens.straighten(centroids[:, 2 * k : 2 * k + 2]) for k, c in enumerate(rig.cameras)],
        axis=1,
    )
    triangulator = Triangulator(rig.rig(), radius, TriangulatorConfig(max_residual=20.0))
    found, seen = [], []
    for n, points in enumerate(straight):
        moments = tuple(
            Moments(
                t=0.0, camera=k, found=bool(np.isfinite(uv).all()), area=100.0, u=uv[0], v=uv[1]
            )
            for k, uv in enumerate(points)
        )
        sighting = triangulator.step(moments)
        if sighting.found:
            found.append(n)
            seen.append(sighting.r_o)
    T = _first_pose(np.array(seen).reshape(-1, 3), p_world[found])
    good = np.isfinite(straight).all(axis=2)
    place, camera = np.nonzero(good)
    return HandProblem(
        cameras=rig.rig().cameras,
        camera=camera,
        p_world=p_world[place],
        uv=straight[good],
        radius=radius,
        T_rig_world=T,
    )


def calibrate_hand(
    rig: CalibratedRig, places: Array, centroids: Array, *, radius: float
) -> tuple[CalibratedRig, Fit[HandProblem], CalibrationStage]:
    """Return the rig in the robot's frame, the solution, and what to say about it."""
    solved = fit(hand_problem(rig, places, centroids, radius), robust=True)
    advice = "hold the ball at places farther apart, in all three directions"
    limits = dict.fromkeys(solved.problem.names, (0.005, advice))
    warnings = list(weak(solved, limits))
    if solved.outliers > 0.25:
        warnings.append(
            f"{100 * solved.outliers:.0f} % of the centroids do not fit: wrong rows, another "
            "bright thing in view, or a wrong rig"
        )
    if solved.sigma > 3.0:
        warnings.append(
            f"the places fit to {solved.sigma:.1f} px only: check the arm's angles, "
            "the ball's radius, and left and right"
        )
    sigma = np.sqrt(np.diag(solved.covariance))
    numbers = {
        "places": len(places),
        "centroids": len(solved.problem.camera),
        "rms_px": solved.rms,
        "sigma_px": solved.sigma,
        "outliers": solved.outliers,
        "turn_sigma_mrad": 1e3 * float(sigma[:3].max()),
        "position_sigma_mm": 1e3 * float(sigma[3:].max()),
    }
    moved = rig.seen_from(inverse(solved.problem.T_rig_world), "robot")
    return moved, solved, CalibrationStage("hand", solved.status, numbers, tuple(warnings))


def read_places(path: Path, arm: Arm, others: Sequence[str]) -> tuple[Array, Array]:
    """Return places of the catch point [m], shape (n, 3), and the other columns of a table.

    The places stand in ``x_m,y_m,z_m``, or follow from joint angles in a column for each active
    joint of the arm, ``q1_rad,q2_rad,...`` in its order. Centroids may be NaN.
    """
    joints = tuple(f"q{k + 1}_rad" for k in range(arm.n))
    by_angles = "q1_rad" in header_of(path)
    names = joints if by_angles else POINT
    table = read_table(path, (*names, *others), seen=[x for x in others if x != "t_s"])
    places, rest = table[:, : len(names)], table[:, len(names) :]
    if by_angles:
        places = np.array([arm.position(q) for q in places])
    return places, rest


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ClockProblem:
    """Two records of one motion, and the offset that should lay them on each other.

    Attributes:
        t_seen: Times of the sightings, cameras' clock [s], shape (n,).
        seen: Ball [m], shape (n, 3).
        t_arm: Times of the hand, arm's clock, rising [s], shape (m,).
        hand: Catch point [m], shape (m, 3).
        offset: Arm's clock minus cameras' clock [s].
        gap: Ball minus catch point [m], shape (3,).
    """

    t_seen: Array
    seen: Array
    t_arm: Array
    hand: Array
    offset: float = 0.0
    gap: Array

    @property
    def names(self) -> tuple[str, ...]:
        """The offset and the gap."""
        return ("offset", "gap_x", "gap_y", "gap_z")

    def residuals(self) -> Array:
        """Return seen minus predicted [m], shape (3 n,)."""
        return np.asarray((self.seen - self._at(self.hand) - self.gap).ravel())

    def jacobian(self) -> Array:
        """Return the derivative of the predicted positions, shape (3 n, 4)."""
        J = np.zeros((len(self.t_seen), 3, 4))
        J[:, :, 0] = self._at(np.gradient(self.hand, self.t_arm, axis=0))
        J[:, :, 1:] = np.eye(3)
        return J.reshape(-1, 4)

    def moved(self, step: Array) -> "ClockProblem":
        """Return the problem with offset and gap moved by a step."""
        return replace(self, offset=self.offset + float(step[0]), gap=self.gap + step[1:])

    def _at(self, values: Array) -> Array:
        """Return what the arm's log says at the sightings, shape (n, 3)."""
        t = self.t_seen + self.offset
        return np.column_stack([np.interp(t, self.t_arm, v) for v in values.T])


def clock_problem(
    *, t_seen: Array, seen: Array, t_arm: Array, hand: Array, search: float
) -> ClockProblem:
    """Return the problem at the best of many offsets, with the sightings inside the arm's log.

    Args:
        t_seen: Times of the sightings, cameras' clock [s], shape (n,).
        seen: Ball [m], shape (n, 3).
        t_arm: Times of the hand, arm's clock, rising [s], shape (m,).
        hand: Catch point [m], shape (m, 3).
        search: Largest offset looked for, either way [s].

    Raises:
        InputError: At no offset do the records overlap by 20 sightings.
    """
    if len(t_arm) < _FEWEST_SIGHTINGS:
        raise InputError("arm log", f"{_FEWEST_SIGHTINGS} rows or more", len(t_arm))
    best: tuple[float, ClockProblem] | None = None
    for offset in np.arange(-search, search + _SEARCH, _SEARCH):
        t = t_seen + offset
        inside = (t > t_arm[0] + _SEARCH) & (t < t_arm[-1] - _SEARCH)
        if inside.sum() < max(min(_FEWEST_SIGHTINGS, len(t_seen)), 0.5 * len(t_seen)):
            continue
        trial = ClockProblem(
            t_seen=t_seen[inside],
            seen=seen[inside],
            t_arm=t_arm,
            hand=hand,
            offset=float(offset),
            gap=np.zeros(3),
        )
        r = trial.residuals().reshape(-1, 3)
        gap = np.median(r, axis=0)
        cost = float(np.mean(np.abs(r - gap)))
        if best is None or cost < best[0]:
            best = (cost, replace(trial, gap=gap))
    if best is None or len(t_seen) < _FEWEST_SIGHTINGS:
        raise InputError(
            "clock offset",
            f"{_FEWEST_SIGHTINGS} sightings that overlap the arm's log within +-{search:g} s",
            f"{len(t_seen)} sightings",
            do="compare the times in both files or widen --search",
        )
    return best[1]


def calibrate_clock(
    rig: CalibratedRig, arm: Arm, *, log: Path, points: Path, search: float
) -> tuple[CalibratedRig, CalibrationStage]:
    """Return the rig with the offset of its clock, and what to say about it."""
    if rig.frame != "robot":
        raise InputError(
            "--arm-log",
            "a rig in the robot's frame",
            f"one in the {rig.frame}'s",
            do="calibrate with --hand first",
        )
    if not 0.0 < search <= 60.0:
        raise InputError("--search", "seconds in 0..60", search)
    hand, t_arm = read_places(log, arm, ("t_s",))
    table = read_table(points, ("t_s", *POINT), seen=POINT)
    t_seen, there = times_of(points, table), np.isfinite(table).all(axis=1)
    problem = clock_problem(
        t_seen=t_seen[there],
        seen=table[there, 1:],
        t_arm=times_of(log, t_arm),
        hand=hand,
        search=search,
    )
    solved = fit(problem, robust=True)
    advice = "move the hand faster, to and fro, 1 m/s or more"
    warnings = list(weak(solved, {"offset": (_CLOCK, advice)}))
    gap = float(np.linalg.norm(solved.problem.gap))
    if gap > 0.02:
        warnings.append(
            f"the ball seen and the hand are {1e3 * gap:.0f} mm apart: calibrate with --hand anew"
        )
    offset, sigma = solved.problem.offset, solved.sigma_of("offset")
    speed = np.linalg.norm(np.gradient(hand, problem.t_arm, axis=0), axis=1)
    numbers = {
        "sightings": len(problem.t_seen),
        "offset_ms": 1e3 * offset,
        "sigma_ms": 1e3 * sigma,
        "rms_mm": 1e3 * solved.rms,
        "gap_mm": 1e3 * gap,
        "top_speed_m_s": float(speed.max()),
    }
    known = replace(rig, clock_offset=offset, clock_sigma=sigma if np.isfinite(sigma) else 1e3)
    return known, CalibrationStage("clock", solved.status, numbers, tuple(warnings))


def catches_in(recorded: Recorded) -> Iterator[tuple[float, CatchSeen]]:
    """Yield what the stamps of each catch were corrected by [s], and the catch."""
    rows, numbers = recorded.ticks, recorded.numbers.tolist()
    begins = [k for k, n in enumerate(numbers) if "again" in recorded.calls.get(n, ())]
    ends = [*begins, len(rows)]
    for first, last in zip([0, *begins], ends, strict=True):
        calls = [name for n in numbers[first:last] for name in recorded.calls.get(n, ())]
        found = _catch(rows[first:last], [recorded.points(n) for n in numbers[first:last]])
        if found is not None:
            yield clock_in(calls), found


def _catch(rows: Rows, points: Sequence[tuple[Sighting, ...]]) -> CatchSeen | None:
    """Return what arm and eyes said of a throw's catch; None where the arm never braked for one."""
    braked = np.flatnonzero(rows["out_phase"] == BRAKE)
    if len(braked) == 0:
        return None
    n = rows["q"].shape[1]
    told = np.abs(rows["command"].reshape(len(rows), 4, n)[:, 1]).max(axis=1)
    rests = braked[told[braked] < 1e-9]
    seen = rows["out_sighted"].astype(bool)
    t, table = rows["out_t_sighted"][seen], rows["sighting"][seen].reshape(-1, 4, 3)
    given = [p for several in points for p in several if p.found]
    if given:
        t = np.array([p.t for p in given])
        table = np.array([np.vstack([p.r_o, p.covariance]) for p in given])
    return CatchSeen(
        t_arm=rows["t_arm"],
        q=rows["q"],
        t_seen=t,
        seen=table[:, 0],
        covariance=table[:, 1:],
        t_brake=float(rows["t"][braked[0]]),
        t_rest=float(rows["t"][rests[0] if len(rests) else braked[-1]]),
    )


def calibrate_by_catches(
    rig: CalibratedRig, paths: Sequence[Path]
) -> tuple[CalibratedRig, CalibrationStage]:
    """Return the rig with the offset of its clock, and what to say about it."""
    clock, tried, left = LearnedClock(), 0, list[float]()
    for path in paths:
        recorded = Recorded(path)
        for used, catch in catches_in(recorded):
            found = caught_offset(recorded.about.arm, catch)
            tried += 1
            clock.take(found, used)
            left += [] if found.unknown else [found.residual]
    if clock.count == 0:
        raise InputError(
            "--catches",
            "recordings in which a ball rides on the braking hand",
            f"{tried} catches that say nothing of the clocks",
        )
    numbers = {
        "catches": clock.count,
        "tried": tried,
        "offset_ms": 1e3 * clock.offset,
        "sigma_ms": 1e3 * clock.sigma,
        "rms_mm": 1e3 * float(np.sqrt(np.mean(np.square(left)))),
    }
    weak = clock.sigma > _CLOCK
    warnings = ("offset is uncertain: record more catches",) if weak else ()
    known = replace(rig, clock_offset=clock.offset, clock_sigma=clock.sigma)
    return known, CalibrationStage("clock", "converged", numbers, warnings)
