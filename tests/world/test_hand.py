"""The hand: what it weighs, how fast it closes, what it holds. Contact alone holds the ball."""

from dataclasses import dataclass, replace

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mitt.core.arm.description import steiner
from mitt.core.arm.hands import HandModel, closing_angle
from mitt.core.control.closing import LONGEST_INSIDE
from mitt.core.errors import ModelError
from mitt.core.signals import Array
from mitt.lab.world.build import STEP, contact_of, friction_of
from mitt.lab.world.drives import finger_servo, finger_torque
from mitt.lab.world.engine import plant_of, survey
from mitt.lab.world.hand_bodies import BALL, FRICTION, HAND, add_hand, finger_inertial
from mitt.lab.world.scene import Ball, Contact, Scene

HAND_MODEL = HandModel()
BIG = (0.04, 0.07)
SMALL = (0.02, 0.0027)  # radius [m], mass [kg], a thrown and a table-tennis ball
ELBOW = 0.47  # catch point from the elbow axis [m]: 0.35 + 0.12
BRAKE = 147.0  # deceleration of joint 4 after the catch [rad/s^2]
FOLLOW = 0.008  # time after the catch at which it starts [s]
HELD_MM = 20.0
FORCE_N = 80.0
TURN = 1000.0  # inertia of the turning arm [kg m^2]: contact does not slow it


def rig(
    radius: float, mass: float, *, gravity: bool = True, scene: Scene | None = None
) -> mujoco.MjModel:
    """Return a hand on an arm that turns about an elbow axis, and a free ball; soft without one."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.timestep = STEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.gravity = [0.0, 0.0, -9.81 if gravity else 0.0]
    arm = spec.worldbody.add_body(name="arm")
    hinge = arm.add_joint(name="elbow", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0.0, 1.0, 0.0])
    hinge.armature = TURN
    plate = arm.add_body(name="plate", pos=[0.0, 0.0, ELBOW - HAND_MODEL.catch_offset])
    plate.add_site(name="catch", pos=[0.0, 0.0, HAND_MODEL.catch_offset])
    add_hand(spec, plate, HAND_MODEL)
    body = spec.worldbody.add_body(name="ball", pos=[0.0, 0.0, 2.0])
    body.add_freejoint()
    geom = body.add_geom(name="ball", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[radius, 0.0, 0.0])
    geom.mass, geom.contype, geom.conaffinity = mass, BALL, HAND
    geom.condim, geom.priority, geom.friction, geom.solref = 4, 1, FRICTION, (0.004, 1.0)
    if scene is not None:
        geom.friction, geom.solref = (friction_of(scene), *FRICTION[1:]), contact_of(scene)
    return spec.compile()


@dataclass(frozen=True, kw_only=True)
class Errors:
    """By how much a catch is off: ball position [m], velocity [m/s], start of closing [s]."""

    position: Array
    velocity: Array
    lead: float


def drawn(rng: np.random.Generator) -> Errors:
    """Draw 5 mm an axis, 0.3 m/s an axis, 2 ms."""
    return Errors(
        position=rng.uniform(-0.005, 0.005, 3),
        velocity=rng.uniform(-0.3, 0.3, 3),
        lead=rng.uniform(-0.002, 0.002),
    )


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Whether a ball was held, how far off it lies [m], and the largest contact force [N]."""

    held: bool
    off: float
    force: float


