"""Arms as a user names them: by name, from a description file, or from an arm file (docs/arms.md).

Here are the files as well that say of an arm what its description does not: limits, and where the
balls come from that it is thrown.
"""

import hashlib
import logging
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, final

import numpy as np
from pydantic import Field, create_model, field_validator, model_validator

from mitt.core import checks
from mitt.core.arm.arm import Arm
from mitt.core.arm.basket import MOST_TILT, Basket, hand_named
from mitt.core.arm.description import Hand
from mitt.core.arm.hands import HandModel
from mitt.core.arm.limits import KINDS, LimitSet
from mitt.core.errors import FileError, InputError, MittError, UnknownNameError, printable
from mitt.core.map.map_design import MapDesign, default_design, tangent_of
from mitt.core.signals import Array
from mitt.io.description_files import MAX_BYTES
from mitt.io.load import (
    Mount,
    arm_names,
    build_arm,
    checked_joints,
    is_shipped,
    with_encoders,
    with_hand,
)
from mitt.io.reading import changed_file, noted, read_bytes, read_toml, shipped, shipped_path
from mitt.io.schema import FileSection, FileSettings, Finite, from_plain, parsed
from mitt.io.wam import LIMIT_SETS
from mitt.io.writing import toml_text, write_text

SCHEMA = "mitt.arm/1"
LIMITS_SCHEMA = "mitt.limits/1"
HandName = Literal["three-finger", "basket", "none"]
Name = Annotated[str, Field(min_length=1, max_length=200)]
_Names = Annotated[list[Name], Field(min_length=1, max_length=64)]
_Row = Annotated[list[Finite], Field(min_length=1, max_length=64)]

Range = Annotated[tuple[float, float], Field(strict=False)]
Coordinate = Annotated[float, Field(ge=-100.0, le=100.0)]
Width = Annotated[float, Field(ge=0.0, le=10.0)]

#: What balls can arrive as: speed [m/s], descent and azimuth [rad], time of flight [s].
ARRIVALS = {
    "speed": (0.5, 30.0),
    "descent": (-1.5, 1.5),
    "azimuth": (-1.0, 1.0),
    "flight": (0.1, 3.0),
}


class ThrowSettings(FileSettings):
    """Ranges that the default throws are drawn from; what is left out stays as it is.

    Attributes:
        duration: Time of flight to the aim point [s].
        speed: Speed at release [m/s].
        distance: Horizontal distance of the release from the aim point [m].
        azimuth: Direction of the release [rad].
        height: Height of the release above the shoulder [m].
        spread: Factor on the width of the box that is aimed at.
        at: Centre of a box in space to aim at, world frame [m], in the place of that of the arm.
        around: Its half-widths [m].
    """

    duration: Range | None = None
    speed: Range | None = None
    distance: Range | None = None
    azimuth: Range | None = None
    height: Range | None = None
    spread: Annotated[float, Field(gt=0.0, le=10.0)] = 1.0
    at: Annotated[tuple[Coordinate, Coordinate, Coordinate], Field(strict=False)] | None = None
    around: Annotated[tuple[Width, Width, Width], Field(strict=False)] | None = None

    @field_validator("duration", "speed", "distance", "azimuth", "height")
    @classmethod
    def _ordered(cls, value: tuple[float, float] | None) -> tuple[float, float] | None:
        """Refuse a range whose ends are the wrong way round."""
        if value is not None and value[0] > value[1]:
            raise ValueError("a lower end and then an upper end")
        return value

    @model_validator(mode="after")
    def _whole(self) -> Self:
        """Refuse half a box."""
        if (self.at is None) != (self.around is None):
            raise ValueError("at and around, or neither")
        return self


