"""Whether numbers of an arm can be in SI units: what cannot be is refused, else doubted in a note.

A hinge may state any speed: files of walking robots allow 40 rad/s, and others write 1000 for "no
limit". So a speed of the description file is only doubted. A limit set has a unit of its own, and
is refused.
"""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from mitt.core.arm.description import Capsule, Link, meant_in_radians, steel_ball
from mitt.core.errors import ModelError
from mitt.core.signals import GRAVITY, Array
from mitt.io.description_files import Stated, Tree

#: Widest range of a hinge that is taken for radians [rad]; a wider one was written in degrees.
WIDEST: Final = 4.0 * np.pi
#: End of a range above which it is no angle in degrees either.
_ENDLESS = 4000.0
#: Speed of a hinge above which a unit is doubted, and above which a limit set is refused [rad/s].
#: Choices of this project: arms turn at up to 10 rad/s, and state 60 to 400 degrees a second.
_DOUBTED = 20.0
_FASTEST = 20.0 * np.pi
#: Speed of a hinge below which its unit is doubted [rad/s].
_SLOWEST = 0.1
#: Width of a hinge's range below which it is doubted [rad]: 4 pi read as degrees.
_NARROWEST = np.radians(WIDEST)
#: Range or speed of a sliding joint above which it is doubted [m, m/s].
_FARTHEST = 20.0
#: Torque of a joint, in torques that its weight asks for, above which and below which it is
#: doubted. Real arms have up to 10. Least length that counts as a lever [m].
_STRONGEST = 60.0
_WEAKEST = 0.05
_SHORTEST = 0.1
#: Lengths of arms [m], and masses over their cubes [kg/m^3], that are believed: real arms have 3 to
#: 60 kg/m^3.
_REACH = (0.03, 12.0)
_DENSITY = (0.3, 1000.0)
#: Distance of a link's centre of mass, in lengths of the arm, above which it is doubted.
_FAR_MASS = 3.0
#: Size of a link's shapes, in lengths of the arm, above and below which it is doubted: the smallest
#: unit of length that is confused with metres is the foot, the largest the centimetre.
_WIDEST_SHAPE = 2.0
_SMALLEST_SHAPE = 2e-3
#: Radius of gyration of a link about its centre of mass, in lengths of the arm and in its own size,
#: above which it is doubted. A rod has 0.29 of its length, and nothing more than a half of its
#: size; inertias that were identified, as those of the Panda, come out at up to 1.25.
_WIDEST_BODY = 0.5
_OWN_SIZE = 1.5
#: Least moment of inertia, in those of a ball of steel: no metal has less.
_DENSEST = 0.1


def check_range(where: str, low: float, high: float) -> None:
    """Refuse a range of a hinge [rad] that was written in degrees.

    Raises:
        ModelError: An end is beyond 4 pi.
    """
    if max(abs(low), abs(high)) > WIDEST:
        do = "these look like degrees: write radians"
        if max(abs(low), abs(high)) > _ENDLESS:
            do = "these stand for no end: write the range that the joint has, in radians"
        raise ModelError(where, "a range within +-4 pi rad", f"{low:g}..{high:g}", do=do)


def check_set(tree: Tree, name: str, bounds: Mapping[str, Mapping[str, float]]) -> None:
    """Refuse ranges and speeds of a limit set that were written in degrees.

    Args:
        tree: The joints.
        name: Name of the set.
        bounds: Bounds by kind and joint, as of :meth:`mitt.core.arm.limits.LimitSet.fitted`.

    Raises:
        ModelError: A hinge has a range beyond 4 pi rad or a speed beyond 20 pi rad/s.
    """
    for joint, low in bounds.get("lower", {}).items():
        if tree.joint(joint).kind == "hinge":
            check_range(f"limits {name} of joint {joint!r}", low, bounds["upper"][joint])
    for joint, speed in bounds.get("speed", {}).items():
        if tree.joint(joint).kind == "hinge" and speed > _FASTEST:
            raise ModelError(
                f"limits {name} of joint {joint!r}",
                "a speed of at most 20 pi rad/s",
                f"{speed:g}",
                do=f"this looks like degrees: write radians, {np.radians(speed):.4g}",
            )