def catch(
    model: mujoco.MjModel, speed: float, errors: Errors, *, close: bool = True
) -> Outcome | None:
    """Meet a ball on the tangent at ``speed`` [rad/s]; None where it starts inside the palm."""
    data = mujoco.MjData(model)
    radius = float(model.geom("ball").size[0])
    profile, servo = HAND_MODEL.profile(radius), finger_servo(HAND_MODEL.drive)
    inside = np.sqrt(2.0 * HAND_MODEL.inside(radius) / (speed**2 * ELBOW))
    lead = HAND_MODEL.closing_time(radius) + min(inside, LONGEST_INSIDE)
    start = min(-0.04, -lead - errors.lead)
    g, velocity = model.opt.gravity, np.array([speed * ELBOW, 0.0, 0.0]) + errors.velocity
    data.qpos[0], data.qvel[0] = speed * start, speed
    data.qpos[4:7] = [0.0, 0.0, ELBOW] + errors.position + velocity * start + 0.5 * g * start**2
    data.qvel[4:7] = velocity + g * start
    mujoco.mj_forward(model, data)
    if data.ncon:
        return None
    plant, force = plant_of(model, data, 0, 1), 0.0
    touching = plant.touching
    t, end = start, np.inf
    while t < min(0.7, end):
        angle = float(closing_angle(t + lead + errors.lead, profile)) if close else 0.0
        for k in range(3):
            data.ctrl[k] = finger_torque(data.qpos[1 + k], data.qvel[1 + k], angle, servo)
        data.qfrc_applied[0] = -TURN * BRAKE if t > FOLLOW and data.qvel[0] > 0.1 else 0.0
        data.qvel[0] = data.qvel[0] if t <= FOLLOW or data.qvel[0] > 0.1 else 0.0
        mujoco.mj_step(model, data)
        t += STEP
        if data.ncon:
            force = max(force, survey(plant, True)[1])
            end = min(end, t + 0.5) if touching.any() else end
    mujoco.mj_forward(model, data)
    off = float(np.linalg.norm(data.qpos[4:7] - data.site("catch").xpos))
    survey(plant, False)
    held = off < radius + 1e-3 * HELD_MM and int(touching.sum()) >= 2
    return Outcome(held=held, off=off, force=force)


def outcomes(ball: tuple[float, float], count: int, seed: int) -> list[Outcome]:
    """Catch ``count`` balls at 5 to 20 rad/s with random errors."""
    rng, model = np.random.default_rng(seed), rig(*ball)
    drawn_ones = [(rng.uniform(5.0, 20.0), drawn(rng)) for _ in range(count)]
    all_of_them = (catch(model, speed, errors) for speed, errors in drawn_ones)
    return [outcome for outcome in all_of_them if outcome is not None]


@pytest.mark.parametrize("ball", [BIG, SMALL], ids=["ball", "table-tennis"])
def test_fingers_hold_the_ball_against_the_brake(ball: tuple[float, float]) -> None:
    """Every ball met with the errors of a fair catch is held half a second later, gently."""
    seen = outcomes(ball, 16, seed=3)
    assert len(seen) > 10
    assert all(o.held for o in seen)
    assert np.median([o.force for o in seen]) < FORCE_N


def lies_on(model: mujoco.MjModel, away: Array, tilt: float) -> bool:
    """Close the hand on a ball that lies on the palm, ``away`` from its middle [m], shape (2,).

    Args:
        model: As of :func:`rig`.
        away: Place along the plate's x and y axes.
        tilt: Of the palm, that looks up at 0 [rad].

    Returns:
        Whether the ball is still in the hand 0.6 s later.
    """
    data, radius = mujoco.MjData(model), float(model.geom("ball").size[0])
    profile, servo = HAND_MODEL.profile(radius), finger_servo(HAND_MODEL.drive)
    data.qpos[0] = tilt
    mujoco.mj_kinematics(model, data)
    site = data.site("catch")
    low = HAND_MODEL.palm_height + radius - HAND_MODEL.catch_offset
    data.qpos[4:7] = site.xpos + site.xmat.reshape(3, 3) @ np.array([*away, low])
    for k in range(round(0.6 / STEP)):
        angle = float(closing_angle(k * STEP, profile))
        for j in range(3):
            data.ctrl[j] = finger_torque(data.qpos[1 + j], data.qvel[1 + j], angle, servo)
        mujoco.mj_step(model, data)
        data.qpos[0], data.qvel[0] = tilt, 0.0
    mujoco.mj_kinematics(model, data)
    return float(np.linalg.norm(data.qpos[4:7] - site.xpos)) < radius + 1e-3 * HELD_MM


