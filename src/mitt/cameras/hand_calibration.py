"""Where the rig stands before the robot, and how far its clock is off.

Both from a ball in the hand; the clock also from recorded catches, where the ball rides on the
braking hand.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mitt.arm.arm import Arm
from mitt.cameras.cameras import Camera
from mitt.cameras.least_squares import Fit, fit
from mitt.cameras.stages import POINT, Stage, read_columns, read_places, times_of, weak
from mitt.catcher.settings import BRAKE
from mitt.errors import InputError
from mitt.eyes.camera import inverse
from mitt.eyes.clock_offset import Catch, LearnedClock, caught_offset, clock_problem
from mitt.eyes.rig_calibration import HandProblem, first_pose
from mitt.eyes.segmentation import Segmenter
from mitt.eyes.triangulation import Triangulator, TriangulatorConfig
from mitt.files.messages import Rows, clock_in
from mitt.files.recordings import Recorded
from mitt.files.rig import CalibratedRig
from mitt.signals import Array, Moments, Sighting

#: Residual at which a pair of centroids does not give a first guess [px].
_FIRST_RESIDUAL = 20.0
#: Share of outliers, and error of the clock [s], that are worth a warning.
_MANY, _CLOCK = 0.25, 5e-4
#: Commanded speed below which an arm is told to rest [rad/s].
_REST = 1e-9


def centroid_columns(rig: CalibratedRig) -> tuple[str, ...]:
    """Return the columns of centroids: u_left_px,v_left_px,u_right_px,v_right_px."""
    return tuple(f"{axis}_{c.name}_px" for c in rig.cameras for axis in "uv")


def centroids_in(sources: Sequence[Camera], count: int) -> Array:
    """Return the centroid of the ball in the first frames of cameras, shape (count, 2 cameras).

    NaN where no ball is seen whole.
    """
    out = np.full((count, 2 * len(sources)), np.nan)
    for k, source in enumerate(sources):
        segmenter = Segmenter()
        for n in range(count):
            frame = source.read()
            if frame is None:
                raise InputError(source.name, f"{count} images, one a row of --hand", n)
            segmenter.reset()  # the hand jumps from place to place
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
    triangulator = Triangulator(rig.rig(), radius, TriangulatorConfig(max_residual=_FIRST_RESIDUAL))
    found, seen = [], []
    for n, points in enumerate(straight):
        moments = tuple(
            Moments(t=0.0, camera=k, found=bool(np.isfinite(uv).all()), area=100.0, u=uv[0],
                    v=uv[1])
            for k, uv in enumerate(points)
        )  # fmt: skip
        sighting = triangulator.step(moments)
        if sighting.found:
            found.append(n)
            seen.append(sighting.r_o)
    T = first_pose(np.array(seen).reshape(-1, 3), p_world[found])
    good = np.isfinite(straight).all(axis=2)
    place, camera = np.nonzero(good)
    return HandProblem(
        cameras=rig.rig().cameras, camera=camera, p_world=p_world[place], uv=straight[good],
        radius=radius, T_rig_world=T,
    )  # fmt: skip


def calibrate_hand(
    rig: CalibratedRig, places: Array, centroids: Array, *, radius: float
) -> tuple[CalibratedRig, Fit[HandProblem], Stage]:
    """Return the rig in the robot's frame, the solution, and what to say about it."""
    solved = fit(hand_problem(rig, places, centroids, radius), robust=True)
    advice = "hold the ball at places farther apart, in all three directions"
    limits = dict.fromkeys(solved.problem.names, (0.005, advice))
    warnings = list(weak(solved, limits))
    if solved.outliers > _MANY:
        warnings.append(
            f"{100 * solved.outliers:.0f} % of the centroids do not fit: wrong rows, another "
            "bright thing in view, or a wrong rig"
        )
    if solved.sigma > 3.0:
        warnings.append(f"the places fit to {solved.sigma:.1f} px only: check the arm's angles, "
                        "the ball's radius, and left and right")  # fmt: skip
    sigma = np.sqrt(np.diag(solved.covariance))
    numbers = {
        "places": len(places), "centroids": len(solved.problem.camera), "rms_px": solved.rms,
        "sigma_px": solved.sigma, "outliers": solved.outliers,
        "turn_sigma_mrad": 1e3 * float(sigma[:3].max()),
        "position_sigma_mm": 1e3 * float(sigma[3:].max())
    }  # fmt: skip
    moved = rig.seen_from(inverse(solved.problem.T_rig_world), "robot")
    return moved, solved, Stage("hand", solved.status, numbers, tuple(warnings))


