"""Which arm and which map: what commands, studies and runs are given; light to import."""
# ruff: noqa: D102 (the options of ``mitt catch`` say what each property is)

from typing import Literal, Protocol

LimitName = Literal["paper", "wam-48v", "wam-80v", "model"]
"""Name of a limit set."""


class ArmChoice(Protocol):
    """Which arm and which map; the options of ``mitt catch`` of the same names say what each is."""

    @property
    def arm(self) -> str: ...
    @property
    def tip(self) -> str | None: ...
    @property
    def joints(self) -> str | None: ...
    @property
    def limits(self) -> LimitName | None: ...
    @property
    def catch_joint(self) -> int | None: ...
    @property
    def q_catch(self) -> float | None: ...
    @property
    def kappa(self) -> float | None: ...
    @property
    def inward(self) -> float | None: ...
    @property
    def order(self) -> int | None: ...
