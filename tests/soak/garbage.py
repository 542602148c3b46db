"""Senses that are garbage, channel by channel: clock, encoders, points, images.

Each channel is good until a fault strikes it; the fault stays for a random number of ticks. So
every phase of the catcher is reached, and every fault meets every phase.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, final

import numpy as np

from mitt.core.eyes.camera import Rig
from mitt.core.kernels import kernel
from mitt.core.signals import TICK, ArmState, Array, Frame, Image, Sighting

#: Numbers that are none, or none that could be real.
ABSURD = (np.nan, np.inf, -np.inf, 1e300, -1e300, 1e18, -1e9, 5e-324)
#: Longest that a fault lasts [ticks].
_LONGEST = 60
#: Images that are drawn once and shown again.
_NOISES = 32
_SIDE = 128

CLOCKS = ("stands", "back", "skips", "stalls", "hour", "absurd")
ENCODERS = ("absurd", "all", "speed", "jump", "sign", "stuck", "noise")
POINTS = ("none", "absurd", "far", "covariance", "flat", "lopsided", "stamp", "crowd", "not found")
IMAGES = (
    "none",
    "one",
    "noise",
    "white",
    "black",
    "size",
    "stamp",
    "again",
    "swapped",
    "view",
    "blobs",
    "heads",
)


@final
class Channel:
    """Which fault a channel has in each tick; the empty name is none."""

    def __init__(self, faults: tuple[str, ...], rng: np.random.Generator, rate: float) -> None:
        """Take the faults, and the share of good ticks after which one strikes."""
        self._faults, self._rng, self._rate = faults, rng, rate
        self._left, self._fault = 0, ""

    def next(self) -> str:
        """Return the fault of the next tick."""
        if self._left == 0:
            strikes = self._rng.random() < self._rate
            self._fault = self._faults[self._rng.integers(len(self._faults))] if strikes else ""
            self._left = int(_LONGEST ** self._rng.random()) if strikes else 1
        self._left -= 1
        return self._fault


def absurd(rng: np.random.Generator) -> float:
    """Return a number that is none, or none that could be real."""
    return ABSURD[rng.integers(len(ABSURD))]


def passed(fault: str, rng: np.random.Generator) -> float:
    """Return the time that passes until the next tick, for the arm and the ball as well [s]."""
    longest = {"skips": 0.004, "stalls": 0.1}.get(fault, 0.0)
    return TICK + float(longest * rng.random())


def clock(fault: str, t: float, before: float, rng: np.random.Generator) -> float:
    """Return the time that is told, ``before`` being the one told last [s]."""
    told: dict[str, Callable[[], float]] = {
        "stands": lambda: before,
        "back": lambda: t - 10.0 * rng.random(),
        "skips": lambda: t,
        "stalls": lambda: t,
        "hour": lambda: t + 3600.0 * rng.choice([-1.0, 1.0]),
        "absurd": lambda: absurd(rng),
    }
    return told[fault]() if fault else t


def encoders(
    fault: str, t: float, good: Array, before: Array, rng: np.random.Generator
) -> ArmState:
    """Return what the encoders say; ``good`` and ``before``: q, dq now and last, shape (2, n)."""
    said, k = good.copy(), rng.integers(good.shape[1])
    if fault == "absurd":
        said[0, k] = absurd(rng)
    elif fault == "all":
        said[:] = absurd(rng)
    elif fault == "speed":
        said[1, k] = absurd(rng)
    elif fault == "jump":
        said[0, k] += 5.0 * rng.standard_normal()
    elif fault == "sign":
        said[:, k] *= -1.0
    elif fault == "stuck":
        said[:] = before
    elif fault == "noise":
        said += 10.0 ** rng.uniform(-4.0, 1.0) * rng.standard_normal(said.shape)
    return ArmState(t=t, q=said[0], dq=said[1])


def points(fault: str, t: float, r_o: Array, rng: np.random.Generator) -> tuple[Sighting, ...]:
    """Return the sightings of a ball at ``r_o`` [m]."""
    good = Sighting(
        t=t, found=True, r_o=r_o + 0.001 * rng.standard_normal(3), covariance=1e-6 * np.eye(3)
    )
    if not fault:
        return (good,)
    place, P, i = good.r_o.copy(), good.covariance.copy(), rng.integers(3)
    if fault == "none":
        return ()
    if fault == "not found":
        return (replace(good, found=False),)
    if fault == "crowd":
        return tuple(
            replace(good, t=t + 1e-3 * rng.standard_normal(), r_o=5.0 * rng.standard_normal(3))
            for _ in range(4)
        )
    if fault == "stamp":
        wrong = (absurd(rng), t - rng.random(), t + rng.random())
        return (replace(good, t=wrong[rng.integers(3)]),)
    if fault == "absurd":
        place[i] = absurd(rng)
    elif fault == "far":
        place += 10.0 ** rng.uniform(-2.0, 4.0) * rng.standard_normal(3)
    elif fault == "covariance":
        P[i, rng.integers(3)] = absurd(rng)
    elif fault == "flat":
        P *= 10.0 ** rng.uniform(-300.0, 20.0)
    elif fault == "lopsided":
        P = rng.standard_normal((3, 3))
    bad = replace(good, r_o=place, covariance=good.covariance.copy())
    bad.covariance[:] = P  # gets past the check: an array that is used again
    return (bad,)


@kernel
def draw(image: Image, u: float, v: float, radius: float, level: int) -> None:
    """Draw a disc into an image, as much of it as lies inside."""
    height, width = image.shape
    for y in range(max(int(v - radius), 0), min(int(v + radius) + 2, height)):
        for x in range(max(int(u - radius), 0), min(int(u + radius) + 2, width)):
            if (x - u) ** 2 + (y - v) ** 2 <= radius * radius:
                image[y, x] = level


@final
class Cameras:
    """Images of a rig, good ones drawn roughly, and bad ones."""

    def __init__(self, rig: Rig, rng: np.random.Generator) -> None:
        """Take the rig; noise is drawn once and shown shifted."""
        self._rig, self._rng, self._number = rig, rng, 0
        noise = rng.normal(24.0, 2.0, (_NOISES, _SIDE, _SIDE))
        self._noise = np.clip(noise, 0, 255).astype(np.uint8)
        self._last: tuple[Frame, ...] = ()

    def frames(self, fault: str, t: float, r_o: Array, radius: float) -> tuple[Frame, ...]:
        """Return what the cameras show of a ball at ``r_o`` [m]."""
        if fault == "again" and self._last:
            return self._last
        self._number += 1
        made = [self._frame(n, t, r_o, radius) for n in range(len(self._rig.cameras))]
        self._last = tuple(made)
        return self._spoilt(fault, t, made) if fault else self._last

    def _frame(self, n: int, t: float, r_o: Array, radius: float) -> Frame:
        """Draw a good image."""
        camera, image = self._rig.cameras[n], self._noise[self._rng.integers(_NOISES)].copy()
        x, y, z = (r_o - camera.centre) @ camera.rotation
        if z > radius:
            scale = camera.f_px / z
            draw(image, camera.cu + scale * x, camera.cv + scale * y, scale * radius, 180)
        return Frame(t=t, camera=n, number=self._number, pixels=image)

    def _spoilt(self, fault: str, t: float, made: list[Frame]) -> tuple[Frame, ...]:
        """Return good images with a fault."""
        rng = self._rng
        if fault in ("none", "one"):
            return tuple(made[1:]) if fault == "one" else ()
        if fault == "swapped":
            cameras = [frame.camera for frame in made[::-1]]
            return tuple(replace(f, camera=c) for f, c in zip(made, cameras, strict=True))
        k = rng.integers(len(made))
        change: dict[str, Any] = {"pixels": _image(fault, made[k].pixels, rng)}
        if fault == "stamp":
            change = {"t": (absurd(rng), t - rng.random(), t + rng.random())[rng.integers(3)]}
        elif fault == "heads":
            change = {"pan": absurd(rng), "tilt": 9.0 * rng.standard_normal()}
        made[k] = replace(made[k], **change)
        return tuple(made)


def _image(fault: str, good: Image, rng: np.random.Generator) -> Image:
    """Return an image that is wrong."""
    if fault == "noise":
        return rng.integers(0, 256, good.shape, dtype=np.uint8)
    if fault in ("white", "black"):
        return np.full_like(good, 255 if fault == "white" else 0)
    if fault == "size":
        height, width = rng.integers(1, 200, 2)
        return rng.integers(0, 256, (height, width), dtype=np.uint8)
    if fault == "view":
        return good[::2, ::-1]
    if fault == "blobs":
        bad = good.copy()
        for u, v, radius in rng.uniform(0.0, 128.0, (int(rng.integers(1, 150)), 3)):
            draw(bad, u, v, 0.1 * radius, int(rng.integers(30, 256)))
        return bad
    return good
