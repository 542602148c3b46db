"""Arm files: an arm, how it is held and ready, its limits, its hand, its map (docs/arms.md)."""

import hashlib
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal, Self, final

import numpy as np
from pydantic import Field, model_validator

from mitt import checks
from mitt.errors import FileError, InputError, MittError, printable
from mitt.files.files import write_text
from mitt.files.limit_files import read_limits
from mitt.files.schema import Finite, Part, parsed
from mitt.files.throws import ArrivalSettings, ThrowSettings
from mitt.files.toml_text import toml_text
from mitt.generator.design import MapDesign, tangent_of
from mitt.reading import read_bytes, read_toml
from mitt.robot.arm import Arm
from mitt.robot.basket import MOST_TILT, Basket, hand_named
from mitt.robot.description import Hand
from mitt.robot.description_files import MAX_BYTES
from mitt.robot.limit_sets import LimitSet
from mitt.robot.load import Mount, load_arm
from mitt.robot.wam import LIMIT_SETS

SCHEMA = "mitt.arm/1"
HandName = Literal["three-finger", "basket", "none"]
Name = Annotated[str, Field(min_length=1, max_length=200)]
_Names = Annotated[list[Name], Field(min_length=1, max_length=64)]


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ArmFile:
    """What an arm file says.

    Attributes:
        arm: Name of an arm, or path of a URDF or MJCF file.
        sha256: Digest of that file; any file will do where it is None.
        tip: Frame of the file, z along the palm's normal, at which the hand is mounted.
        joints: Active joints; empty for those of an arm by name.
        ready: Ready pose of these joints, in their order [rad]; None: as ``load_arm`` chooses.
        held: Angles at which joints are held [rad]; any other is held at 0, moved into its range.
        limits: Name of a limit set, or path of a TOML file; None: those of the arm's file.
        hand: Name of the hand mounted at the tip, or ``none``.
        hand_turn: How far it is turned about the z axis of the tip [rad].
        hand_mount: What of it is at the tip: its catch point, or its plate.
        hand_tilt: How far a basket is then turned about the y axis of the tip [rad].
        hand_force: Largest force of a contact that it takes [N]; None: as that hand says.
        map: Design of its map; None where it follows from the arm.
        throws: Where its balls come from; None where it says nothing.
        arrivals: How they arrive there, for which maps are learned; None: as default throws do.
    """

    arm: str | Path
    sha256: str | None = None
    tip: str | None = None
    joints: tuple[str, ...] = ()
    ready: tuple[float, ...] | None = None
    held: Mapping[str, float] = field(default_factory=dict)
    limits: str | Path | None = None
    hand: HandName = "three-finger"
    hand_turn: float = 0.0
    hand_mount: Mount = "catch"
    hand_tilt: float = 0.0
    hand_force: float | None = None
    map: MapDesign | None = None
    throws: ThrowSettings | None = None
    arrivals: ArrivalSettings | None = None

    def load(self, *, limits: str | LimitSet | None = None) -> Arm:
        """Return the arm.

        Args:
            limits: Limits in the place of its own.

        Raises:
            MittError: The arm cannot be; the message says why.
        """
        if isinstance(self.arm, Path) and self.sha256 is not None:
            given = digest_of(self.arm)
            if given != self.sha256:
                raise FileError(str(self.arm), f"the file of SHA-256 {self.sha256[:16]}...",
                                f"{given[:16]}...", do="take that file, or sha256 out of the arm"
                                " file and try whether the arm still catches")  # fmt: skip
        arm = load_arm(
            self.arm,
            tip=self.tip,
            joints=self.joints or None,
            held=self.held,
            ready=self.ready,
            limits=limits_of(self.limits if limits is None else limits),
            hand=hand_of(self.hand, self.hand_tilt, self.hand_force),
            hand_turn=self.hand_turn,
            hand_mount=self.hand_mount,
        )
        if self.throws is None or self.throws.at is None:
            return arm
        aim = np.array([self.throws.at, self.throws.around])
        rows = None if self.arrivals is None else self.arrivals.rows
        return Arm(replace(arm.model, aim=aim, arrivals=rows), arm.limits)


