"""How a trial's plant differs from the model: masses, friction, drag and ball, from its seed."""

from dataclasses import dataclass

import mujoco
import numpy as np

from mitt.signals import Array
from mitt.world.build import SceneModel
from mitt.world.scene import Scene


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
            self._resize(nominal.radius * larger)
        mujoco.mj_setConst(model, data)
        most = np.array([[mismatch.viscous], [mismatch.coulomb]])
        friction = most * rng.uniform(0.0, 1.0, (2, self._built.joints))
        drag = nominal.mass * nominal.drag * (1.0 + mismatch.drag * rng.uniform(-1.0, 1.0))
        return Drawn(
            friction=friction,
            drag_force=float(drag * heavier),
            mass=nominal.mass * heavier,
            radius=nominal.radius * larger,
        )

    def _resize(self, radius: float) -> None:
        """Give the ball a radius [m]."""
        model, ball = self._built.model, self._built.ball
        model.geom_size[ball, 0] = model.geom_rbound[ball] = radius
        model.geom_aabb[ball, 3:] = radius