@pytest.mark.parametrize("tilt", [0.0, np.pi / 2])
@pytest.mark.parametrize("friction", [0.3, 1.0])
def test_a_ball_off_the_middle_is_not_squeezed_out(friction: float, tilt: float) -> None:
    """Fingers that close on a hard ball on the palm, 6 mm off its middle to any side, hold it."""
    scene = Scene(ball=Ball(material="table-tennis"), contact=Contact(friction=friction))
    model = rig(*SMALL, scene=scene)
    ways = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    assert all(lies_on(model, 0.006 * np.array([np.cos(w), np.sin(w)]), tilt) for w in ways)


@given(radius=st.floats(0.018, 0.045))
def test_the_closed_hand_is_a_cage_for_the_ball_on_the_palm(radius: float) -> None:
    """Short of the squeeze the fingers touch a ball on the palm, or one at the catch point."""
    hand = HAND_MODEL
    touch = hand.hold_angle(radius) - hand.closing.squeeze
    heights = hand.palm_height + radius, hand.catch_offset
    gaps = [hand.finger.gap(touch, radius, height) for height in heights]
    assert max(gaps) == pytest.approx(0.0, abs=1e-9)


def test_nothing_but_the_fingers_holds_the_ball() -> None:
    """With the fingers left open the same ball is lost."""
    none = Errors(position=np.zeros(3), velocity=np.zeros(3), lead=0.0)
    outcome = catch(rig(*BIG), 15.0, none, close=False)
    assert outcome is not None
    assert not outcome.held


def test_fingers_close_ninety_degrees_in_twenty_milliseconds() -> None:
    """The paper's Table 1: without load, 90 degrees (to half a degree) in 20 +- 1 ms."""
    model = rig(*BIG, gravity=False)
    data, servo = mujoco.MjData(model), finger_servo(HAND_MODEL.drive)
    angles = []
    for _ in range(80):
        for k in range(3):
            data.ctrl[k] = finger_torque(data.qpos[1 + k], data.qvel[1 + k], np.pi / 2, servo)
        mujoco.mj_step(model, data)
        angles.append(np.rad2deg(data.qpos[1:4]).min())
    arrived = STEP * (1 + int(np.argmax(np.array(angles) > 89.5)))
    assert arrived == pytest.approx(0.020, abs=0.001)
    assert max(angles) < 91.0
    assert data.ncon == 0


def test_palm_and_open_fingers_make_up_the_hand() -> None:
    """Mass, centre of mass and inertia of the bodies are those of the HandModel."""
    model = rig(*BIG)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    palm = model.body("palm").id
    com = np.array([0.0, 0.0, ELBOW - HAND_MODEL.catch_offset + HAND_MODEL.com])
    assert model.body_subtreemass[palm] == pytest.approx(HAND_MODEL.mass)
    assert data.subtree_com[palm] == pytest.approx(com, abs=1e-12)
    inertia = np.zeros((3, 3))
    for b in range(palm, palm + 4):
        R = data.ximat[b].reshape(3, 3)
        inertia += R @ np.diag(model.body_inertia[b]) @ R.T
        inertia += steiner(float(model.body_mass[b]), data.xipos[b] - com)
    assert inertia == pytest.approx(HAND_MODEL.inertia, abs=1e-9)


def test_a_finger_weighs_what_it_should() -> None:
    """Mass and length are the table's; the rods' inertia is below that of the far end's mass."""
    mass, com, inertia = finger_inertial(HAND_MODEL.finger)
    assert mass == HAND_MODEL.finger.mass
    assert HAND_MODEL.finger.proximal + HAND_MODEL.finger.distal == pytest.approx(0.1)
    about_joint = (inertia + steiner(mass, com))[1, 1]
    assert 0.0 < about_joint < mass * 0.1**2


