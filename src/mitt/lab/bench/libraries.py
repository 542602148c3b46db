"""What a tick costs by other libraries, each doing its part of the work with a new target.

Each part is one callable that makes one tick: Ruckig towards a catch that has moved, inverse
kinematics of mink and pink, eyes and filter of OpenCV, one plan of the model-predictive rival.
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import cycle
from typing import Any, TypeAlias

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.arm.description import ArmModel, transform
from mitt.core.ball.flight import acceleration, advance
from mitt.core.eyes.camera import fixed_rig
from mitt.core.map.foresight import foresee
from mitt.core.map.mapping import DirectMap
from mitt.core.map.prediction import flown
from mitt.core.signals import GRAVITY, TICK, Array, BallState, Frame
from mitt.lab.world.plant import add_arm
from mitt.lab.world.throws import Throw

#: One tick of a rival.
Tick: TypeAlias = Callable[[], object]
#: A model of Pinocchio.
Pinocchio: TypeAlias = Any
#: Drag of the ball [1/m].
_DRAG = 0.04
#: Weight of the posture beside the place of the hand [1/rad].
_POSTURE = 1e-3


def ball_at(throw: Throw, t: float, *, sigma: float = 1e-3) -> BallState:
    """Return a thrown ball, known exactly, some time after its release [s].

    It is said to be known to ``sigma`` [m, m/s].
    """
    r, dr, ddr = throw.r.copy(), throw.dr.copy(), np.zeros(3)
    advance(r, dr, _DRAG, t)
    acceleration(dr, _DRAG, ddr)
    return BallState(
        t=t,
        tracked=True,
        r_o=r,
        dr_o=dr,
        ddr_o=ddr,
        drag=_DRAG,
        covariance=sigma**2 * np.eye(6),
        t_seen=t,
        t_first=0.0,
    )


def catches(f: DirectMap, ball: BallState, rng: np.random.Generator) -> Iterator[Array]:
    """Yield the joint motion at the catch, (3, n), a little different each time, without end."""
    seen = foresee(f, ball)
    end = f.motion(flown(ball, np.array([seen.after]))[0])[1][:3]
    ends = [end + 1e-3 * rng.standard_normal(end.shape) for _ in range(100)]
    return cycle(ends)


def places(ball: BallState) -> Iterator[Array]:
    """Yield places near the catch for a hand to be at [m], shape (3,), without end."""
    return cycle([*flown(ball, np.linspace(0.35, 0.45, 100))[:, 0]])


def by_ruckig(arm: Arm, ends: Iterator[Array]) -> Tick:
    """Retarget an online trajectory to each catch."""
    from ruckig import InputParameter, OutputParameter, Ruckig  # noqa: PLC0415 (timed alone)

    otg, given, out = Ruckig(arm.n, TICK), InputParameter(arm.n), OutputParameter(arm.n)
    given.current_position, given.current_velocity = list(arm.q_ready), [0.0] * arm.n
    given.current_acceleration = [0.0] * arm.n
    given.max_velocity = list(arm.dq_max)
    given.max_acceleration = list(arm.tau_max / np.diag(arm.mass_matrix(arm.q_ready)))
    given.max_jerk = [50.0 * a for a in given.max_acceleration]

    def tick() -> None:
        end = next(ends)
        given.target_position = list(end[0])
        given.target_velocity = list(np.clip(end[1], -0.9 * arm.dq_max, 0.9 * arm.dq_max))
        otg.update(given, out)

    return tick


def by_mink(arm: Arm, places: Iterator[Array]) -> Tick:
    """Follow the ball with the hand: mink's differential inverse kinematics, solved by DAQP."""
    import mink  # noqa: PLC0415 (an extra)
    import mujoco  # noqa: PLC0415 (heavy)

    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    add_arm(spec, arm.model)
    model = spec.compile()
    at = mink.Configuration(model)
    at.update(np.array(arm.q_ready))
    hand = mink.FrameTask("catch_point", "site", position_cost=1.0, orientation_cost=0.0)
    posture = mink.PostureTask(model, cost=_POSTURE)
    posture.set_target(np.array(arm.q_ready))
    limits = [mink.ConfigurationLimit(model)]

    def tick() -> None:
        hand.set_target(mink.SE3.from_translation(next(places)))
        v = mink.solve_ik(at, [hand, posture], TICK, "daqp", limits=limits)
        at.integrate_inplace(v, TICK)

    return tick


