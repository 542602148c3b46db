"""An arm's kinematics and dynamics as CasADi expressions, for optimisers.

Recursive Newton-Euler over the links of :class:`ArmModel`, in each link's own frame (Luh, Walker
and Paul 1980); held joints stay at their angle. Pinocchio's own CasADi build is not in its wheel;
a test holds these expressions to Pinocchio. CasADi comes with the extra ``mitt[rivals]``.
"""

from dataclasses import dataclass
from types import ModuleType
from typing import Any, TypeAlias, final

import numpy as np

from mitt.errors import MissingPackageError
from mitt.robot.arm import Arm
from mitt.robot.description import Link
from mitt.signals import GRAVITY

#: What CasADi makes, expressions and functions; CasADi is untyped.
Expression: TypeAlias = Any


def casadi() -> ModuleType:
    """Import CasADi, or say in one line how to get it.

    Raises:
        InputError: It is not installed.
    """
    try:
        import casadi as found  # noqa: PLC0415 (heavy, and an extra)
    except ImportError:
        raise MissingPackageError("generator clairvoyant", "CasADi", "rivals") from None
    module: ModuleType = found
    return module


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Symbolic:
    """Functions of one arm, CasADi's.

    Attributes:
        torque: (q, dq, ddq) to the torques of all N links [N m], shape (N,).
        tip: (q, dq, ddq) to catch point, velocity, acceleration [m ...], shape (3, 3) by column.
        normal: q to the palm's normal in the world, shape (3,).
    """

    torque: Expression
    tip: Expression
    normal: Expression


def symbolic(arm: Arm) -> Symbolic:
    """Build the expressions of an arm."""
    ca = casadi()
    q, dq, ddq = (ca.SX.sym(name, arm.n) for name in ("q", "dq", "ddq"))
    R, p = _tip(ca, arm, q)
    J = ca.jacobian(p, q)
    velocity = ca.mtimes(J, dq)
    fastening = ca.mtimes(J, ddq) + ca.jtimes(velocity, q, dq)
    point = ca.horzcat(p, velocity, fastening)
    tool = ca.mtimes(R, ca.DM(arm.model.tool[:3, 2]))
    return Symbolic(
        torque=ca.Function("torque", [q, dq, ddq], [_torque(ca, arm, q, dq, ddq)]),
        tip=ca.Function("tip", [q, dq, ddq], [point]),
        normal=ca.Function("normal", [q], [tool]),
    )


def _placed(ca: ModuleType, link: Link, x: Expression) -> tuple[Expression, Expression]:
    """Return rotation and position of a link's moved frame in the frame of the link before."""
    R, p, axis = ca.DM(link.placement[:3, :3]), ca.DM(link.placement[:3, 3]), ca.DM(link.axis)
    if link.prismatic:
        return R, p + ca.mtimes(R, axis) * x
    K = ca.skew(axis)
    turned = ca.DM.eye(3) + ca.sin(x) * K + (1.0 - ca.cos(x)) * ca.mtimes(K, K)
    return ca.mtimes(R, turned), p


def _values(arm: Arm, x: Expression, *, held: bool) -> list[Expression]:
    """Return active joints' values spread over all links; held ones' own, or zero."""
    own, given = [], iter(x[k] for k in range(arm.n))
    for link in arm.model.links:
        rest = link.held if held else 0.0
        own.append(next(given) if link.held is None else rest)
    return own


def _tip(ca: ModuleType, arm: Arm, q: Expression) -> tuple[Expression, Expression]:
    """Return the last link's rotation and the catch point in the world."""
    R, p = ca.SX(ca.DM(arm.model.mount[:3, :3])), ca.SX(ca.DM(arm.model.mount[:3, 3]))
    for link, x in zip(arm.model.links, _values(arm, q, held=True), strict=True):
        turn, way = _placed(ca, link, x)
        p = p + ca.mtimes(R, way)
        R = ca.mtimes(R, turn)
    return R, p + ca.mtimes(R, ca.DM(arm.model.catch_point))


def _torque(ca: ModuleType, arm: Arm, q: Expression, dq: Expression, ddq: Expression) -> Expression:
    """Return the torques of eq. (14) for all links."""
    links = arm.model.complete().links
    at, by, up = (_values(arm, x, held=k == 0) for k, x in enumerate((q, dq, ddq)))
    mount = arm.model.mount[:3, :3]
    w, dw, a = ca.SX(3, 1), ca.SX(3, 1), ca.SX(ca.DM(mount.T @ np.array([0.0, 0.0, GRAVITY])))
    frames, loads = [], []
    for k, link in enumerate(links):
        R, p = _placed(ca, link, at[k])
        axis, slide = ca.DM(link.axis), float(link.prismatic)
        a = a + ca.cross(dw, p) + ca.cross(w, ca.cross(w, p))
        w, dw, a = (ca.mtimes(R.T, x) for x in (w, dw, a))
        spin, run = (1.0 - slide) * by[k] * axis, slide * by[k] * axis
        a = a + slide * up[k] * axis + 2.0 * ca.cross(w, run)
        dw = dw + (1.0 - slide) * up[k] * axis + ca.cross(w, spin)
        w = w + spin
        com, inertia = ca.DM(link.com), ca.DM(link.inertia)
        force = link.mass * (a + ca.cross(dw, com) + ca.cross(w, ca.cross(w, com)))
        moment = ca.mtimes(inertia, dw) + ca.cross(w, ca.mtimes(inertia, w))
        frames.append((R, p))
        loads.append((force, moment + ca.cross(com, force)))
    f, n = ca.SX(3, 1), ca.SX(3, 1)
    tau: list[Expression] = []
    for k in reversed(range(len(links))):  # from the tip to the base
        f, n = f + loads[k][0], n + loads[k][1]
        along = ca.dot(ca.DM(links[k].axis), f if links[k].prismatic else n)
        tau.insert(0, along + links[k].armature * up[k])
        R, p = frames[k]
        f = ca.mtimes(R, f)
        n = ca.mtimes(R, n) + ca.cross(p, f)
    return ca.vertcat(*tau)
