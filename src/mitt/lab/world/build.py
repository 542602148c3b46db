"""The scene as one MuJoCo model: floor, arm, hand, ball, and how a trial's plant differs from it.

A ball's restitution is measured on a hard, heavy surface. On a soft pad both are compressed, each
gives back its own share of the energy, and what is given back of both is

    e^2 = (e_ball^2 + e_pad^2) / 2

where both are compressed alike: a choice of this project, as is the friction of all materials.

On a paddle the contact is a spring and a damper along the normal, in MuJoCo's direct form: what
follows is the relative motion of ball and face, whatever their masses, and both are pushed as the
arm's inertia lets them. How much damping gives a restitution is known in closed form
(:func:`restitution_of_damped`). Along the face acts :mod:`mitt.lab.world.rubber`, which sets the
damping, too, by the speed at which a ball comes.
"""

from dataclasses import dataclass
from itertools import combinations
from math import sqrt

import mujoco
import numpy as np

from mitt.core.arm.description import ArmModel
from mitt.core.arm.shapes import LEAST_GAP
from mitt.core.arm.tools import USUAL_SPEED, Paddle, inertia_share
from mitt.core.errors import ModelError
from mitt.core.kernels import record_of
from mitt.core.signals import TICK, Array
from mitt.lab.world.engine import owned, stop_clocks
from mitt.lab.world.hand_bodies import (
    ARM,
    BALL,
    FLOOR,
    FRICTION,
    HAND,
    SMALL_PARTS,
    STIFF,
    add_tool,
)
from mitt.lab.world.overlap import THICK
from mitt.lab.world.plant import add_arm
from mitt.lab.world.rubber import RUBBER, Rubber
from mitt.lab.world.scene import Belt, Material, Scene, Tray

#: Simulation step near a contact [s]; two make a control tick. With a paddle, whose contact is
#: harder, so many do.
STEP = 0.0005
_PADDLE_STEPS = 20

#: Deceleration by dry friction beyond which a light joint would tremble from step to step
#: [rad/s^2]: the speed at which that friction begins (mitt.lab.world.motion.STICTION_SPEED) in a
#: tick.
_STEADY = 50.0

#: Mass of a belt [kg]: nothing on it changes its speed.
_BELT_MASS = 1e5

_ORANGE = (0.95, 0.45, 0.10, 1.0)
_WHITE = (0.93, 0.94, 0.95, 1.0)

RESTITUTION: dict[Material, float] = {
    "foam": 0.61,
    "tennis": 0.75,
    "table-tennis": 0.90,
    "rubber": 0.92,
}
"""Coefficient of restitution of a ball dropped on a hard surface; the root of rebound over drop.

| material | source |
|---|---|
| foam | ITF, Approved Tennis Balls, stage 3 foam: rebounds 85 to 105 cm of 254: 0.58 to 0.64 |
| tennis | ITF Rules of Tennis, appendix I: rebounds 135 to 147 cm of 254: 0.73 to 0.76 |
| table-tennis | ITTF Technical Leaflet T3: 240 to 260 mm of 305 on steel: 0.89 to 0.92 |
| rubber | solid rubber, a Super Ball: 0.92 as sphaeralogy.org quotes it |
"""

FRICTION_ON_PAD: dict[Material, float] = {
    "foam": 1.0,
    "tennis": 0.8,
    "table-tennis": 0.5,
    "rubber": 1.0,
}
"""Coefficient of sliding friction on the hand's pads; choices of this project."""

PAD = 0.3
"""Restitution of the hand's pads, a soft urethane that damps; a choice of this project."""

#: What MuJoCo's contacts give back of a ball's speed, 3 to 6 m/s on the palm held still, measured
#: as ``tests/world/test_materials.py`` does: restitution, damping ratio, undamped angular frequency
#: of the contact [rad/s]. At 600 rad/s it lasts 5 ms, as of a tennis ball, and steps of 0.5 ms
#: carry it.
_CONTACTS = np.array([
    (0.171, 1.50, 450.0), (0.228, 1.20, 450.0), (0.272, 1.00, 450.0), (0.308, 0.85, 450.0),
    (0.346, 0.70, 450.0), (0.409, 0.60, 600.0), (0.454, 0.50, 600.0), (0.508, 0.40, 600.0),
    (0.581, 0.30, 600.0), (0.627, 0.25, 600.0), (0.689, 0.20, 600.0), (0.760, 0.15, 600.0),
    (0.839, 0.10, 600.0), (0.928, 0.06, 600.0),
])  # fmt: skip