def calibrate_clock(
    rig: CalibratedRig, arm: Arm, *, log: Path, points: Path, search: float
) -> tuple[CalibratedRig, Stage]:
    """Return the rig with the offset of its clock, and what to say about it."""
    if rig.frame != "robot":
        raise InputError("--arm-log", "a rig in the robot's frame", f"one in the {rig.frame}'s",
                         do="calibrate with --hand first")  # fmt: skip
    if not 0.0 < search <= 60.0:
        raise InputError("--search", "seconds in 0..60", search)
    hand, t_arm = read_places(log, arm, ("t_s",))
    seen = read_columns(points, ("t_s", *POINT))
    problem = clock_problem(
        t_seen=times_of(points, seen), seen=seen[:, 1:], t_arm=times_of(log, t_arm),
        hand=hand, search=search,
    )  # fmt: skip
    solved = fit(problem, robust=True)
    advice = "move the hand faster, to and fro, 1 m/s or more"
    warnings = list(weak(solved, {"offset": (_CLOCK, advice)}))
    gap = float(np.linalg.norm(solved.problem.gap))
    if gap > 0.02:
        warnings.append(f"the ball seen and the hand are {1e3 * gap:.0f} mm apart: "
                        "calibrate with --hand anew")  # fmt: skip
    offset, sigma = solved.problem.offset, solved.sigma_of("offset")
    speed = np.linalg.norm(np.gradient(hand, problem.t_arm, axis=0), axis=1)
    numbers = {
        "sightings": len(problem.t_seen), "offset_ms": 1e3 * offset, "sigma_ms": 1e3 * sigma,
        "rms_mm": 1e3 * solved.rms, "gap_mm": 1e3 * gap, "top_speed_m_s": float(speed.max())
    }  # fmt: skip
    known = replace(rig, clock_offset=offset, clock_sigma=sigma if np.isfinite(sigma) else 1e3)
    return known, Stage("clock", solved.status, numbers, tuple(warnings))


def catches_in(recorded: Recorded) -> Iterator[tuple[float, Catch]]:
    """Yield what the stamps of each catch were corrected by [s], and the catch."""
    rows, numbers = recorded.ticks, recorded.numbers.tolist()
    begins = [k for k, n in enumerate(numbers) if "again" in recorded.calls.get(n, ())]
    ends = [*begins, len(rows)]
    for first, last in zip([0, *begins], ends, strict=True):
        calls = [name for n in numbers[first:last] for name in recorded.calls.get(n, ())]
        found = _catch(rows[first:last], [recorded.points(n) for n in numbers[first:last]])
        if found is not None:
            yield clock_in(calls), found


def _catch(rows: Rows, points: Sequence[tuple[Sighting, ...]]) -> Catch | None:
    """Return what arm and eyes said of a throw's catch; None where the arm never braked for one."""
    braked = np.flatnonzero(rows["out_phase"] == BRAKE)
    if len(braked) == 0:
        return None
    n = rows["q"].shape[1]
    told = np.abs(rows["command"].reshape(len(rows), 4, n)[:, 1]).max(axis=1)
    rests = braked[told[braked] < _REST]
    seen = rows["out_sighted"].astype(bool)
    t, table = rows["out_t_sighted"][seen], rows["sighting"][seen].reshape(-1, 4, 3)
    given = [p for several in points for p in several if p.found]
    if given:
        t = np.array([p.t for p in given])
        table = np.array([np.vstack([p.r_o, p.covariance]) for p in given])
    return Catch(
        t_arm=rows["t_arm"], q=rows["q"], t_seen=t, seen=table[:, 0], covariance=table[:, 1:],
        t_brake=float(rows["t"][braked[0]]),
        t_rest=float(rows["t"][rests[0] if len(rests) else braked[-1]]),
    )  # fmt: skip


def calibrate_by_catches(rig: CalibratedRig, paths: Sequence[Path]) -> tuple[CalibratedRig, Stage]:
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
        raise InputError("--catches", "recordings in which a ball rides on the braking hand",
                         f"{tried} catches that say nothing of the clocks")  # fmt: skip
    numbers = {
        "catches": clock.count, "tried": tried, "offset_ms": 1e3 * clock.offset,
        "sigma_ms": 1e3 * clock.sigma, "rms_mm": 1e3 * float(np.sqrt(np.mean(np.square(left)))),
    }  # fmt: skip
    weak = clock.sigma > _CLOCK
    warnings = ("offset is uncertain: record more catches",) if weak else ()
    known = replace(rig, clock_offset=clock.offset, clock_sigma=clock.sigma)
    return known, Stage("clock", "converged", numbers, warnings)
