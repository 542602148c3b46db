"""The choices that make a map, the arrays of l_c that follow from them, and what makes no sense.

Where no throw is given, balls come as the default ones do: from +x, falling (docs/throws.md).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from mitt.core import checks
from mitt.core.arm.arm import Arm
from mitt.core.errors import InputError, ModelError
from mitt.core.fields import Range, Settings
from mitt.core.map.polynomial import MOST_ORDER
from mitt.core.map.tangent import Tangent, plane_of
from mitt.core.signals import Array

#: Indices of joints.
_JOINT = Range(0, 63)


@dataclass(frozen=True, kw_only=True, repr=False)
class MapDesign(Settings):
    """The choices that make a map, apart from its coefficients.

    Attributes:
        catch_joint: Index i of the catch joint among the active joints, from 0.
        q_catch: Its angle q_alpha at the catch [rad]; see ``slope``.
        kappa: Velocity-match ratio; 1 is the paper.
        inward: How much of the ball's line leads towards joint i's axis, in units of dl/dq_i; 0 is
            the paper. The ball then meets the hand with inward times joint i's own speed, along
            the palm's normal.
        order: Degree N of the polynomial.
        free: The three joints of l_c, the catch joint among them; all where the arm has three.
        coupling: How far each further joint turns in l_c, a row of three a joint over the
            coordinates p of :mod:`mitt.core.map.tangent`; nothing where they stay.
        slope: How q_alpha goes with the two other free joints in their order: it is
            q_catch + slope . (their angles). Balls that pass elsewhere are then caught in another
            pose of the catch joint. 0 is the paper.
        match_weight: What a relative velocity of ball and hand at the catch costs in learning, on
            top of eq. (22) [(m/s)^-2]: b then has terms of first order, and the hand moves with the
            ball as far as torque, speed and the limits, which are soft in learning, make it pay. 0
            is the paper: b-dot vanishes at the catch, eq. (7).
    """

    catch_joint: Annotated[int, _JOINT] = 2
    q_catch: float = np.pi / 2
    kappa: float = 1.0
    inward: float = 0.0
    order: Annotated[int, Range(2, MOST_ORDER)] = 4
    free: Annotated[tuple[int, int, int], _JOINT] = (0, 1, 2)
    coupling: tuple[tuple[float, float, float], ...] = ()
    slope: Annotated[tuple[float, float], Range(-1e300, 1e300, rises=False)] = (0.0, 0.0)
    match_weight: Annotated[float, Range(0.0, 1e6)] = 0.0


#: Designs chosen by computation, by arm and limit set; any other arm or set has the paper's.
#: From a grid over q_alpha, inward and kappa, with the joints, the ready pose and the throws of the
#: paper; ``mitt design`` (:mod:`mitt.lab.design`) searches over those too, for any arm.
_CHOSEN = {
    ("wam", "wam-80v"): MapDesign(q_catch=1.2, inward=1.5),
    ("wam", "wam-48v"): MapDesign(q_catch=0.6, inward=3.0),
}


def default_design(
    arm: Arm,
    *,
    catch_joint: int | None = None,
    q_catch: float | None = None,
    kappa: float | None = None,
    inward: float | None = None,
    order: int | None = None,
) -> MapDesign:
    """Return a design; what is left out follows from the arm and its limits.

    Args:
        arm: The arm; the choices of its file go before the defaults, unless another catch joint is
            given.
        catch_joint: Index of the catch joint; the last active joint by default.
        q_catch: Its angle at the catch [rad], without a slope; by default the one chosen for the
            limit set, or else pi/2 or the middle of its range.
        kappa: Velocity-match ratio.
        inward: Share of the ball's line towards the catch joint's axis.
        order: Degree of the polynomial.
    """
    if arm.n < 3:
        raise InputError("--joints", "at least three active joints", arm.n)
    base = arm.model.design
    if base is not None:
        base = checks.instance("design", base, MapDesign)
        check_joints(arm, base)
    usually = arm.n - 1 if base is None else base.catch_joint
    i = usually if catch_joint is None else catch_joint
    i = checks.whole("--catch-joint", i, least=0, most=arm.n - 1)
    a, b, c = sorted({*[k for k in range(arm.n) if k != i][:2], i})
    usual = MapDesign(catch_joint=i, q_catch=nominal_angle(arm, i), free=(a, b, c))
    chosen = _CHOSEN.get((arm.model.name, arm.limits.name), usual)
    if order is not None:
        checks.whole("--order", order, least=2, most=MOST_ORDER)
    if base is None or base.catch_joint != i:
        base = chosen if (chosen.catch_joint, chosen.free) == (i, usual.free) else usual
    return replace(
        base,
        q_catch=base.q_catch if q_catch is None else q_catch,
        slope=base.slope if q_catch is None else (0.0, 0.0),
        kappa=base.kappa if kappa is None else kappa,
        inward=base.inward if inward is None else inward,
        order=base.order if order is None else order,
    )


def nominal_angle(arm: Arm, joint: int) -> float:
    """Return the paper's q_alpha for a joint [rad]: a right angle towards the thrower.

    That is pi/2 or -pi/2, whichever is in the range and brings the catch point farther to +x; the
    middle of the range where neither is.
    """
    low, high = float(arm.q_min[joint]), float(arm.q_max[joint])
    angles = [x for x in (np.pi / 2, -np.pi / 2) if low < x < high] or [0.5 * (low + high)]
    return max(angles, key=lambda x: _forward(arm, joint, x))


def _forward(arm: Arm, joint: int, angle: float) -> float:
    """Return how far towards the thrower the catch point of the ready pose is at an angle [m]."""
    q = arm.q_ready.copy()
    q[joint] = angle
    return float(arm.position(q)[0])


def nominal_catch(arm: Arm) -> Array:
    """Return the joints around which default throws are aimed [rad], shape (n,).

    The ready pose with the last joint at the paper's q_alpha. It belongs to the throws and not
    to a map: maps of any design, under any limits, are compared on the same throws.
    """
    q = arm.q_ready.copy()
    q[-1] = nominal_angle(arm, arm.n - 1)
    return q


def catch_place(arm: Arm) -> Array:
    """Return the point around which balls are aimed and maps are learned [m], shape (3,)."""
    if arm.model.aim is not None:
        place: Array = arm.model.aim[0].copy()
        return place
    return arm.position(nominal_catch(arm))


def check_joints(arm: Arm, design: MapDesign) -> None:
    """Raise ModelError unless the joints of a design are some of the arm's."""
    if sorted(set(design.free)) != list(design.free) or not set(design.free) <= set(range(arm.n)):
        raise ModelError("free", f"three rising indices in 0..{arm.n - 1}", design.free)
    if design.catch_joint not in design.free:
        raise ModelError("catch_joint", f"one of the free joints {design.free}", design.catch_joint)
    if design.coupling and len(design.coupling) != arm.n - 3:
        raise ModelError("coupling", f"{arm.n - 3} rows, one a further joint", len(design.coupling))