class ArrivalSettings(FileSettings):
    """How balls arrive at the box that is aimed at: the ranges that maps are learned for.

    Attributes:
        speed: Speed of the ball [m/s].
        descent: Angle by which it comes down [rad].
        azimuth: Where it comes from, off +x [rad].
        flight: Time of flight before that [s].
    """

    speed: Range
    descent: Range
    flight: Range
    azimuth: Range = (-0.15, 0.15)

    @model_validator(mode="after")
    def _possible(self) -> Self:
        """Refuse ranges that no ball can have."""
        for name, (least, most) in ARRIVALS.items():
            low, high = getattr(self, name)
            if not least <= low <= high <= most:
                raise ValueError(f"{name}: a lower and an upper end in {least:g}..{most:g}")
        return self

    @property
    def rows(self) -> Array:
        """Speed, descent, azimuth and time of flight, least and most, shape (4, 2)."""
        return np.array([self.speed, self.descent, self.azimuth, self.flight])


class _Limited(FileSection):
    joints: Annotated[list[str], Field(min_length=1, max_length=64)]
    force: Annotated[float, Field(gt=0.0, le=1e6)] | None = None


if TYPE_CHECKING:
    _Limits = _Limited
else:  # a row for each kind of limit
    _Limits = create_model(
        "_Limits", __base__=_Limited, **dict.fromkeys(KINDS, (_Row | None, None))
    )


class _LimitsFile(FileSection):
    schema_name: Literal["mitt.limits/1"] = Field(alias="schema")
    limits: _Limits


def known_limits() -> tuple[str, ...]:
    """Return the names of all limit sets, those of the WAM and ``model`` first."""
    return ("model", *LIMIT_SETS, *shipped("limits"))


def read_limits(name_or_path: str | Path) -> LimitSet:
    """Return a limit set that ships, by name, or one from a TOML file.

    Raises:
        UnknownNameError: No set is called that.
        FileError: The file cannot be read, or does not say what it should.
    """
    path, ships = checks.path("limits", name_or_path), False
    if path.suffix != ".toml":
        if str(name_or_path) not in shipped("limits"):
            known = (*known_limits(), "a .toml file")
            raise UnknownNameError("limits", str(name_or_path), known)
        path, ships = shipped_path("limits", str(name_or_path)), True
    content = parsed(
        _LimitsFile,
        read_toml(path),
        place=str(path),
        wanted=f"limits of schema {LIMITS_SCHEMA}",
        do="see docs/arms.md",
    ).limits
    given = {kind: content.model_dump()[kind] for kind in KINDS}
    try:
        return LimitSet(
            name=path.stem,
            joints=tuple(content.joints),
            bounds={k: np.array(x) for k, x in given.items() if x is not None},
            force=np.inf if content.force is None else content.force,
            shipped=ships,
        )
    except MittError as error:
        raise FileError(str(path), "limits that joints can have", error) from error


