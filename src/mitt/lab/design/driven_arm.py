"""The arm with every joint between its base and its tip that has a drive active."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mitt.core.arm.arm import Arm
from mitt.core.arm.description import Hand
from mitt.core.arm.limits import LimitSet
from mitt.core.errors import ModelError
from mitt.io.arm_file import limits_of
from mitt.io.load import (
    Mount,
    bounded,
    build_arm,
    check_active,
    described,
    is_described,
    is_shipped,
    read_described,
)
from mitt.io.wam import LIMIT_SETS

#: Half of the range of a joint that is held where it is [rad].
_HELD_RANGE = 5e-4
#: Joints of the WAM.
_WAM = ("j1", "j2", "j3", "j4")


def whole_arm(
    arm: str | Path,
    *,
    tip: str | None,
    limits: str | Path | None,
    hand: Hand | None,
    mount: Mount | None = "plate",
    joints: Sequence[str] = (),
) -> Arm:
    """Return an arm with all its driven joints active.

    Args:
        arm: Name of an arm, or a URDF or MJCF file.
        tip: Frame of the file at the catch point; None: the flange of an arm by name.
        limits: Name of a limit set, or a TOML file.
        hand: What is mounted at the tip.
        mount: What of it is at the tip of a file.
        joints: Joints that have to be among the driven ones, where they are between base and tip.

    Raises:
        MittError: The arm cannot be.
    """
    given = limits_of(limits, arm)
    if str(arm) == "wam":
        return build_arm("wam", tip=tip, joints=_WAM, limits=given, hand=hand or "none")
    path = described(arm)
    if tip is None and is_shipped(arm):
        tip = read_described(path).tree.flange
    if tip is None and is_described(path):
        links = ", ".join(read_described(path).tree.links) or "none"
        raise ModelError(
            "--tip", "the link or site of the palm", "none", do=f"links of {arm}: {links}"
        )
    names = None if tip is None else driven_joints(path, tip, given, joints)
    whole = build_arm(arm, tip=tip, joints=names, limits=given, hand=hand, hand_mount=mount)
    endless = [link.name for link in whole.model.links if link.held is not None]
    if endless:
        raise ModelError(
            str(arm),
            "a range for each joint with a torque and a speed",
            f"none for {endless}",
            do="state it in the file or by --limits",
        )
    return whole


def held_as(whole: Arm, held: Mapping[str, float]) -> Arm:
    """Return an arm some of whose joints hardly turn: a search leaves them where they are held.

    Their angles [rad]: within 0.5 mrad the search keeps to them.
    """
    links = tuple(
        replace(x, q_min=held[x.name] - _HELD_RANGE, q_max=held[x.name] + _HELD_RANGE)
        if x.name in held
        else x
        for x in whole.model.links
    )
    ready = np.array([held.get(x.name, q) for x, q in zip(links, whole.model.q_ready, strict=True)])
    return Arm(replace(whole.model, links=links, q_ready=ready), whole.limits)


def movable(whole: Arm) -> NDArray[np.bool_]:
    """Say which joints are not held as by :func:`held_as`, shape (N,)."""
    free: NDArray[np.bool_] = whole.q_max - whole.q_min > 4.0 * _HELD_RANGE
    return free


def driven_joints(
    path: Path, tip: str, limits: str | LimitSet | None, joints: Sequence[str] = ()
) -> Sequence[str] | None:
    """Return the joints between base and tip with a range, a torque, a speed and a mass behind.

    None where the file is of a kind that nobody reads.

    Raises:
        MittError: There are fewer than three, or one of ``joints`` is between base and tip and is
            none of them.
    """
    if not is_described(path) or limits in LIMIT_SETS:
        return None
    stated = read_described(path)
    chain = stated.tree.joints_to(tip)
    stated, _ = bounded(stated, limits if isinstance(limits, LimitSet) else None, chain)
    own = [name for name in chain if name not in stated.mimics]
    for name in joints:
        if name in own:
            check_active(stated, name)
    found = [name for name in own if not stated.missing(name)]
    if len(found) < 3:
        lacking = [name for name in own if stated.missing(name)]
        do = stated.remedy(*lacking) if lacking else "name as tip a link behind more joints"
        wanted = f"three joints up to {tip!r} with a range, a torque, a speed and a mass"
        raise ModelError(str(path), wanted, ", ".join(found) or "none", do=do)
    return found