class _Arm(Part):
    file: Name | None = None
    name: Name | None = None
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")] | None = None
    tip: Name | None = None
    joints: _Names | None = None
    ready: Annotated[list[Finite], Field(min_length=1, max_length=64)] | None = None
    limits: Name | None = None
    held: dict[str, Finite] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _one(self) -> Self:
        """Refuse two arms, none, and what an arm by name decides itself."""
        if (self.file is None) == (self.name is None):
            raise ValueError("one of file and name")
        if self.file is not None and (self.tip is None or self.joints is None):
            raise ValueError("tip and joints beside file")
        if self.name is not None and (self.tip is not None or self.sha256 is not None):
            raise ValueError("no tip and no sha256 beside name")
        return self


class _Hand(Part):
    name: HandName = "three-finger"
    turn: Annotated[float, Field(ge=-10.0, le=10.0)] = 0.0
    mount: Mount = "catch"
    tilt: Annotated[float, Field(ge=-MOST_TILT, le=MOST_TILT)] = 0.0
    force: Annotated[float, Field(gt=0.0, le=1e6)] | None = None


class _Map(Part):
    catch_joint: Annotated[int, Field(ge=0, le=63)] = 2
    q_catch: Finite = MapDesign().q_catch
    kappa: Finite = 1.0
    inward: Finite = 0.0
    order: Annotated[int, Field(ge=2, le=20)] = 4
    free: tuple[int, int, int] = (0, 1, 2)
    coupling: Annotated[tuple[tuple[Finite, Finite, Finite], ...], Field(max_length=64)] = ()
    slope: tuple[Finite, Finite] = (0.0, 0.0)
    match_weight: Annotated[float, Field(ge=0.0, le=1e6)] = 0.0


class _ArmFile(Part):
    schema_name: Literal["mitt.arm/1"] = Field(alias="schema")
    arm: _Arm
    hand: _Hand = _Hand()
    map: _Map | None = None
    throws: ThrowSettings | None = None
    arrivals: ArrivalSettings | None = None


def is_arm_file(name_or_path: str | Path) -> bool:
    """Say whether what a user calls an arm is an arm file."""
    return Path(name_or_path).suffix == ".toml"


def read_arm_file(path: Path) -> ArmFile:
    """Return what an arm file says; paths in it are below its own folder, or absolute.

    Raises:
        FileError: The file is missing, cut short, of another schema, or says what cannot be.
    """
    path = checks.path("arm file", path)
    raw = read_toml(path, wanted="TOML of an arm")
    content = parsed(
        _ArmFile, raw, place=str(path), wanted=f"an arm of schema {SCHEMA}", do="see docs/arms.md"
    )
    try:
        return _arm_file(content, path.parent)
    except MittError as error:
        raise FileError(str(path), "an arm that can be", error) from error


def _arm_file(content: _ArmFile, folder: Path) -> ArmFile:
    """Return what a checked file says, its paths found from its folder."""
    arm, limits = content.arm, content.arm.limits
    if arm.name is not None and content.hand.name == "none":
        raise InputError("hand", "a hand on an arm by name", "none")
    if content.hand.tilt and content.hand.name != "basket":
        raise InputError("tilt", "a basket", content.hand.name, do="leave it out")
    if content.hand.force is not None and content.hand.name == "none":
        raise InputError("force of hand", "a hand", "none", do="leave it out")
    if content.arrivals is not None and (content.throws is None or content.throws.at is None):
        raise InputError("arrivals", "a box where they arrive, at and around of throws", "none")
    if arm.ready is not None and arm.joints is not None and len(arm.ready) != len(arm.joints):
        raise InputError("ready", f"{len(arm.joints)} angles, one for each joint", len(arm.ready))
    return ArmFile(
        arm=arm.name or "" if arm.file is None else folder / arm.file,
        sha256=arm.sha256,
        tip=arm.tip,
        joints=tuple(arm.joints or ()),
        ready=None if arm.ready is None else tuple(arm.ready),
        held=arm.held,
        limits=folder / limits if limits is not None and limits.endswith(".toml") else limits,
        hand=content.hand.name,
        hand_turn=content.hand.turn,
        hand_mount=content.hand.mount,
        hand_tilt=content.hand.tilt,
        hand_force=content.hand.force,
        map=None if content.map is None else MapDesign(**content.map.model_dump()),
        throws=content.throws,
        arrivals=content.arrivals,
    )