def limits_of(limits: str | Path | LimitSet | None, arm: str | Path = "") -> str | LimitSet | None:
    """Return limits as ``build_arm`` takes them: sets of the WAM and ``model`` stay names.

    Args:
        limits: A name, a file or a set; None: those of the arm.
        arm: The arm; one that ships has the set of its own name.
    """
    if limits is None and is_shipped(arm):
        return read_limits(arm)
    if limits is None or isinstance(limits, LimitSet):
        return limits
    named = isinstance(limits, str) and limits in ("model", *LIMIT_SETS)
    return str(limits) if named else read_limits(limits)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ArmFile:
    """What an arm file says.

    Attributes:
        arm: Name of an arm, or path of a URDF or MJCF file.
        sha256: Digest of that file; any file will do where it is None.
        tip: Frame of the file, z along the palm's normal, at which the hand is mounted; None: the
            flange of an arm by name.
        joints: Active joints; empty for those of an arm by name.
        ready: Ready pose of these joints, in their order [rad]; None: as ``load_arm`` chooses.
        held: Angles at which joints are held [rad]; any other is held at 0, moved into its range.
        limits: Name of a limit set, or path of a TOML file; None: those of the arm's file.
        hand: Name of the hand mounted at the tip, or ``none``.
        hand_turn: How far it is turned about the z axis of the tip [rad].
        hand_mount: What of it is at the tip: its catch point, or its plate; None: the plate at an
            arm by name, the catch point at a file's.
        hand_tilt: How far a basket is then turned about the y axis of the tip [rad].
        hand_force: Largest force of a contact that it takes [N]; None: as that hand says.
        hand_depth: How far below a basket's ring the catch point is [m]; None: as a basket says.
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
    hand_mount: Mount | None = None
    hand_tilt: float = 0.0
    hand_force: float | None = None
    hand_depth: float | None = None
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
        self._check_digest()
        arm = build_arm(
            self.arm,
            tip=self.tip,
            joints=self.joints or None,
            held=self.held,
            ready=self.ready,
            limits=limits_of(self.limits if limits is None else limits, self.arm),
            hand=hand_of(self.hand, self.hand_tilt, self.hand_force, self.hand_depth),
            hand_turn=self.hand_turn,
            hand_mount=self.hand_mount,
        )
        model = replace(arm.model, design=self.map)
        if self.throws is not None and self.throws.at is not None:
            aim = np.array([self.throws.at, self.throws.around])
            rows = None if self.arrivals is None else self.arrivals.rows
            model = replace(model, aim=aim, arrivals=rows)
        arm = Arm(model, arm.limits)
        if self.map is not None:
            tangent_of(arm, self.map)  # refuses a map that this arm cannot have
        return arm

    def carrying(
        self, tool: Hand, *, joints: Sequence[str] = (), limits: str | Path | None = None
    ) -> Arm:
        """Return the arm with the tool of a task on the plate where its hand is.

        What is said of a catch is left out: hand, ready pose, map, throws; and of an arm by name
        which of its joints move.

        Args:
            tool: The tool.
            joints: Joints that move; if left out, all of an arm by name, of a description those
                that the arm file names.
            limits: Limits in the place of its own.

        Raises:
            MittError: The arm cannot be; the message says why.
        """
        own = hand_of(self.hand, self.hand_tilt, self.hand_force, self.hand_depth)
        described = isinstance(self.arm, Path)
        names = tuple(joints) or (self.joints if described else ())
        self._check_digest()
        arm = build_arm(
            self.arm,
            tip=self.tip,
            joints=names or None,
            held={x: angle for x, angle in self.held.items() if names and x not in names},
            limits=limits_of(self.limits if limits is None else limits, self.arm),
            hand=own or tool,
            hand_mount="plate" if own is None else self.hand_mount,
        )
        return arm if own is None else with_hand(arm, tool)

    def _check_digest(self) -> None:
        """Refuse a description file that is not the one that the arm file was made for."""
        if isinstance(self.arm, Path) and self.sha256 is not None:
            given = digest_of(self.arm)
            if given != self.sha256:
                raise FileError(
                    str(self.arm),
                    f"the file of SHA-256 {self.sha256[:16]}...",
                    f"{given[:16]}...",
                    do="take that file, or sha256 out of the arm"
                    " file and try whether the arm still catches",
                )


class _Arm(FileSection):
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
        if self.name is not None and self.sha256 is not None:
            raise ValueError("no sha256 beside name")
        if self.name == "wam" and self.tip is not None:
            raise ValueError("no tip beside the name wam")
        return self


class _Hand(FileSection):
    name: HandName = "three-finger"
    turn: Annotated[float, Field(ge=-10.0, le=10.0)] = 0.0
    mount: Mount | None = None
    tilt: Annotated[float, Field(ge=-MOST_TILT, le=MOST_TILT)] = 0.0
    force: Annotated[float, Field(gt=0.0, le=1e6)] | None = None
    catch_depth: Annotated[float, Field(ge=0.0, le=Basket().depth)] | None = None


class _ArmFile(FileSection):
    schema_name: Literal["mitt.arm/1"] = Field(alias="schema")
    arm: _Arm
    hand: _Hand = _Hand()
    map: dict[str, Any] | None = None
    throws: ThrowSettings | None = None
    arrivals: ArrivalSettings | None = None


def is_arm_file(name_or_path: str | Path) -> bool:
    """Say whether what a user calls an arm is an arm file."""
    return Path(name_or_path).suffix == ".toml"


def design_of(name_or_path: str | Path) -> ArmFile | None:
    """Return the arm file that an arm stands for: itself, or of a name the design that ships.

    None where it stands for none: of the WAM, whose design follows from its limits, and of a
    description file.

    Raises:
        InputError: It is an arm by name that has no design.
        FileError: The file is missing, or says what cannot be.
    """
    if is_arm_file(name_or_path):
        return read_arm_file(Path(name_or_path))
    name = str(name_or_path)
    if name in shipped("designs"):
        return read_arm_file(shipped_path("designs", name))
    if is_shipped(name):
        raise InputError(
            f"arm {name}",
            "one with a design that ships",
            "one without",
            do=f"mitt design {name} --out {name}.toml looks for one",
        )
    return None


def arm_of_task(
    name_or_path: str | Path, *, tip: str | None = None, joints: Sequence[str] | None = None
) -> ArmFile:
    """Return what a user calls an arm, as an arm file says it, for :meth:`ArmFile.carrying`.

    Args:
        name_or_path: A name, an arm file, or a description file.
        tip: Frame of a description, or of an arm by name, at which the tool is mounted, its z axis
            out of it.
        joints: Joints that move.

    Raises:
        InputError: Something is said beside an arm file.
        FileError: The arm file is missing, or says what cannot be.
    """
    path, names = checks.path("arm", name_or_path), checked_joints(joints)
    tip = None if tip is None else checks.text("tip", tip)
    if is_arm_file(path):
        _refuse_beside(path, {"tip": tip, "joints": joints})
        return read_arm_file(path)
    named = str(name_or_path) == "wam" or is_shipped(name_or_path)
    return ArmFile(arm=str(name_or_path) if named else path, tip=tip, joints=names, hand="none")


def joint_names(text: str | None) -> list[str] | None:
    """Return names of joints that a user wrote as ``A,B,C``; None where nothing was written."""
    return None if text is None else [name.strip() for name in text.split(",")]


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
    arm, hand, limits = content.arm, content.hand, content.arm.limits
    if arm.name is not None and hand.name == "none":
        raise InputError("hand", "a hand on an arm by name", "none")
    for key, said in (("tilt", hand.tilt or None), ("catch_depth", hand.catch_depth)):
        if said is not None and hand.name != "basket":
            raise InputError(key, "a basket", hand.name, do="leave it out")
    if hand.force is not None and hand.name == "none":
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
        hand=hand.name,
        hand_turn=hand.turn,
        hand_mount=hand.mount,
        hand_tilt=hand.tilt,
        hand_force=hand.force,
        hand_depth=hand.catch_depth,
        map=None if content.map is None else from_plain(MapDesign, content.map, place="map"),
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
        "limits": _seen_from(path.parent, arm.limits)
        if isinstance(arm.limits, Path)
        else arm.limits,
        "held": dict(arm.held),
    }
    tables: dict[str, Any] = {
        "schema": SCHEMA,
        "arm": own,
        "hand": {"name": arm.hand, "turn": float(arm.hand_turn), "mount": arm.hand_mount}
        | ({"tilt": float(arm.hand_tilt)} if arm.hand_tilt else {})
        | ({} if arm.hand_force is None else {"force": float(arm.hand_force)})
        | ({} if arm.hand_depth is None else {"catch_depth": float(arm.hand_depth)}),
        "map": None if arm.map is None else asdict(arm.map),
        "throws": None
        if arm.throws is None
        else arm.throws.model_dump(exclude_none=True, exclude_defaults=True),
        "arrivals": None if arm.arrivals is None else arm.arrivals.model_dump(),
    }
    head = "".join(f"# {printable(line)}".rstrip() + "\n" for line in comment.splitlines())
    write_text(path, head + toml_text(tables))


def _seen_from(folder: Path, path: Path) -> str:
    """Return a path as it is written in a file of a folder."""
    return Path(os.path.relpath(path.absolute(), folder.absolute())).as_posix()


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a description file."""
    return hashlib.sha256(read_bytes(path, max_bytes=MAX_BYTES)).hexdigest()


