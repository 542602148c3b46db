"""What a recording is about: all that makes its catcher again, as text inside the file."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, final

import numpy as np
from pydantic import Field

from mitt.arm.arm import Arm
from mitt.arm.description import ArmModel
from mitt.arm.limits import Limits
from mitt.catcher.settings import CatcherSettings
from mitt.errors import FileError, MittError
from mitt.eyes.camera import Rig
from mitt.eyes.eyes import EyesConfig
from mitt.files.maps import map_content, map_of
from mitt.files.schema import Part, from_plain, parsed, to_plain
from mitt.files.writing import json_digest
from mitt.map.learn import Learned
from mitt.map.mapping import DirectMap
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
        maps: Its maps, the preferred one first; for a rival the map that it was made from.
        settings: Of the catcher.
        rig: Its cameras, also where it is given points.
        eyes: What it knows of its images.
        driven: Limits within which it drives the arm; those of the arm where None.
        refines: Whether a direct map is refined in each tick.
        version: Of mitt.
        notes: What else a reader should know: texts by name.
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
        return json.dumps(content | {"digest": json_digest(content)}, allow_nan=False)


class _Arm(Part):
    model: dict[str, Any]
    limits: dict[str, Any]


class _About(Part):
    schema_name: str = Field(alias="schema", pattern=f"^{SCHEMA}$")
    version: str = Field(max_length=80)
    arm: _Arm
    driven: dict[str, Any] | None
    generator: str = Field(max_length=200)
    refines: bool
    maps: list[dict[str, Any]] = Field(min_length=1, max_length=64)
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
    if json_digest({k: x for k, x in raw.items() if k != "digest"}) != content.digest:
        raise FileError(place, "a recording that matches its digest", "one that was altered", do=do)
    try:
        arm = Arm(
            from_plain(ArmModel, content.arm.model, place="arm.model"),
            from_plain(Limits, content.arm.limits, place="arm.limits"),
        )
        driven = content.driven
        return About(
            arm=arm,
            generator=content.generator,
            maps=tuple(_endless(map_of(x, arm, place="a map").map) for x in content.maps),
            settings=from_plain(CatcherSettings, content.settings, place="settings"),
            rig=from_plain(Rig, content.rig, place="rig"),
            eyes=from_plain(EyesConfig, content.eyes, place="eyes"),
            driven=None if driven is None else from_plain(Limits, driven, place="driven"),
            refines=content.refines,
            version=content.version,
            notes=content.notes,
        )
    except (MittError, ValueError, RecursionError, OverflowError) as error:
        raise FileError(place, "a catcher that can be made again", error) from None


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