def _check_angle(arm: Arm, design: MapDesign) -> None:
    """Raise ModelError where no pose has the catch joint at q_alpha."""
    if np.abs(design.slope).max() > 100.0:
        raise ModelError("slope", "ratios in -100..100", f"{np.abs(design.slope).max():.3g}")
    i, others = design.catch_joint, [k for k in design.free if k != design.catch_joint]
    ends = np.array([arm.q_min[others], arm.q_max[others]]) * design.slope
    low, high = (design.q_catch + x.sum() for x in (ends.min(axis=0), ends.max(axis=0)))
    if not (arm.q_min[i] < high and low < arm.q_max[i]):
        room = f"an angle in {arm.q_min[i]:.3f}..{arm.q_max[i]:.3f} rad"
        given = f"{low:.3f}" if low == high else f"{low:.3f}..{high:.3f} with its slope"
        raise ModelError("q_catch", room, given, do="angles are in rad")


def coupling_of(n: int, design: MapDesign) -> Array:
    """Return A = dq_o/dp: how far each of n joints turns in l_c, shape (n, 3)."""
    A, further = np.zeros((n, 3)), [k for k in range(n) if k not in design.free]
    A[list(design.free)] = np.eye(3)
    others = [a for a in range(3) if design.free[a] != design.catch_joint]
    A[design.catch_joint, others] = design.slope
    if design.coupling:
        A[further] = design.coupling
    return A