def hand_of(
    name: str, tilt: float, force: float | None = None, depth: float | None = None
) -> Hand | None:
    """Return a hand by name; any takes a force [N].

    A basket is tilted by an angle [rad], its catch point so far below the ring [m].
    """
    hand = hand_named(name)
    if isinstance(hand, Basket):
        hand = replace(hand, tilt=tilt)
        hand = hand if depth is None else replace(hand, catch_depth=depth)
    return hand if hand is None or force is None else replace(hand, force=force)


def load_arm(
    name_or_path: str | Path = "wam",
    *,
    tip: str | None = None,
    joints: Sequence[str] | None = None,
    held: Mapping[str, float] | None = None,
    ready: Sequence[float] | None = None,
    limits: str | Path | LimitSet | None = None,
    hand: Hand | str | None = None,
    hand_turn: float = 0.0,
    hand_mount: Mount | None = None,
    encoder_step: float | Sequence[float] | None = None,
) -> Arm:
    """Return an arm by name, from a URDF or MJCF file, or from an arm file (``.toml``).

    What a user should know of how a file was read, ``arm.model.notes``, is logged as warnings of
    the logger ``mitt``.

    Args:
        name_or_path: Name or file. An arm file says all the rest but the limits and the encoders.
            So does a name alone, the design that ships (``mitt arms``); with more, the arm is bare.
        tip: Frame of the file whose origin is the catch point and whose z axis is the normal
            of the palm, or another axis that is named behind it, as ``link06:x``; if left out, the
            flange of a bare arm by name. The WAM takes none.
        joints: Active joints of the file, the others held; if left out, of the WAM j1, j2 and j4,
            of another bare arm by name all.
        held: Angles at which joints are held [rad]; any other is held at 0, or at the end of its
            range that is nearest to it.
        ready: Ready pose of the active joints, in their order [rad]; 0 if left out, or the middle
            of a range that 0 is not in.
        limits: Limit set: a name of :func:`known_limits`, as ``paper``, ``wam-48v`` or ``wam-80v``
            for the WAM, ``model`` for what a file states, or a TOML file. If left out, an arm by
            name has its vendor's, the WAM ``paper``, a file what it states.
        hand: A hand, or the name of one of ``mitt.core.arm.basket.HANDS``; with ``none`` nothing is
            mounted, the tip is the catch point. If left out, the WAM has the three-finger hand, any
            other arm is taken to contain what it carries.
        hand_turn: How far the hand is turned about the z axis of the tip [rad].
        hand_mount: Whether the hand's catch point or its plate is at the tip; if left out, the
            plate at an arm by name, else the catch point. The WAM has its own place.
        encoder_step: Resolution of the encoders of the active joints [rad], one for all or one a
            joint; the WAM's own, or ``description.ENCODER_STEP`` for files, if left out.

    Raises:
        UnknownNameError: No such arm, joint, frame, hand or limit set.
        FileError: The file cannot be read or parsed.
        ModelError: What it describes is no arm that can be used.
        InputError: It is a name alone, of an arm without a design.
    """
    turn = checks.number("hand_turn", hand_turn, finite=True) or None
    file = _design_beside(
        name_or_path,
        tip=tip,
        joints=joints,
        held=held,
        ready=ready,
        hand=hand,
        hand_turn=turn,
        hand_mount=hand_mount,
    )
    if file is not None:
        arm = file.load(limits=limits_of(limits))
        arm = arm if encoder_step is None else with_encoders(arm, encoder_step)
    else:
        arm = build_arm(
            name_or_path,
            tip=tip,
            joints=joints,
            held=held,
            ready=ready,
            limits=limits_of(limits, name_or_path),
            hand=hand,
            hand_turn=hand_turn,
            hand_mount=hand_mount,
            encoder_step=encoder_step,
        )
    return with_notes_logged(arm, name_or_path)


