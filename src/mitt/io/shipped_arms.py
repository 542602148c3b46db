"""The arms that come with mitt: what each is, the design that ships, and how well it catches.

What an arm is called, and where its numbers are from, is in ``data/arms.toml``; designs are arm
files in ``data/designs``. Figures are measured by ``benchmarks/shipped_arms.py`` alone, which
writes ``data/figures.json``; a digest says of which design each row is.
"""

import hashlib
import json
from dataclasses import asdict, dataclass
from typing import Any, Final, final

import numpy as np

from mitt.core.arm.arm import identity_of
from mitt.io.arm_file import ArmSpec, ChosenArm, read_arm_file
from mitt.io.load import arm_names
from mitt.io.reading import data_path, read_json, read_toml, shipped, shipped_path
from mitt.io.wam import LIMIT_SETS

SCHEMA: Final = "mitt.figures/1"
"""Schema of the file of figures."""

FIGURES: Final = data_path("figures.json")
"""The file of figures."""

#: Digits behind the point that a digest tells apart: beyond them machines differ.
_DIGITS = 9


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class Figures:
    """What came of throws at a design that ships: ``mitt catch --arm NAME --limits LIMITS``.

    Attributes:
        digest: Of the design, as of :func:`arm_digest`.
        joints: Active joints.
        hand: The hand at its flange.
        throws: Number of throws.
        caught: How many of them were caught.
        beyond: Ticks beyond a limit, and contacts beyond what hand and arm take.
        relative_speed_m_s: Median speed of the ball relative to the hand at first contact [m/s].
        force_n: Median of the largest contact forces [N].
    """

    digest: str
    joints: tuple[str, ...]
    hand: str
    throws: int
    caught: int
    beyond: int
    relative_speed_m_s: float
    force_n: float


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ShippedArm:
    """An arm by name.

    Attributes:
        name: Name, which stands wherever an arm is taken.
        arm: Name of the arm, whichever hand it has.
        limits: Limit set.
        title: Vendor and model.
        source: Where its numbers are from.
        designed: Whether it has a design that ships, and so catches at once.
        figures: How well it catches; None where that was not measured.
    """

    name: str
    arm: str
    limits: str
    title: str
    source: str
    designed: bool
    figures: Figures | None

    @property
    def spec(self) -> ArmSpec:
        """What is said to ``mitt catch`` to have it."""
        return ArmSpec(arm=self.name, limits=self.limits if self.name == "wam" else None)


def shipped_arms() -> tuple[ShippedArm, ...]:
    """Return all arms by name: the WAM with each of its limit sets, then the others.

    An arm has its design under its own name; where the other hand has one too, that is called
    by the arm's name and the hand's. Each has a ``name``, ``limits``, a ``title``, a ``source``,
    and ``figures``: ``joints``, ``hand``, ``throws``, ``caught``, ``relative_speed_m_s``,
    ``force_n``, or None where nothing ships.
    """
    named = [("wam", "wam", limits) for limits in LIMIT_SETS]
    designs = {x: read_arm_file(shipped_path("designs", x)) for x in shipped("designs")}
    for arm in arm_names()[1:]:
        own = sorted(x for x, file in designs.items() if file.arm == arm)
        named += [(x, arm, str(designs[x].limits or arm)) for x in own] or [(arm, arm, arm)]
    about, rows = read_toml(data_path("arms.toml")), _rows()
    order = list(about)
    named.sort(key=lambda x: order.index(x[1]))
    return tuple(
        ShippedArm(
            name=name,
            arm=arm,
            limits=limits,
            designed=name in ("wam", *designs),
            figures=rows.get((name, limits)),
            **about[arm],
        )
        for name, arm, limits in named
    )


def _rows() -> dict[tuple[str, str], Figures]:
    """Return the figures by name and limits; none where nothing was measured."""
    rows = read_json(FIGURES)["rows"] if FIGURES.exists() else []
    return {
        (row.pop("name"), row.pop("limits")): Figures(joints=tuple(row.pop("joints")), **row)
        for row in rows
    }


def arm_digest(chosen: ChosenArm) -> str:
    """Return the SHA-256 of all numbers of an arm, its limits, its hand, its map and its throws."""
    arm, file = chosen.arm, chosen.file
    of = [
        identity_of(arm),
        asdict(chosen.design),
        arm.limits.name,
        arm.force,
        None if file is None or file.throws is None else file.throws.model_dump(),
        None if file is None or file.arrivals is None else file.arrivals.model_dump(),
        None if file is None else [file.hand, file.hand_tilt],
    ]
    return hashlib.sha256(json.dumps(_rounded(of), sort_keys=True).encode()).hexdigest()


def _rounded(value: Any) -> Any:  # noqa: ANN401 (any JSON value)
    """Return a value with the digits that are the same on each machine."""
    if isinstance(value, dict):
        return {key: _rounded(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_rounded(inner) for inner in value]
    if isinstance(value, float):
        return round(value, _DIGITS) + 0.0  # no -0.0
    return value