#: How near to its spring and damper a contact with a paddle is held, in MuJoCo's terms.
_STIFF_IMPEDANCE = (0.9999, 0.9999, 0.001, 0.5, 2.0)

TOUCH: dict[Material, float] = {
    "foam": 0.005,
    "tennis": 0.005,
    "table-tennis": 0.001,
    "rubber": 0.003,
}
"""How long a ball and a paddle touch [s]: those of tennis as R. Cross, Am. J. Phys. 67, 222 (1999),
has it, those of table tennis as M. Hubbard and W. Stronge, Sports Eng. 4, 49 (2001); else choices.
"""

#: Sliding friction where nothing is said of the ball.
_PLAIN = 1.0


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
        fine: Simulation steps in a tick where a contact may begin.
    """

    model: mujoco.MjModel
    joints: int
    fingers: int
    ball: int
    site: int
    fine: int


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
        fine=_PADDLE_STEPS if isinstance(arm.hand, Paddle) else round(TICK / STEP),
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
    fingers = add_tool(spec, plate, arm.hand)
    _add_ball(spec, scene)
    if isinstance(arm.hand, Paddle):
        _add_rubber(spec, scene, arm.hand)
    if scene.belt is not None:
        _add_belt(spec, scene.belt)
    if scene.tray is not None:
        _add_tray(spec, scene.tray)
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
    # Friction and drag are ours (motion.py); of springs and dampers there are none to look for.
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
    sides = scene.ball.sides
    kind = mujoco.mjtGeom.mjGEOM_SPHERE if sides is None else mujoco.mjtGeom.mjGEOM_BOX
    size = [scene.ball.radius, 0.0, 0.0] if sides is None else [0.5 * x for x in sides]
    geom = body.add_geom(name="ball", type=kind, size=size, mass=scene.ball.mass, rgba=_ORANGE)
    geom.contype, geom.conaffinity = BALL, HAND | ARM | FLOOR
    if scene.ball.hollow:
        geom.typeinertia = mujoco.mjtGeomInertia.mjINERTIA_SHELL
    geom.condim, geom.priority = 4, 1
    geom.friction = (friction_of(scene), *FRICTION[1:])
    geom.solref = contact_of(scene)


def _add_rubber(spec: mujoco.MjSpec, scene: Scene, paddle: Paddle) -> None:
    """Say how the ball and a paddle's face touch."""
    frequency, damping = _swing_of(restitution_on(scene, paddle), paddle.touch)
    pair = spec.add_pair(geomname1="face", geomname2="ball")
    pair.condim, pair.solimp = 1, _STIFF_IMPEDANCE
    pair.solref = (-(frequency**2), -2.0 * damping)


def rubber_of(scene: Scene, paddle: Paddle, model: mujoco.MjModel, facing: Array) -> Rubber:
    """Return the rubber of a paddle for the ball of a scene, in a compiled model.

    Args:
        scene: The scene.
        paddle: The paddle.
        model: The model; the first of its pairs is that of face and ball.
        facing: Axes of the tool in MuJoCo's memory, shape (9,).
    """
    given = np.linspace(0.12, 0.99, 60)
    swings = np.array([_swing_of(e, paddle.touch) for e in given.tolist()])
    table = np.column_stack([given, -(swings[:, 0] ** 2), -2.0 * swings[:, 1]])
    ball, contact = scene.ball, scene.contact
    tangential = paddle.tangential if contact.tangential is None else contact.tangential
    lively = 1.0 / (1.0 + 1.0 / inertia_share(hollow=ball.hollow))
    numbers = {
        "acts": True,
        "restitution": restitution_on(scene, paddle),
        "fall": paddle.fall if contact.fall is None else contact.fall,
        "usual": USUAL_SPEED,
        "stiffness": lively * (float(np.arccos(-tangential)) / paddle.touch) ** 2,
        "friction": paddle.friction if contact.friction is None else contact.friction,
        "face": mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, "face"),
    }
    face = {mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, x) for x in ("face", "ball")}
    pairs = np.column_stack([model.pair_geom1, model.pair_geom2]).tolist()
    k = next(i for i, pair in enumerate(pairs) if set(pair) == face)
    solref = owned(model, model.pair_solref[k])
    return Rubber(record_of(numbers, RUBBER), solref, table, facing, np.zeros(3))