def arm_with_hand(
    name_or_path: str | Path,
    *,
    tip: str | None = None,
    joints: Sequence[str] | None = None,
    limits: str | Path | None = None,
) -> tuple[Arm, ArmFile | None]:
    """Return an arm with a hand at its tip unless an arm file says otherwise, and that file.

    The arguments are those of :func:`load_arm`; there is no file where an arm stands for none.

    Raises:
        MittError: The arm cannot be.
    """
    file = _design_beside(name_or_path, tip=tip, joints=joints)
    if file is None:
        arm = load_arm(name_or_path, tip=tip, joints=joints, limits=limits, hand=HandModel())
        return arm, None
    return with_notes_logged(file.load(limits=limits_of(limits)), name_or_path), file


def _design_beside(name_or_path: str | Path, **said: object) -> ArmFile | None:
    """Return what an arm stands for; nothing where something is said beside a name."""
    path = checks.path("arm", name_or_path)
    _refuse_beside(path, said)
    beside = any(value is not None for value in said.values())
    return None if beside else design_of(path)


def _refuse_beside(path: Path, said: Mapping[str, object]) -> None:
    """Refuse what is said beside an arm file."""
    beside = [name for name, value in said.items() if value is not None]
    if beside and is_arm_file(path):
        raise InputError(
            beside[0],
            "nothing beside an arm file, which says it",
            "a value",
            do="change the arm file",
        )


