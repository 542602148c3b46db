"""What a catcher knows of a scene: what a user of a real cell knows of it, and no more."""

from dataclasses import replace
from math import pi, sqrt

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.arm.limits import with_reserve
from mitt.core.arm.shapes import Surroundings
from mitt.core.arm.tools import Paddle
from mitt.core.ball.filter import FilterConfig
from mitt.core.catcher.settings import CatcherSettings
from mitt.core.control.encoders import Encoders
from mitt.core.eyes.camera import Rig
from mitt.core.eyes.eyes import EyesConfig
from mitt.core.eyes.triangulation import TriangulatorConfig
from mitt.core.signals import TICK
from mitt.lab.world.build import friction_of, restitution_of, restitution_on
from mitt.lab.world.scene import Actuation, Ball, Scene
from mitt.lab.world.sensors import encoder_steps

#: Share of each torque limit that is not commanded to drives that lag behind their commands: the
#: WAM's command stays within its limits as the motors see them (a choice of this project).
RESERVE = 0.02
COMES = 6.0
"""About the speed at which balls come [m/s]."""
#: Rebound from a palm whose contact is soft: 0.18 at 5 m/s.
_SOFT = CatcherSettings().ball_restitution


def catcher_settings(arm: Arm, scene: Scene) -> CatcherSettings:
    """Return the settings of the catcher: what it is told of the scene and its own arm."""
    ball, actuation = scene.ball, scene.actuation
    rate, torques = 2.0 * pi * actuation.bandwidth, actuation.takes == "torque"
    steps = encoder_steps(scene, arm.model)
    return CatcherSettings(
        ball_mass=ball.mass,
        ball_radius=ball.radius,
        ball_restitution=_rebound_of(arm, scene),
        ball_friction=friction_of(scene),
        flight=filter_settings(
            ball.drag, ball.mass, spread=scene.mismatch.drag, lift=_lift_of(ball)
        ),
        around=Surroundings(floor=scene.floor),
        encoders=Encoders(step=tuple(np.where(steps > 0.0, steps, arm.encoder_step).tolist())),
        bandwidth=bandwidth_of(actuation.takes, actuation.servo),
        torque_lead=TICK * (1.0 + actuation.delay) + (1.0 / rate if rate > 0.0 else 0.0),
        setpoint_delay=0 if torques else actuation.delay,
    )


def eyes_settings(scene: Scene) -> EyesConfig:
    """Return what the catcher knows of its cameras: a calibration leaves errors in the images.

    A quarter of a corner's error, 0.05 px for corners found to within 0.2 px, is a choice of this
    project.
    """
    sensing, exact = scene.sensing, TriangulatorConfig()
    left = 0.25 * sensing.corner_noise if sensing.views > 0 else 0.0
    floor = float(np.hypot(exact.sigma_floor, left))
    return EyesConfig(
        ball_radius=scene.ball.radius, triangulator=TriangulatorConfig(sigma_floor=floor)
    )


def rig_in(rig: Rig, scene: Scene) -> Rig:
    """Return the cameras as a catcher knows them in a scene: with the readout of its shutters."""
    rolling = (replace(camera, readout=scene.sensing.readout) for camera in rig.cameras)
    return replace(rig, cameras=tuple(rolling))


def driven(arm: Arm, scene: Scene) -> Arm:
    """Return an arm as its catcher may drive it: with torque in reserve where drives lag.

    A torque that was within the limit of one state acts in another, a millisecond later; and which
    state it is, counts of an encoder do not say exactly.
    """
    if scene.actuation == Actuation() and scene.sensing.encoder_step == 0.0:
        return arm
    return reserved(arm)


def reserved(arm: Arm) -> Arm:
    """Return an arm with a share of its torque left for drives that lag behind their commands."""
    return Arm(arm.model, with_reserve(arm.limits, RESERVE))


def bandwidth_of(takes: str, servo: float) -> float:
    """Return the bandwidth of the tracking error [rad/s]: of the torques, or a robot's own.

    ``servo`` is the bandwidth of its own control, where it does not take torques [Hz].
    """
    return CatcherSettings().bandwidth if takes == "torque" else 2.0 * pi * servo


def _lift_of(ball: Ball) -> float:
    """Return the 1-sigma of each component of w of a ball that spins as told [1/s]."""
    fast = 2.0 * ball.radius * ball.spin
    return ball.lift_constant * ball.spin * COMES / (COMES + fast) / sqrt(3.0)


def filter_settings(
    drag: float, mass: float, *, spread: float = 0.0, lift: float = 0.0
) -> FilterConfig:
    """Return what the filter may assume of a ball with known nominal drag [1/m] and mass [kg].

    A quarter of the drag either way, or what a uniform error up to ``spread`` makes; at most twice
    the drag. What drag does not explain grows as the ball gets lighter: white acceleration (gusts)
    of 1e-4 m^2/s^3 for the thrown ball of 70 g and 0.0026 for one of table tennis, a lasting push
    (spin) of 0.04 and 1 m/s^2. Of balls that are known to spin it is a lift w x dr_o, each
    component of w of 1-sigma ``lift`` [1/s].
    """
    lightness = max(0.07 / mass, 1.0)
    return FilterConfig(
        drag_mean=drag,
        drag_max=max(FilterConfig().drag_max, 2.0 * drag),
        drag_sigma=max(max(0.25, spread / sqrt(3.0)) * drag, 0.005),
        drag_density=1e-6,
        accel_density=1e-4 * lightness,
        push_sigma=0.04 * lightness,
        lift_sigma=max(lift, 0.04 * lightness / COMES) if lift > 0.0 else 0.0,
    )


def rebound_in(arm: Arm, palm: float) -> float:
    """Return what share of its speed a ball keeps in an arm's hand, whose palm leaves so much."""
    return palm if arm.model.hand is None else arm.model.hand.rebound(palm)


def _rebound_of(arm: Arm, scene: Scene) -> float:
    """Return what share of its speed the scene's ball keeps in a hand."""
    if isinstance(arm.model.hand, Paddle):
        return restitution_on(scene, arm.model.hand)
    return rebound_in(arm, restitution_of(scene) or _SOFT)
