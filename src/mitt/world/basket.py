"""The basket as MuJoCo bodies: a hard ring on struts, and a net of cords that damps.

The cords do not move; they give way as a net does because their contact is soft: it acts on the
ball as a spring and a damper along each cord's normal, about 15 mm deep at 5 m/s. A ball that goes
deeper than its own radius, one of 20 mm at 6 m/s, is through. Nothing holds the ball but contact
and friction. The ring is as hard as the ball.
"""

from collections.abc import Sequence

import mujoco
import numpy as np

from mitt.robot.basket import Basket
from mitt.signals import Array
from mitt.world.hand import add_geom, set_inertial

#: The net's contact, in MuJoCo's direct form (-stiffness, -damping per kilogram) [1/s^2, 1/s]: a
#: ball of 5 m/s is stopped within 20 mm, and 100 m/s^2 push it 20 mm deep. Choices of this project.
NET = (-5000.0, -300.0)
#: Sliding (nylon), torsional [m] and rolling [m] friction of ball and net: choices, as of the hand.
NET_FRICTION = (0.5, 0.01, 1e-4)

#: Thickness of the bracket of a tilted basket in struts, and points of a strut that it may join.
_BRACKET, _TRIED = 2.0, 20

_METAL = (0.72, 0.74, 0.78, 1.0)
_CORD = (0.93, 0.93, 0.90, 1.0)


def add_basket(plate: mujoco.MjsBody, basket: Basket) -> None:
    """Add a basket to the tool plate.

    Args:
        plate: The tool plate, z along the opening's normal.
        basket: The basket.
    """
    body = plate.add_body(name="basket")
    set_inertial(body, basket.mass, np.array([0.0, 0.0, basket.com]), basket.inertia)
    _add_frame(body, basket)
    _add_net(body, basket)


def _circle(radius: float, height: float, count: int) -> Array:
    """Return the corners of a regular polygon about the axis [m], (count, 3), from x on."""
    angles = 2.0 * np.pi * np.arange(count) / count
    x, y = radius * np.cos(angles), radius * np.sin(angles)
    return np.column_stack((x, y, np.full(count, height)))


def _add_frame(body: mujoco.MjsBody, b: Basket) -> None:
    """Add flange, struts and ring."""
    cylinder, thick = mujoco.mjtGeom.mjGEOM_CYLINDER, 0.125 * b.flange
    add_geom(body, "flange", cylinder, [b.flange, thick, 0.0], pos=[0.0, 0.0, thick])
    around = b.ring_radius + b.clear
    side = np.array([1.0 if b.tilt > 0.0 else -1.0, 1.0, 1.0])  # a strut where the bracket joins
    feet, knees, ends = (
        side * _circle(radius, height, b.struts)
        for radius, height in ((b.flange, thick), (around, b.floor), (b.net_radius, b.ring_height))
    )
    for k in range(b.struts):
        for name, pair in (("foot", [*feet[k], *knees[k]]), ("strut", [*knees[k], *ends[k]])):
            _rod(body, f"{name}{k}", b.strut, pair)
    corners = _circle(b.net_radius, b.ring_height, b.cords)
    for k in range(b.cords):
        pair = [*corners[k], *corners[(k + 1) % b.cords]]
        _rod(body, f"ring{k}", b.ring_thickness, pair)
    if b.tilt:
        plate = np.linalg.inv(b.mount)[:3, 3]
        points = np.linspace((feet, knees), (knees, ends), _TRIED).reshape(-1, 3)
        near = points[np.argmin(np.linalg.norm(points - plate, axis=1))]
        _rod(body, "bracket", _BRACKET * b.strut, [*plate, *near])


def _add_net(body: mujoco.MjsBody, b: Basket) -> None:
    """Add cords down from the ring and across the bottom."""
    top = _circle(b.net_radius, b.ring_height, b.cords)
    bottom = _circle(b.net_radius, b.floor, b.cords)
    half = b.cords // 2
    sides = [[*top[k], *bottom[k]] for k in range(b.cords)]
    across = [[*bottom[k], *bottom[k + half]] for k in range(half)]
    for k, ends in enumerate(sides + across):
        cord = _rod(body, f"cord{k}", b.cord, ends, rgba=_CORD)
        cord.priority, cord.solref, cord.friction = 2, NET, NET_FRICTION


def _rod(
    body: mujoco.MjsBody,
    name: str,
    radius: float,
    ends: Sequence[float],
    rgba: tuple[float, ...] = _METAL,
) -> mujoco.MjsGeom:
    """Add a capsule between two points."""
    kind = mujoco.mjtGeom.mjGEOM_CAPSULE
    return add_geom(body, name, kind, [radius, 0.0, 0.0], fromto=list(ends), rgba=rgba)