def with_notes_logged(arm: Arm, name: str | Path) -> Arm:
    """Return an arm, its notes logged as warnings."""
    for note in arm.model.notes:
        logging.getLogger("mitt").warning("%s: %s", name, note)
    return arm


class ArmSpec(FileSettings):
    """Which arm and which map, as the options of the same names of ``mitt catch``."""

    arm: str = "wam"
    tip: str | None = None
    joints: str | None = None
    limits: str | None = None
    catch_joint: int | None = None
    q_catch: float | None = None
    kappa: float | None = None
    inward: float | None = None
    order: int | None = None

    @field_validator("limits")
    @classmethod
    def _known(cls, value: str | None) -> str | None:
        """Refuse a name that is none of a limit set, before anything is learned."""
        if value is not None and not value.endswith(".toml") and value not in known_limits():
            alone = ", ".join(x for x in shipped("limits") if x not in arm_names())
            raise ValueError(
                f"one of {', '.join(known_limits())}, or a .toml file"
                f" ({alone}: of arms that do not come with mitt)"
            )
        return value

    def read(self, *, was: Mapping[str, str] | None = None) -> "ChosenArm":
        """Return the arm, with a hand at its tip unless an arm file says otherwise.

        Args:
            was: Digests of its files as they were; as they are if left out.

        Raises:
            FileError: A file holds something else than it did.
            MittError: The arm cannot be.
        """
        with noted() as read:
            arm, file = arm_with_hand(
                self.arm, tip=self.tip, joints=joint_names(self.joints), limits=self.limits
            )
        if was is not None and (name := changed_file(was, read)):
            raise FileError(
                name,
                "the file that the study was made with",
                "another content",
                do="put it back, or begin the study anew",
            )
        return ChosenArm(spec=self, arm=arm, file=file, files=read)


@final
@dataclass(frozen=True, slots=True, kw_only=True)
class ChosenArm:
    """An arm with all that its files say, read once.

    Attributes:
        spec: What was chosen.
        arm: The arm.
        file: Its arm file; None where it comes from none.
        files: Digests of what was read, by name, in the order of reading.
    """

    spec: ArmSpec
    arm: Arm
    file: ArmFile | None
    files: dict[str, str]

    @property
    def throws(self) -> ThrowSettings | None:
        """Where the arm file wants balls to come from; None where none says so."""
        return None if self.file is None else self.file.throws

    @property
    def design(self) -> MapDesign:
        """The map design that is chosen.

        What is left out is that of the arm file, if it has a design, or else follows from the arm.

        Raises:
            MittError: This arm cannot have it.
        """
        spec = self.spec
        design = default_design(
            self.arm,
            catch_joint=spec.catch_joint,
            q_catch=spec.q_catch,
            kappa=spec.kappa,
            inward=spec.inward,
            order=spec.order,
        )
        tangent_of(self.arm, design)  # refuses angles and ratios that cannot be
        return design