def write_arm_file(path: Path, arm: ArmFile, *, comment: str = "") -> None:
    """Write an arm file atomically; paths are written as seen from its folder.

    Args:
        path: The file.
        arm: What it says.
        comment: What stands at its top, line by line.
    """
    own: dict[str, Any] = {
        "file": _seen_from(path.parent, arm.arm) if isinstance(arm.arm, Path) else None,
        "name": None if isinstance(arm.arm, Path) else arm.arm,
        "sha256": arm.sha256,
        "tip": arm.tip,
        "joints": arm.joints or None,
        "ready": arm.ready,
        "limits": _seen_from(path.parent, arm.limits) if isinstance(arm.limits, Path)
        else arm.limits,
        "held": dict(arm.held),
    }  # fmt: skip
    tables: dict[str, Any] = {
        "schema": SCHEMA,
        "arm": own,
        "hand": {"name": arm.hand, "turn": float(arm.hand_turn), "mount": arm.hand_mount}
        | ({"tilt": float(arm.hand_tilt)} if arm.hand_tilt else {})
        | ({} if arm.hand_force is None else {"force": float(arm.hand_force)}),
        "map": None if arm.map is None else asdict(arm.map),
        "throws": None if arm.throws is None
        else arm.throws.model_dump(exclude_none=True, exclude_defaults=True),
        "arrivals": None if arm.arrivals is None else arm.arrivals.model_dump(),
    }  # fmt: skip
    head = "".join(f"# {printable(line)}".rstrip() + "\n" for line in comment.splitlines())
    write_text(path, head + toml_text(tables))


def _seen_from(folder: Path, path: Path) -> str:
    """Return a path as it is written in a file of a folder."""
    return Path(os.path.relpath(path.absolute(), folder.absolute())).as_posix()


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a description file."""
    return hashlib.sha256(read_bytes(path, max_bytes=MAX_BYTES)).hexdigest()


def hand_of(name: str, tilt: float, force: float | None = None) -> Hand | None:
    """Return a hand by name; a basket is tilted by an angle [rad], any takes a force [N]."""
    hand = hand_named(name)
    hand = replace(hand, tilt=tilt) if isinstance(hand, Basket) else hand
    return hand if hand is None or force is None else replace(hand, force=force)


def limits_of(limits: str | Path | LimitSet | None) -> str | LimitSet | None:
    """Return limits as ``load_arm`` takes them: sets of the WAM and ``model`` stay names."""
    if limits is None or isinstance(limits, LimitSet):
        return limits
    named = isinstance(limits, str) and limits in ("model", *LIMIT_SETS)
    return str(limits) if named else read_limits(limits)


def open_arm(path: Path, *, limits: str | LimitSet | None = None) -> tuple[Arm, MapDesign | None]:
    """Return the arm of an arm file and the design of its map, None where it has none.

    Args:
        path: The arm file.
        limits: Limits in the place of those in the file: a name, a TOML file, or a set.

    Raises:
        FileError: The file does not say what it should.
        MittError: The arm or the map cannot be.
    """
    file = read_arm_file(path)
    arm = file.load(limits=limits)
    if file.map is not None:
        tangent_of(arm, file.map)  # refuses a map that this arm cannot have
    return arm, file.map
