"""Which arm and which map: what commands, studies and runs are given; light to import."""

from typing import Literal, Protocol

LimitName = Literal["paper", "wam-48v", "wam-80v", "model"]
"""Name of a limit set."""


class ArmChoice(Protocol):
    """Which arm and which map; the options of ``mitt catch`` of the same names say what each is."""

    @property
    def arm(self) -> str:
        """The arm: wam, or a URDF or MJCF file."""

    @property
    def tip(self) -> str | None:
        """Frame of the file at the catch point."""

    @property
    def joints(self) -> str | None:
        """Active joints of the file, as A,B,C."""

    @property
    def limits(self) -> LimitName | None:
        """Limit set."""

    @property
    def catch_joint(self) -> int | None:
        """Index of the catch joint."""

    @property
    def q_catch(self) -> float | None:
        """Its angle at the catch [rad]."""

    @property
    def kappa(self) -> float | None:
        """Velocity-match ratio."""

    @property
    def inward(self) -> float | None:
        """How much of the ball's line leads into the palm."""

    @property
    def order(self) -> int | None:
        """Degree of the polynomial."""
