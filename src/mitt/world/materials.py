"""What balls and the hand's pads are made of, and how they bounce and slide on one another.

A ball's restitution is measured on a hard, heavy surface. On a soft pad both are compressed, each
gives back its own share of the energy, and what is given back of both is

    e^2 = (e_ball^2 + e_pad^2) / 2

where both are compressed alike: a choice of this project, as is the friction of all materials.
"""

from math import sqrt

import numpy as np

from mitt.world.scene import Material, Scene

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

FRICTION: dict[Material, float] = {
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
_CONTACTS = np.array(
    [
        (0.171, 1.50, 450.0),
        (0.228, 1.20, 450.0),
        (0.272, 1.00, 450.0),
        (0.308, 0.85, 450.0),
        (0.346, 0.70, 450.0),
        (0.409, 0.60, 600.0),
        (0.454, 0.50, 600.0),
        (0.508, 0.40, 600.0),
        (0.581, 0.30, 600.0),
        (0.627, 0.25, 600.0),
        (0.689, 0.20, 600.0),
        (0.760, 0.15, 600.0),
        (0.839, 0.10, 600.0),
        (0.928, 0.06, 600.0),
    ]
)

#: Sliding friction where nothing is said of the ball.
_PLAIN = 1.0


def friction_of(scene: Scene) -> float:
    """Return the coefficient of sliding friction of ball and hand."""
    if scene.contact.friction is not None:
        return scene.contact.friction
    return _PLAIN if scene.ball.material is None else FRICTION[scene.ball.material]


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