def _add_belt(spec: mujoco.MjSpec, belt: Belt) -> None:
    """Add a belt: a slab so heavy that nothing slows it, whose surface is set to a speed.

    It stays where it is: the world sets its place back in each tick, and what lies on it feels the
    speed of its surface alone.
    """
    place = [belt.middle[0], belt.middle[1], belt.height - 0.5 * THICK]
    body = spec.worldbody.add_body(name="belt", pos=place)
    body.quat = [np.cos(0.5 * belt.direction), 0.0, 0.0, np.sin(0.5 * belt.direction)]
    body.add_joint(name="belt", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[1.0, 0.0, 0.0])
    size = [0.5 * belt.length, 0.5 * belt.width, 0.5 * THICK]
    geom = body.add_geom(
        name="belt", type=mujoco.mjtGeom.mjGEOM_BOX, size=size, mass=_BELT_MASS, rgba=_WHITE
    )
    geom.contype, geom.conaffinity = FLOOR, BALL | ARM | HAND


def _add_tray(spec: mujoco.MjSpec, tray: Tray) -> None:
    """Add a tray: a slab that stands still."""
    geom = spec.worldbody.add_geom(
        name="tray",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[0.5 * tray.side, 0.5 * tray.side, 0.5 * THICK],
        pos=[*tray.middle, tray.height - 0.5 * THICK],
        rgba=_WHITE,
    )
    geom.contype, geom.conaffinity = FLOOR, BALL | ARM | HAND


def _let_neighbours_meet(spec: mujoco.MjSpec, arm: ArmModel) -> None:
    """Let shapes of successive links meet, which MuJoCo leaves out by default.

    Only those that stand apart in the ready pose, by as much as the catcher watches: files of
    other arms have shapes that overlap, or nearly, at the joints. Links further apart whose shapes
    overlap there are kept from meeting: capsules about the meshes of a wrist are wider than it.
    """
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[: len(arm.q_ready)] = arm.q_ready
    mujoco.mj_kinematics(model, data)
    own = np.flatnonzero((model.geom_contype & (ARM | HAND)) != 0)
    body, parent = model.body_weldid[model.geom_bodyid], model.body_weldid[model.body_parentid]
    is_arm, overlapping = model.geom_contype == ARM, set[tuple[str, str]]()
    for first, second in combinations(own.tolist(), 2):
        a, b = int(body[first]), int(body[second])
        kindred = (parent[a] == b or parent[b] == a) and 0 not in (a, b)
        if a == b or not (kindred or (is_arm[first] and is_arm[second])):
            continue
        names = model.geom(first).name, model.geom(second).name
        apart = mujoco.mj_geomDistance(model, data, first, second, 1.0, None)
        if not kindred and apart <= 0.0:
            both = [model.body(model.geom_bodyid[g]).name for g in (first, second)]
            overlapping.add((both[0], both[1]))
        elif kindred and apart > LEAST_GAP and not any(x.startswith(SMALL_PARTS) for x in names):
            spec.add_pair(geomname1=names[0], geomname2=names[1]).solref = STIFF
    for bodies_apart in sorted(overlapping):
        spec.add_exclude(bodyname1=bodies_apart[0], bodyname2=bodies_apart[1])


def friction_of(scene: Scene) -> float:
    """Return the coefficient of sliding friction of ball and hand."""
    if scene.contact.friction is not None:
        return scene.contact.friction
    return _PLAIN if scene.ball.material is None else FRICTION_ON_PAD[scene.ball.material]


def restitution_of(scene: Scene) -> float | None:
    """Return the coefficient of restitution of ball and hand; None where nothing is said of it."""
    if scene.contact.restitution is not None:
        return scene.contact.restitution
    return None if scene.ball.material is None else on_pad(scene.ball.material)


def on_pad(material: Material) -> float:
    """Return the restitution of a ball of some material on the hand's pads."""
    return sqrt(0.5 * (RESTITUTION[material] ** 2 + PAD**2))


def contact_of(scene: Scene) -> tuple[float, float]:
    """Return time constant [s] and damping ratio of the ball's contacts, as MuJoCo takes them."""
    restitution = restitution_of(scene)
    if restitution is None:
        return scene.contact.settle, 1.0
    gives, ratio, frequency = _CONTACTS.T
    damping = float(np.interp(restitution, gives, ratio))
    return 1.0 / (damping * float(np.interp(restitution, gives, frequency))), damping


def restitution_on(scene: Scene, paddle: Paddle) -> float:
    """Return the coefficient of restitution of ball and paddle: that of the scene, if it says it.

    Of ball and rubber both compressed alike otherwise; of the rubber where the ball says nothing.
    """
    if scene.contact.restitution is not None:
        return scene.contact.restitution
    if scene.ball.material is None:
        return paddle.restitution
    return sqrt(0.5 * (RESTITUTION[scene.ball.material] ** 2 + paddle.restitution**2))


