"""The scene as one MuJoCo model: floor, arm, hand, ball."""

from dataclasses import dataclass
from itertools import combinations

import mujoco
import numpy as np

from mitt.errors import ModelError
from mitt.robot.basket import Basket
from mitt.robot.description import ArmModel
from mitt.robot.hands import HandModel
from mitt.robot.plant import add_arm
from mitt.world.basket import add_basket
from mitt.world.engine import stop_clocks
from mitt.world.hand import ARM, BALL, FLOOR, FRICTION, HAND, SMALL_PARTS, STIFF, add_hand
from mitt.world.materials import contact_of, friction_of
from mitt.world.scene import Scene

#: Simulation step near a contact [s]; two make a control tick.
STEP = 0.0005

_ORANGE = (0.95, 0.45, 0.10, 1.0)
_WHITE = (0.93, 0.94, 0.95, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SceneModel:
    """A compiled scene and where its parts are.

    Degrees of freedom and motors come in the order arm (n), fingers (f), ball.

    Attributes:
        model: The compiled model; a world copies it before it changes masses.
        joints: Number n of active joints.
        fingers: Number f of finger joints.
        ball: Index of the ball's geom.
        site: Index of the catch point's site.
    """

    model: mujoco.MjModel
    joints: int
    fingers: int
    ball: int
    site: int


def build_scene(scene: Scene, arm: ArmModel) -> SceneModel:
    """Compile a scene.

    Raises:
        ModelError: The arm carries no hand.
    """
    _silence()
    stop_clocks()
    spec, fingers = describe(scene, arm)
    model = spec.compile()
    return SceneModel(
        model=model,
        joints=len(arm.names),
        fingers=fingers,
        ball=mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, "ball"),
        site=mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, "catch_point"),
    )


def describe(scene: Scene, arm: ArmModel) -> tuple[mujoco.MjSpec, int]:
    """Return a scene as MuJoCo describes it, with kinds that say what may meet, and its fingers.

    Raises:
        ModelError: The arm carries no hand.
    """
    if arm.hand is None:
        raise ModelError(f"arm {arm.name}", "a hand or a basket", "none")
    spec = _spec()
    _add_floor(spec, scene)
    kinds = {geom.name for geom in spec.geoms}
    plate = add_arm(spec, arm)
    for geom in spec.geoms:
        if geom.name not in kinds:
            geom.contype, geom.conaffinity, geom.solref = ARM, ARM | HAND | FLOOR, STIFF
    for joint in spec.joints:
        joint.solref_limit = STIFF
    fingers: tuple[str, ...] = ()
    if isinstance(arm.hand, Basket):
        add_basket(plate, arm.hand)
    elif isinstance(arm.hand, HandModel):
        fingers = add_hand(spec, plate, arm.hand)
    _add_ball(spec, scene)
    _let_neighbours_meet(spec, arm)
    return spec, len(fingers)


def _silence() -> None:
    """Keep MuJoCo from writing its warnings to a log file in the caller's folder.

    They are counted in the data, and a world reads them there. A handler that somebody else has
    set is left alone.
    """
    if mujoco.get_mju_user_warning() is None:
        mujoco.set_mju_user_warning(lambda _: None)


def _spec() -> mujoco.MjSpec:
    """Return an empty model with the solver that carries a ball into fingers."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = STEP
    # No joint and no motor has damping of its own: the cheapest integrator is the implicit one.
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    off = mujoco.mjtDisableBit
    # With so few bodies and contacts, bounding trees and islands cost more than they save.
    spec.option.disableflags |= off.mjDSBL_AUTORESET | off.mjDSBL_MIDPHASE | off.mjDSBL_ISLAND
    # Friction and drag are ours (servo.py); of springs and dampers there are none to look for.
    spec.option.disableflags |= off.mjDSBL_SPRING | off.mjDSBL_DAMPER
    return spec


def _add_floor(spec: mujoco.MjSpec, scene: Scene) -> None:
    """Add the floor."""
    geom = spec.worldbody.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[6.0, 6.0, 0.1],
        pos=[0.0, 0.0, scene.floor],
        rgba=_WHITE,
    )
    geom.contype, geom.conaffinity = FLOOR, BALL | ARM | HAND


def _add_ball(spec: mujoco.MjSpec, scene: Scene) -> None:
    """Add the ball; its contact settings go before those of what it touches."""
    body = spec.worldbody.add_body(name="ball")
    body.add_freejoint(name="ball")
    geom = body.add_geom(
        name="ball",
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[scene.ball.radius, 0.0, 0.0],
        mass=scene.ball.mass,
        rgba=_ORANGE,
    )
    geom.contype, geom.conaffinity = BALL, HAND | ARM | FLOOR
    geom.condim, geom.priority = 4, 1
    geom.friction = (friction_of(scene), *FRICTION[1:])
    geom.solref = contact_of(scene)


def _let_neighbours_meet(spec: mujoco.MjSpec, arm: ArmModel) -> None:
    """Let shapes of successive links meet, which MuJoCo leaves out by default.

    Only those that stand apart in the ready pose: files of other arms have shapes that overlap
    at the joints. Links further apart whose shapes overlap there are kept from meeting: capsules
    about the meshes of a wrist are wider than the wrist.
    """
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[: len(arm.q_ready)] = arm.q_ready
    mujoco.mj_kinematics(model, data)
    own = np.flatnonzero((model.geom_contype & (ARM | HAND)) != 0)
    overlapping: set[tuple[str, str]] = set()
    for first, second in combinations(own, 2):
        names = model.geom(int(first)).name, model.geom(int(second)).name
        bodies = [model.body_weldid[model.geom_bodyid[g]] for g in (first, second)]
        parents = [model.body_weldid[model.body_parentid[b]] for b in bodies]
        kindred = parents[0] == bodies[1] or parents[1] == bodies[0]
        moving = bodies[0] != bodies[1] and 0 not in bodies
        apart = mujoco.mj_geomDistance(model, data, int(first), int(second), 1.0, None) > 0.0
        arms = all(model.geom_contype[g] == ARM for g in (first, second))
        if not apart and arms and bodies[0] != bodies[1] and not (kindred and moving):
            both = [model.body(model.geom_bodyid[g]).name for g in (first, second)]
            overlapping.add((both[0], both[1]))
        if not (kindred and moving) or any(name.startswith(SMALL_PARTS) for name in names):
            continue
        if apart:
            spec.add_pair(geomname1=names[0], geomname2=names[1]).solref = STIFF
    for bodies_apart in sorted(overlapping):
        spec.add_exclude(bodyname1=bodies_apart[0], bodyname2=bodies_apart[1])