@pytest.mark.parametrize(
    "hand",
    [
        replace(HAND_MODEL, fingers=12),
        replace(HAND_MODEL, mass=0.05),
        replace(HAND_MODEL, finger=replace(HAND_MODEL.finger, mass=10.0)),
    ],
    ids=["fingers", "mass", "finger"],
)
def test_fingers_that_are_more_than_the_hand_are_refused(hand: HandModel) -> None:
    """They are part of it; MuJoCo would say so in words of its own, or not at all."""
    spec = mujoco.MjSpec()
    with pytest.raises(ModelError, match=r"^HandModel\.(mass|inertia)"):
        add_hand(spec, spec.worldbody.add_body(name="plate"), hand)


@given(
    radius=st.floats(0.02, 0.04), angle=st.floats(0.0, np.pi / 2), side=st.floats(0.0, 2 * np.pi)
)
def test_the_gap_formula_is_mujocos_distance(radius: float, angle: float, side: float) -> None:
    """Finger.gap is the distance that MuJoCo finds between the finger's rods and the ball."""
    model = RIGS.setdefault(round(radius, 3), rig(round(radius, 3), 0.07))
    data = mujoco.MjData(model)
    data.qpos[1:4] = angle
    data.qpos[4:7] = [0.0, 0.0, ELBOW]
    data.qpos[7:11] = [np.cos(side / 2), 0.0, 0.0, np.sin(side / 2)]
    mujoco.mj_kinematics(model, data)
    ball = model.geom("ball").id
    rods = [model.geom(f"finger1/{part}").id for part in ("proximal", "distal")]
    found = min(mujoco.mj_geomDistance(model, data, ball, g, 1.0, None) for g in rods)
    wanted = HAND_MODEL.finger.gap(angle, round(radius, 3), HAND_MODEL.catch_offset)
    assert wanted == pytest.approx(found, abs=1e-9)


RIGS: dict[float, mujoco.MjModel] = {}


@pytest.mark.parametrize("radius", [0.02, 0.03, 0.04])
def test_the_open_hand_leaves_the_ball_free_way(radius: float) -> None:
    """From 100 mm in front to the catch point, 12 degrees off the normal, nothing is touched."""
    model = rig(radius, 0.07)
    data = mujoco.MjData(model)
    off = np.tan(np.deg2rad(12.0))
    for ahead in np.linspace(0.001, 0.1, 40):
        for turn in np.linspace(0.0, 2 * np.pi, 13):
            data.qpos[4:7] = [off * ahead * np.cos(turn), off * ahead * np.sin(turn), ELBOW + ahead]
            mujoco.mj_fwdPosition(model, data)
            assert data.ncon == 0


@given(radius=st.floats(0.015, 0.045))
def test_closing_is_smooth_and_within_the_drive(radius: float) -> None:
    """The commanded angle rises without jumps, no faster than the servo follows, to the hold."""
    touch, hold = HAND_MODEL.touch_angle(radius), HAND_MODEL.hold_angle(radius)
    t, profile = np.arange(0.0, 0.25, 0.0005), HAND_MODEL.profile(radius)
    angle = np.array([closing_angle(s, profile) for s in t])
    assert angle[100] == HAND_MODEL.closing_angle(t[100], radius)
    rate = np.diff(angle) / 0.0005
    assert angle[0] == 0.0
    assert angle[-1] == hold <= HAND_MODEL.drive.closed
    assert np.all(rate >= -1e-9)
    assert rate.max() < 120.0
    firm = t[:-1][(angle[:-1] > touch - HAND_MODEL.closing.margin + 1e-6)]
    slow = rate[(t[:-1] >= firm[0]) & (angle[1:] < hold)]
    assert slow == pytest.approx(HAND_MODEL.closing.touch_speed, rel=1e-6)


def test_a_ball_out_of_reach_is_closed_on_fully() -> None:
    """Where the fingers cannot touch the ball, the touch angle is the closed one."""
    assert HAND_MODEL.touch_angle(0.001) == HAND_MODEL.drive.closed
