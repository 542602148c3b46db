"""One grey level a pixel, in which a ball of a known colour stands out of what is behind it.

The mean of red, green and blue hides a ball that differs from the wall in its colour alone. The
linear discriminant of Fisher (1936) is the sum of the three, weighted, that shows a colour best
before a ground: the weights are the inverse covariance of the ground's colours times the difference
of ball and mean ground.
"""

from typing import final

import numpy as np

from mitt.core.errors import InputError
from mitt.core.signals import Array, Image

#: Grey levels of the mean ground, and of the ball above it.
_GROUND = 50.0
_ABOVE = 150.0
#: Standard deviation of a channel that a camera's noise leaves at least, and distance from the mean
#: ground below which a colour does not stand out [levels of 8 bits].
_NOISE = 3.0
_LEAST = 10.0
#: Pixels of an image, in rows and columns, from one that is looked at to the next.
_APART = 3


def read_colour(text: str) -> Array | None:
    """Return red, green, blue, 0 to 255, shape (3,), of six hexadecimal digits; None if none."""
    digits = text.removeprefix("#")
    if len(digits) != 6 or any(c not in "0123456789abcdefABCDEF" for c in digits):
        return None
    return np.array([int(digits[k : k + 2], 16) for k in (0, 2, 4)], dtype=float)


def colour_of(picture: Image) -> Array:
    """Return the mean colour of the middle half of a picture of the ball, shape (3,).

    Args:
        picture: Red, green, blue of 8 bits, shape (height, width, 3).
    """
    height, width = picture.shape[0], picture.shape[1]
    middle = picture[height // 4 : height - height // 4, width // 4 : width - width // 4]
    return np.asarray(middle.reshape(-1, 3).mean(axis=0), dtype=float)


@final
class BallColour:
    """Turns the colours of one camera into grey; the first image tells the ground."""

    def __init__(self, colour: Array) -> None:
        """Take red, green and blue of the ball, 0 to 255, shape (3,)."""
        self._colour = np.asarray(colour, dtype=float)
        self._weights: Array | None = None
        self._offset = 0.0

    def learn(self, ground: Image) -> None:
        """Learn from an image what is behind the ball.

        Args:
            ground: Red, green, blue, shape (height, width, 3); the ball may be in it.

        Raises:
            InputError: The ball has the colour of the mean ground, or the image has none.
        """
        seen = ground[::_APART, ::_APART].reshape(-1, 3).astype(float)
        if not np.ptp(seen, axis=1).any():
            raise InputError("--ball-colour", "images with colours", "grey ones")
        middle = np.median(seen, axis=0)
        away = self._colour - middle
        if np.linalg.norm(away) < _LEAST:
            raise InputError(
                "--ball-colour",
                f"a colour at least {_LEAST:g} levels from that of what is behind the ball",
                f"{np.round(self._colour)} before {np.round(middle)}",
                do="another ball or another wall",
            )
        covariance = np.cov((seen - middle).T) + _NOISE**2 * np.eye(3)
        weights = np.linalg.solve(covariance, away)
        self._weights = _ABOVE / (weights @ away) * weights
        self._offset = _GROUND - float(self._weights @ middle)

    def grey(self, pixels: Image) -> Image:
        """Return an image of one channel, 8 bits, shape (height, width).

        Args:
            pixels: Red, green, blue of 8 bits, shape (height, width, 3).
        """
        if self._weights is None:
            self.learn(pixels)
        level = pixels.astype(np.float32) @ np.asarray(self._weights, np.float32)
        return np.asarray(np.clip(np.rint(level + self._offset), 0.0, 255.0), dtype=np.uint8)