def _restitution_of_damped(ratio: Array) -> Array:
    """Return the restitution of a ball on a spring and a damper, by their damping ratios, (k,).

    T. Schwager and T. Poeschel, Granular Matter 9, 465 (2007): the ball leaves when the force has
    come down to zero, while the spring is still compressed.
    """
    damped = np.sqrt(1.0 - ratio**2)
    leaves = np.arctan2(2.0 * ratio * damped, 2.0 * ratio**2 - 1.0)
    return np.asarray(np.exp(-ratio / damped * leaves))


def _swing_of(restitution: float, touch: float) -> tuple[float, float]:
    """Return frequency and damping [1/s] of a contact by its restitution and its length [s]."""
    ratio = np.linspace(0.999, 0.0, 2000)
    found = float(np.interp(restitution, _restitution_of_damped(ratio), ratio))
    damped = np.sqrt(1.0 - found**2)
    frequency = float(np.arctan2(2.0 * found * damped, 2.0 * found**2 - 1.0) / (damped * touch))
    return frequency, found * frequency


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drawn:
    """What was drawn for a trial, beside the masses of the links.

    Attributes:
        friction: Viscous [N m s/rad] and dry [N m] friction of each joint, shape (2, n).
        drag_force: Drag force of the ball per squared speed [N s^2/m^2].
        mass: Mass of the ball [kg].
        radius: Radius of the ball [m].
    """

    friction: Array
    drag_force: float
    mass: float
    radius: float


class PlantDraw:
    """Draws a plant anew for each trial, always from the masses that the scene was built with."""

    def __init__(self, scene: Scene, built: SceneModel) -> None:
        """Remember the masses."""
        self._scene, self._built = scene, built
        self._mass = built.model.body_mass.copy()
        self._inertia = built.model.body_inertia.copy()
        m, ball = built.model, built.ball
        self._sizes = m.geom_size[ball].copy(), m.geom_rbound[ball].copy(), m.geom_aabb[ball].copy()

    @property
    def nominal(self) -> Drawn:
        """A plant without friction and drag, with the ball of the scene."""
        ball, n = self._scene.ball, self._built.joints
        return Drawn(friction=np.zeros((2, n)), drag_force=0.0, mass=ball.mass, radius=ball.radius)

    def draw(
        self,
        data: mujoco.MjData,
        rng: np.random.Generator,
        *,
        ball: np.random.Generator,
        payload: float = 0.0,
    ) -> Drawn:
        """Set the model's masses, and the ball, for a trial.

        Args:
            data: State of the model; what follows from the masses is brought up to date.
            rng: Source of the draw of the arm and of the drag.
            ball: Source of the draw of the ball.
            payload: Mass at the hand that no model knows [kg].
        """
        mismatch, nominal, model = self._scene.mismatch, self._scene.ball, self._built.model
        body = model.geom_bodyid[self._built.ball]
        factor = 1.0 + mismatch.mass * rng.uniform(-1.0, 1.0, model.nbody)
        factor[body] = 1.0
        model.body_mass[:] = self._mass * factor
        model.body_mass[model.site_bodyid[self._built.site]] += payload
        model.body_inertia[:] = self._inertia * factor[:, None]
        heavier = 1.0 + mismatch.ball_mass * ball.uniform(-1.0, 1.0)
        larger = 1.0 + mismatch.ball_radius * ball.uniform(-1.0, 1.0)
        model.body_mass[body] *= heavier
        model.body_inertia[body] *= heavier * larger**2
        if mismatch.ball_radius > 0.0:
            self._resize(larger)
        mujoco.mj_setConst(model, data)
        most = np.array([[mismatch.viscous], [mismatch.coulomb]])
        n = self._built.joints
        friction = most * rng.uniform(0.0, 1.0, (2, n))
        if nominal.sides is not None:  # tools that take parts are light about their axis
            friction[1] = np.minimum(friction[1], _STEADY / model.dof_invweight0[:n])
        drag = nominal.mass * nominal.drag * (1.0 + mismatch.drag * rng.uniform(-1.0, 1.0))
        return Drawn(
            friction=friction,
            drag_force=float(drag * heavier),
            mass=nominal.mass * heavier,
            radius=nominal.radius * larger,
        )

    def _resize(self, larger: float) -> None:
        """Make the ball, or the part, larger than it was compiled by a factor."""
        model, ball = self._built.model, self._built.ball
        sizes = model.geom_size, model.geom_rbound, model.geom_aabb
        for values, compiled in zip(sizes, self._sizes, strict=True):
            values[ball] = larger * compiled