def by_pink(arm: Arm, places: Iterator[Array]) -> Tick:
    """Follow the ball with the hand: Pink's differential inverse kinematics, solved by DAQP."""
    import pink  # noqa: PLC0415 (an extra)
    import pinocchio as pin  # noqa: PLC0415 (an extra)

    model = to_pinocchio(arm.model)
    links = arm.model.links
    model.lowerPositionLimit = np.array([link.q_min for link in links])
    model.upperPositionLimit = np.array([link.q_max for link in links])
    model.velocityLimit = arm.limits.dq_max.copy()
    q = arm.all_joints(arm.q_ready)
    at = pink.Configuration(model, model.createData(), q)
    hand = pink.FrameTask("catch_point", position_cost=1.0, orientation_cost=0.0)
    posture = pink.PostureTask(cost=_POSTURE)
    posture.set_target(q)

    def tick() -> None:
        hand.set_target(pin.SE3(np.eye(3), next(places)))
        v = pink.solve_ik(at, [hand, posture], TICK, solver="daqp", safety_break=False)
        at.integrate_inplace(v, TICK)

    return tick


def to_pinocchio(model: ArmModel) -> Pinocchio:
    """Build the Pinocchio model of all links, held joints included as joints."""
    import pinocchio as pin  # noqa: PLC0415 (an extra)

    built = pin.Model()
    built.name = model.name
    parent, T = 0, model.mount
    for link in model.links:
        joint = (
            pin.JointModelPrismaticUnaligned if link.prismatic else pin.JointModelRevoluteUnaligned
        )(link.axis)
        parent = built.addJoint(parent, joint, pin.SE3(T @ link.placement), link.name)
        inertia = pin.Inertia(link.mass, link.com, link.inertia)
        built.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
        T = transform()
    tip = transform(model.tool[:3, :3], model.catch_point)
    built.addFrame(pin.Frame("catch_point", parent, 0, pin.SE3(tip), pin.FrameType.OP_FRAME))
    built.armature = np.array([link.armature for link in model.links])
    built.gravity.linear = np.array([0.0, 0.0, -GRAVITY])
    return built


def by_opencv(kept: Sequence[tuple[Frame, ...]]) -> Tick:
    """See and estimate: threshold and moments in both images, triangulation, Kalman filter."""
    import cv2  # noqa: PLC0415 (an extra)

    matrices, frames = [], cycle(kept)
    for c in fixed_rig().cameras:
        K = np.array(((c.f_px, 0, c.cu), (0, c.f_px, c.cv), (0, 0, 1)))
        matrices.append(K @ np.linalg.inv(c.T_world_cam)[:3])
    kalman = cv2.KalmanFilter(6, 3, 0, cv2.CV_64F)
    kalman.measurementMatrix = np.eye(3, 6)

    def tick() -> None:
        points = []
        for frame in next(frames):
            _, binary = cv2.threshold(frame.pixels, 60, 255, cv2.THRESH_BINARY)
            m = cv2.moments(binary, True)
            mass = max(m["m00"], 1.0)
            points.append(np.array(((m["m10"] / mass,), (m["m01"] / mass,))))
        p = cv2.triangulatePoints(matrices[0], matrices[1], points[0], points[1])
        kalman.predict()
        kalman.correct((p[:3] / p[3]).reshape(3, 1))

    return tick


def by_mpc(f: DirectMap, ball: BallState) -> Tick:
    """Plan once to the catch by the model-predictive rival, a programme solved by DAQP."""
    from mitt.lab.rivals.mpc import MpcPlanner, MpcSettings, solve  # noqa: PLC0415 (timed alone)

    planner, ends = MpcPlanner(f.arm, MpcSettings()), catches(f, ball, np.random.default_rng(0))
    start = np.array([f.arm.q_ready, np.zeros(f.arm.n), np.zeros(f.arm.n)])
    step = foresee(f, ball).after / planner.settings.parts
    return lambda: solve(planner.problem(start, next(ends), step))
