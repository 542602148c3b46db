"""What a recording is about: all that makes its catcher again, as text inside the file."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Final, final

import numpy as np
from pydantic import Field

from mitt.core.arm.arm import Arm
from mitt.core.arm.description import ArmModel
from mitt.core.arm.limits import Limits
from mitt.core.catcher.batting import StrikeParts
from mitt.core.catcher.generators import GeneratorParts, Recordable
from mitt.core.catcher.meeting import MeetingParts
from mitt.core.catcher.settings import CatcherSettings
from mitt.core.errors import FileError, MittError
from mitt.core.eyes.camera import Rig
from mitt.core.eyes.eyes import EyesConfig
from mitt.core.map.learn import Learned
from mitt.core.map.map_design import MapDesign
from mitt.core.map.mapping import DirectMap
from mitt.io.maps import map_content, map_from
from mitt.io.schema import FileSection, from_plain, parsed, to_plain
from mitt.io.writing import json_digest
from mitt.version import __version__

SCHEMA = "mitt.recording/1"
PARTS: Final[dict[str, type[GeneratorParts]]] = {"meeting": MeetingParts, "batting": StrikeParts}
"""What a generator is made of, by its name, where a recording holds it in parts."""
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
        made_of: The generator itself, before any target, where its name and maps do not make it:
            one of :data:`PARTS`; None for the others.
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
    made_of: Recordable | None = None

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
        if self.made_of is not None:
            content[self.generator] = to_plain(self.made_of.parts)
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
    common = {k: x for k, x in raw.items() if k not in PARTS} if isinstance(raw, dict) else raw
    content = parsed(_About, common, place=place, wanted=f"a recording of schema {SCHEMA}", do=do)
    parts = raw.get(content.generator) if content.generator in PARTS else None
    if not content.maps and parts is None:
        wanted = f"a map, or a way of {' or '.join(PARTS)}"
        raise FileError(place, wanted, "none", do=do)
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
            made_of=None if parts is None else _made_of(content.generator, parts, arm),
        )
    except (MittError, ValueError, RecursionError, OverflowError) as error:
        raise FileError(place, "a catcher that can be made again", error) from None


def _made_of(generator: str, parts: object, arm: Arm) -> Recordable:
    """Return a generator of its parts."""
    made = from_plain(PARTS[generator], parts, place=generator).made(arm)
    if not isinstance(made, Recordable):
        raise FileError(generator, "a generator in parts", "another")
    return made


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


def _endless(f: DirectMap) -> DirectMap:
    """Return a map with the ends of its region where they were."""
    far = np.abs(f.region) >= _FAR
    return (
        replace(f, region=np.where(far, np.sign(f.region) * np.inf, f.region)) if far.any() else f
    )