def doubts(stated: Stated, links: Sequence[Link], tool: Array) -> tuple[str, ...]:
    """Return notes of what is hardly meant: ranges, speeds, torques, lengths, masses, inertias.

    Args:
        stated: What the file states, with the bounds of a limit set.
        links: The links of the arm, from the base outwards; what is held is not doubted.
        tool: Frame of the tool in that of the last link, shape (4, 4).
    """
    lengths = _lengths(links, tool)
    strong, weak = _torques(stated, links, lengths)
    reach, mass = float(lengths.sum()), sum(x.mass for x in links)
    apart = {x.name: float(np.linalg.norm(x.com)) for x in links}
    radii = {x.name: float(np.sqrt(np.linalg.eigvalsh(x.inertia)[2] / x.mass)) for x in links}
    sizes = {x.name: _size(x.capsules) for x in links}
    off = _long(
        "centres of mass far from their joints",
        apart,
        _FAR_MASS * reach,
        "if they are in mm, write metres",
    )
    sized = _sizes(reach, mass), off
    active = [x for x in links if x.held is None]
    hinges = [x for x in active if not x.prismatic]
    slow = {
        x.name: f"{stated.speed[x.name]:.4g} rad/s"
        for x in hinges
        if stated.speed[x.name] < _SLOWEST
    }
    found = (
        _narrow(hinges),
        _fast({x.name: stated.speed[x.name] for x in hinges if stated.speed[x.name] > _DOUBTED}),
        _named("small speed limits", slow, "write rad/s"),
        _named(
            "large ranges or speeds of sliding joints",
            _far(stated, active),
            "if they are in mm, write metres",
        ),
        _named(
            "large torque limits for the weight and length that they move",
            strong,
            'do they stand for "no limit", or for another'
            " unit? write what the drives give, here or as torque in a limits file",
        ),
        *sized,
        ""
        if any(sized)
        else _named(
            "small torque limits for the weight that they move",
            weak,
            "write N m, or N for sliding joints",
        ),
        _long(
            "large inertias for their masses and sizes, radius of gyration behind",
            _wide(links, radii, sizes, lengths),
            0.0,
            "write kg m^2, about the centre of mass",
        ),
        _dense(links),
        _long(
            "large shapes for the length of the arm, behind",
            sizes,
            _WIDEST_SHAPE * reach,
            "check units and scale: of a mesh in mm, scale 0.001",
        ),
        _named(
            "small shapes for the length of the arm, behind",
            {name: f"{x:.4g} m" for name, x in sizes.items() if 0.0 < x < _SMALLEST_SHAPE * reach},
            "check units and scale",
        ),
    )
    return tuple(x for x in found if x)


def _named(what: str, values: Mapping[str, str], do: str) -> str:
    """Return a note that names two of the joints; empty where there are none."""
    if not values:
        return ""
    named = [f"{name} {x}" for name, x in list(values.items())[:2]]
    rest = f" and {len(values) - 2} more" if len(values) > 2 else ""
    return f"{what}: {', '.join(named)}{rest}; {do}"


def _narrow(hinges: Sequence[Link]) -> str:
    """Return a note of the hinges whose range would be one of radians taken for degrees."""
    narrow = {x.name: x.q_max - x.q_min for x in hinges if x.q_max - x.q_min < _NARROWEST}
    if not narrow:
        return ""
    x = next(x for x in hinges if x.name in narrow)
    widths = {name: f"{x:.4g} rad wide" for name, x in narrow.items()}
    return _named("narrow ranges", widths, meant_in_radians(x))


def _fast(fast: Mapping[str, float]) -> str:
    """Return a note of the hinges whose speed limits may be in degrees."""
    first = next(iter(fast), "")
    radians = np.radians(fast.get(first, 0.0))
    do = (
        f"if they are in degrees, write radians ({first} {radians:.4g}), in the file or as speed"
        " in a limits file (--limits FILE.toml)"
    )
    speeds = {name: f"{x:.4g} rad/s" for name, x in fast.items()}
    return _named("large speed limits", speeds, do)


def _far(stated: Stated, active: Sequence[Link]) -> dict[str, str]:
    """Return the sliding joints whose ranges or speeds may be in millimetres."""
    most = {
        x.name: max(abs(x.q_min), abs(x.q_max), stated.speed[x.name]) for x in active if x.prismatic
    }
    return {name: f"{x:.4g} m or m/s" for name, x in most.items() if x > _FARTHEST}


