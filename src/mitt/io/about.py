"""What a recording is about: all that makes its catcher again, as text inside the file."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, final

import numpy as np
from pydantic import Field

from mitt.core.arm.arm import Arm
from mitt.core.arm.description import ArmModel
from mitt.core.arm.limits import Limits
from mitt.core.catcher.batting import Batting, BattingSettings
from mitt.core.catcher.meeting import Meeting, MeetingSettings
from mitt.core.catcher.settings import CatcherSettings
from mitt.core.errors import FileError, MittError
from mitt.core.eyes.camera import Rig
from mitt.core.eyes.eyes import EyesConfig
from mitt.core.map.batting import BattingMap
from mitt.core.map.demand import Tolerance
from mitt.core.map.learn import Learned
from mitt.core.map.map_design import MapDesign
from mitt.core.map.mapping import DirectMap
from mitt.core.map.meeting import MeetingMap
from mitt.core.map.polynomial import CatchBasis
from mitt.core.signals import Array
from mitt.io.maps import map_content, map_from
from mitt.io.schema import FileSection, from_plain, parsed, to_plain
from mitt.io.writing import json_digest
from mitt.version import __version__

SCHEMA = "mitt.recording/1"
#: What stands for an end of a region that has none [rad].
_FAR = 1e300


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class About:
    """What makes the catcher of a recording.

    Attributes:
        arm: The arm, as its maps were learned for it.
        generator: Name of the generator, as of ``mitt catch --generator``.
        maps: Its maps, the preferred one first; for a rival the map that it was made from; none
            where it meets parts.
        settings: Of the catcher.
        rig: Its cameras, also where it is given points.
        eyes: What it knows of its images.
        driven: Limits within which it drives the arm; those of the arm where None.
        refines: Whether a direct map is refined in each tick.
        version: Of mitt.
        notes: What else a reader should know: texts by name.
        meeting: How it meets parts, before it has met any; None where it does something else.
        batting: How it strikes balls, before it has seen one; None where it does something else.
    """

    arm: Arm
    generator: str
    maps: tuple[DirectMap, ...]
    settings: CatcherSettings
    rig: Rig
    eyes: EyesConfig
    driven: Limits | None = None
    refines: bool = False
    version: str = __version__
    notes: Mapping[str, str] = field(default_factory=dict)
    meeting: Meeting | None = None
    batting: Batting | None = None

    @property
    def shapes(self) -> tuple[tuple[int, int], ...]:
        """Height and width of the images of each camera [px]."""
        return tuple((camera.height, camera.width) for camera in self.rig.cameras)

    @property
    def driven_arm(self) -> Arm:
        """The arm within the limits in which the catcher drives it."""
        return self.arm if self.driven is None else Arm(self.arm.model, self.driven)

    @cached_property
    def text(self) -> str:
        """All of it as JSON; the digest covers the rest."""
        content = {
            "schema": SCHEMA,
            "version": self.version,
            "arm": {"model": to_plain(self.arm.model), "limits": to_plain(self.arm.limits)},
            "driven": to_plain(self.driven),
            "generator": self.generator,
            "refines": self.refines,
            "maps": [map_content(_as_learned(f), version=self.version) for f in self.maps],
            "settings": to_plain(self.settings),
            "rig": to_plain(self.rig),
            "eyes": to_plain(self.eyes),
            "notes": dict(self.notes),
        }
        if self.meeting is not None:
            content["meeting"] = _meeting_content(self.meeting)
        if self.batting is not None:
            content["batting"] = _batting_content(self.batting)
        return json.dumps(content | {"digest": json_digest(content)}, allow_nan=False)


class _Arm(FileSection):
    model: dict[str, Any]
    limits: dict[str, Any]


class _About(FileSection):
    schema_name: str = Field(alias="schema", pattern=f"^{SCHEMA}$")
    version: str = Field(max_length=80)
    arm: _Arm
    driven: dict[str, Any] | None
    generator: str = Field(max_length=200)
    refines: bool
    maps: list[dict[str, Any]] = Field(max_length=64)
    meeting: dict[str, Any] | None = None
    batting: dict[str, Any] | None = None
    settings: dict[str, Any]
    rig: dict[str, Any]
    eyes: dict[str, Any]
    notes: dict[str, str]
    digest: str


def about_of(text: str, *, place: str) -> About:
    """Return what a recording is about from its text.

    Args:
        text: JSON.
        place: What an error calls the file.

    Raises:
        FileError: It says something else, or was altered.
    """
    do = "record it again"
    try:
        raw = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise FileError(place, f"JSON of schema {SCHEMA}", str(error)[:80], do=do) from None
    content = parsed(_About, raw, place=place, wanted=f"a recording of schema {SCHEMA}", do=do)
    if not content.maps and content.meeting is None and content.batting is None:
        raise FileError(place, "a map, or a way of meeting or batting", "none", do=do)
    if json_digest({k: x for k, x in raw.items() if k != "digest"}) != content.digest:
        raise FileError(place, "a recording that matches its digest", "one that was altered", do=do)
    try:
        arm = _arm_of(content.arm)
        driven = content.driven
        return About(
            arm=arm,
            generator=content.generator,
            maps=tuple(_endless(map_from(x, arm, place="a map").map) for x in content.maps),
            settings=from_plain(CatcherSettings, content.settings, place="settings"),
            rig=from_plain(Rig, content.rig, place="rig"),
            eyes=from_plain(EyesConfig, content.eyes, place="eyes"),
            driven=None if driven is None else from_plain(Limits, driven, place="driven"),
            refines=content.refines,
            version=content.version,
            notes=content.notes,
            meeting=None if content.meeting is None else _meeting_of(content.meeting, arm),
            batting=None if content.batting is None else _batting_of(content.batting, arm),
        )
    except (MittError, ValueError, RecursionError, OverflowError) as error:
        raise FileError(place, "a catcher that can be made again", error) from None


def _arm_of(said: _Arm) -> Arm:
    """Return the arm of a recording.

    The design of its map is read apart: a field of an arm, which knows no maps, has no type for it.
    """
    model = from_plain(ArmModel, said.model | {"design": None}, place="arm.model")
    if (design := said.model.get("design")) is not None:
        design = from_plain(MapDesign, design, place="arm.model.design")
        model = replace(model, design=design)
    return Arm(model, from_plain(Limits, said.limits, place="arm.limits"))


def _as_learned(f: DirectMap) -> Learned:
    """Return a map with what a file wants to say of its learning, which is not known here.

    A map that has learned nothing has a region without ends, which map files do not have.
    """
    f = replace(f, region=np.clip(f.region, -_FAR, _FAR))
    return Learned(map=f, maps=(f,), steps=(), flights=0, left_out=0, status="recorded")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Met:
    """What a way of meeting says of itself; as of :class:`MeetingMap` and :class:`Meeting`."""

    free: tuple[int, ...]
    frame: Array
    basis: CatchBasis
    alpha: Array
    H: Array
    coupling: Array | None
    settings: MeetingSettings
    tolerance: Tolerance


def _meeting_content(meeting: Meeting) -> Any:  # noqa: ANN401 (any JSON value)
    """Return what makes a way of meeting again, but for its arm."""
    f = meeting.map
    return to_plain(
        _Met(
            free=f.free,
            frame=f.frame,
            basis=f.basis,
            alpha=f.alpha,
            H=f.H,
            coupling=f.coupling,
            settings=meeting.settings,
            tolerance=meeting.tolerance,
        )
    )


def _meeting_of(raw: dict[str, Any], arm: Arm) -> Meeting:
    """Return a way of meeting for an arm."""
    of = from_plain(_Met, raw, place="meeting")
    if not all(0 <= k < arm.n for k in of.free):
        raise FileError("meeting.free", f"joints in 0..{arm.n - 1}", str(of.free))
    f = MeetingMap(
        arm=arm,
        free=of.free,
        frame=of.frame,
        basis=of.basis,
        alpha=of.alpha,
        H=of.H,
        coupling=of.coupling,
    )
    return Meeting(f, of.settings, of.tolerance)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Struck:
    """What a way of batting says of itself; as of :class:`BattingMap` and :class:`Batting`."""

    design: MapDesign
    basis: CatchBasis
    alpha: Array
    H: Array
    region: Array
    q_rest: Array
    held: tuple[int, ...]
    settings: BattingSettings
    tolerance: Tolerance


def _batting_content(batting: Batting) -> Any:  # noqa: ANN401 (any JSON value)
    """Return what makes a way of batting again, but for its arm."""
    f = batting.map.map
    return to_plain(
        _Struck(
            design=f.design,
            basis=f.basis,
            alpha=f.alpha,
            H=f.H,
            region=f.region,
            q_rest=f.tangent.q_rest,
            held=batting.map.held,
            settings=batting.settings,
            tolerance=batting.tolerance,
        )
    )


def _batting_of(raw: dict[str, Any], arm: Arm) -> Batting:
    """Return a way of batting for an arm."""
    of = from_plain(_Struck, raw, place="batting")
    f = DirectMap(
        arm=arm,
        design=of.design,
        basis=of.basis,
        alpha=of.alpha,
        H=of.H,
        region=of.region,
        q_rest=of.q_rest,
    )
    return Batting(BattingMap(map=f, held=of.held), of.settings, of.tolerance)


def _endless(f: DirectMap) -> DirectMap:
    """Return a map with the ends of its region where they were."""
    far = np.abs(f.region) >= _FAR
    return (
        replace(f, region=np.where(far, np.sign(f.region) * np.inf, f.region)) if far.any() else f
    )
