"""How a trial's plant differs from the model: masses, friction and drag drawn from its seed."""

import mujoco
import numpy as np

from mitt.signals import Array
from mitt.world.build import Plant
from mitt.world.scene import Scene


class PlantDraw:
    """Draws a plant anew for each trial, always from the masses that the scene was built with."""

    def __init__(self, scene: Scene, plant: Plant) -> None:
        """Remember the masses."""
        self._scene, self._plant = scene, plant
        self._mass = plant.model.body_mass.copy()
        self._inertia = plant.model.body_inertia.copy()

    def draw(
        self, data: mujoco.MjData, rng: np.random.Generator, *, payload: float = 0.0
    ) -> tuple[Array, float]:
        """Set the model's masses for a trial.

        Args:
            data: State of the model; what follows from the masses is brought up to date.
            rng: Source of the draw.
            payload: Mass at the hand that no model knows [kg].

        Returns:
            Viscous [N m s/rad] and dry [N m] friction of each joint, shape (2, n), and the drag
            force of the ball per squared speed [N s^2/m^2].
        """
        mismatch, ball, model = self._scene.mismatch, self._scene.ball, self._plant.model
        factor = 1.0 + mismatch.mass * rng.uniform(-1.0, 1.0, model.nbody)
        factor[model.geom_bodyid[self._plant.ball]] = 1.0
        model.body_mass[:] = self._mass * factor
        model.body_mass[model.site_bodyid[self._plant.site]] += payload
        model.body_inertia[:] = self._inertia * factor[:, None]
        mujoco.mj_setConst(model, data)
        most = np.array([[mismatch.viscous], [mismatch.coulomb]])
        friction = most * rng.uniform(0.0, 1.0, (2, self._plant.joints))
        drag = ball.mass * ball.drag * (1.0 + mismatch.drag * rng.uniform(-1.0, 1.0))
        return friction, float(drag)