def _lengths(links: Sequence[Link], tool: Array) -> Array:
    """Return the length from each joint to the next, the tip behind the last [m], shape (N,)."""
    ends = [x.placement[:3, 3] for x in links[1:]] + [tool[:3, 3]]
    return np.array([float(np.linalg.norm(p)) for p in ends])


def _torques(
    stated: Stated, links: Sequence[Link], lengths: Array
) -> tuple[dict[str, str], dict[str, str]]:
    """Return the active joints whose torque is far beyond and far below what weight asks of them.

    That is the weight of what is behind the joint, all stretched out, and for the former that of
    half of the arm at its tip besides.
    """
    strong: dict[str, str] = {}
    weak: dict[str, str] = {}
    load = 0.5 * sum(x.mass for x in links)
    for k, x in enumerate(links):
        if x.held is not None:
            continue
        at = np.concatenate(([0.0], np.cumsum(lengths[k:])))
        behind = links[k:]
        if x.prismatic:
            weight, more = sum(y.mass for y in behind), load
        else:
            arms = [d + float(np.linalg.norm(y.com)) for d, y in zip(at, behind, strict=False)]
            weight = sum(y.mass * d for y, d in zip(behind, arms, strict=True))
            more = load * max(float(at[-1]), _SHORTEST)
        torque = stated.torque[x.name]
        words = {x.name: f"{torque:.4g} {'N' if x.prismatic else 'N m'}"}
        if torque > _STRONGEST * GRAVITY * (weight + more):
            strong |= words
        elif torque < _WEAKEST * GRAVITY * weight:
            weak |= words
    return strong, weak


def _sizes(reach: float, mass: float) -> str:
    """Return a note of an arm that is too long, too short, too heavy or too light for one."""
    if not _REACH[0] <= reach <= _REACH[1]:
        return (
            f"the joints up to the tip are {reach:.4g} m long in all; if lengths are in mm,"
            " write metres"
        )
    if not _DENSITY[0] <= mass / reach**3 <= _DENSITY[1]:
        return (
            f"the arm weighs {mass:.4g} kg and is {reach:.3g} m long; if masses are in grams"
            " or pounds, or lengths in another unit, write kg and metres"
        )
    return ""


def _long(what: str, lengths: Mapping[str, float], most: float, do: str) -> str:
    """Return a note of links with a length that nothing of the arm has [m]."""
    return _named(what, {name: f"{x:.4g} m" for name, x in lengths.items() if x > most}, do)


def _size(capsules: Sequence[Capsule]) -> float:
    """Return the largest size of shapes along an axis [m]; 0 without any."""
    if not capsules:
        return 0.0
    ends = [
        np.array(end) + side * c.radius
        for c in capsules
        for end in (c.start, c.end)
        for side in (-1.0, 1.0)
    ]
    return float(np.ptp(ends, axis=0).max())


def _wide(
    links: Sequence[Link], radii: Mapping[str, float], sizes: Mapping[str, float], lengths: Array
) -> dict[str, float]:
    """Return the radii of gyration [m] that are too large for the links and for the arm."""
    reach = max(float(lengths.sum()), _SHORTEST)
    own = {
        x.name: max(sizes[x.name], float(length), 2.0 * float(np.linalg.norm(x.com)))
        for x, length in zip(links, lengths, strict=True)
    }
    return {
        name: x
        for name, x in radii.items()
        if x > _WIDEST_BODY * reach or (sizes[name] > 0.0 and x > _OWN_SIZE * own[name])
    }


def _dense(links: Sequence[Link]) -> str:
    """Return a note of inertias that no metal is dense enough for."""
    largest = {x.name: float(np.linalg.eigvalsh(x.inertia)[2]) for x in links}
    dense = {
        x.name: f"{largest[x.name]:.4g} kg m^2 for {x.mass:.4g} kg"
        for x in links
        if largest[x.name] < _DENSEST * steel_ball(x.mass)
    }
    return _named(
        "small inertias for their masses", dense, "write kg m^2, about the centre of mass"
    )
