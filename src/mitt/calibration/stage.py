"""What each stage of a calibration hands on: numbers to print, and warnings."""

from collections.abc import Mapping
from dataclasses import dataclass

from mitt.vision.calibration.fit import Fit, P


@dataclass(frozen=True, slots=True)
class Stage:
    """One stage of a calibration.

    Attributes:
        name: Its name: boards, heads, hand or clock.
        status: Of its fit, converged or stopped.
        numbers: What it found, by name with unit.
        warnings: What the measurements do not determine, and what would.
    """

    name: str
    status: str
    numbers: Mapping[str, float]
    warnings: tuple[str, ...]


def weak(fit: Fit[P], limits: Mapping[str, tuple[float, str]]) -> tuple[str, ...]:
    """Return a warning for each parameter that the measurements leave open.

    Args:
        fit: The fit.
        limits: For the name of a parameter: the largest standard deviation, and the measurements
            that would bring it down.
    """
    said = []
    for name, (limit, advice) in limits.items():
        sigma = fit.sigma_of(name)
        if name in fit.undetermined:
            said.append(f"{name} is not determined: {advice}")
        elif not sigma <= limit:
            said.append(f"{name} is uncertain by {sigma:.2g} (wanted {limit:.2g}): {advice}")
    return tuple(said)