def tangent_of(arm: Arm, design: MapDesign) -> Tangent:
    """Return the arrays of l_c, eq. (5), for an arm; ModelError where it cannot be built."""
    check_joints(arm, design)
    i = design.catch_joint
    _check_angle(arm, design)
    if not 1.0 <= design.kappa <= 100.0:
        raise ModelError("kappa", "a ratio in 1..100", design.kappa)
    if not -100.0 <= design.inward <= 100.0:
        raise ModelError("inward", "a ratio in -100..100", design.inward)
    if np.abs(design.coupling or 0.0).max() > 100.0:
        raise ModelError("coupling", "ratios in -100..100", f"{np.abs(design.coupling).max():.3g}")
    if design.inward != 0.0 and arm.chain.prismatic[i] > 0.0:
        raise ModelError("inward", "0 where the catch joint slides", design.inward)
    plane = plane_of(
        arm, design.catch_joint, q_catch=design.q_catch, kappa=design.kappa, inward=design.inward
    )
    return Tangent(
        chain=arm.chain,
        free=design.free,
        catch_joint=i,
        catch=design.free.index(i),
        q_catch=design.q_catch,
        kappa=design.kappa,
        inward=design.inward,
        q_rest=arm.q_ready.copy(),
        A=coupling_of(arm.n, design),
        planar=plane is not None and design.free == (0, 1, 2) and not any(design.slope),
        plane=np.zeros(7) if plane is None else plane,
    )


def warnings_of(arm: Arm, design: MapDesign | None = None) -> tuple[str, ...]:
    """Return what makes no sense: ready pose, palm; nothing where all does.

    Notes of how its file was read, ``arm.model.notes``, are logged where it is loaded.

    Args:
        arm: The arm.
        design: Design of its map; the one that follows from the arm if left out.
    """
    return (*_at_rest(arm), *_near_ends(arm), *_palm(arm, design))


def _at_rest(arm: Arm) -> Iterator[str]:
    """Yield the drives of which the ready pose takes more than half of the torque."""
    links, still = arm.model.links, np.zeros(arm.n)
    share = arm.limits.torque_ratio(arm.torque(arm.q_ready, still, still), np.zeros(len(links)))
    for link, x in zip(links, share, strict=True):
        if x > 0.5:
            yield f"the ready pose takes {100.0 * x:.0f} % of the torque of {link.name!r} at rest"


def _near_ends(arm: Arm) -> Iterator[str]:
    """Yield the joints whose ready angle is in the last 5 % of the range, or outside."""
    rows = zip(arm.names, arm.q_ready, arm.q_min, arm.q_max, strict=True)
    for name, q, low, high in rows:
        if not low <= q <= high:
            yield f"the ready pose has {name!r} at {q:.3g}, outside {low:.3g}..{high:.3g}"
        elif min(q - low, high - q) < 0.05 * (high - low):
            yield f"the ready pose has {name!r} at {q:.3g}, near the end of {low:.3g}..{high:.3g}"


def _palm(arm: Arm, design: MapDesign | None) -> Iterator[str]:
    """Yield a line if the palm faces no ball within 78 degrees, ready or at the catch."""
    if arm.n < 3:
        return
    design = default_design(arm) if design is None else design
    catch: Array = arm.q_ready.copy()
    others = [k for k in design.free if k != design.catch_joint]
    catch[design.catch_joint] = design.q_catch + catch[others] @ design.slope
    most = max(_facing(arm, q) for q in (arm.q_ready, catch))
    if most < 0.2:
        yield (
            "the palm faces away from the balls, in the ready pose and at the catch: by"
            f" {np.rad2deg(np.arccos(most)):.0f} degrees at least; hold other joints otherwise,"
            " or name another tip"
        )


def _facing(arm: Arm, q: Array) -> float:
    """Return the largest cosine between the palm's normal and where a default ball comes from."""
    normal = arm.orientation(q)[:, 2]
    return max(
        float(normal @ (np.cos(d) * np.cos(a), np.cos(d) * np.sin(a), np.sin(d)))
        for a in (-0.15, 0.0, 0.15)  # azimuth from +x [rad]
        for d in (0.24, 0.5, 0.78)  # descent [rad]
    )
