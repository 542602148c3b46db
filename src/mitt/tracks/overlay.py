"""Side-by-side pictures of what both cameras saw, the detections drawn in."""

from math import pi, sqrt

import numpy as np

from mitt.cameras.source import optional
from mitt.signals import BallState, Frame, Image, Moments, Sighting

#: Colours (red, green, blue): both cameras agree, one sees something alone, text, ground.
_AGREED, _ALONE, _TEXT, _GROUND = (80, 220, 120), (250, 170, 50), (225, 230, 235), (24, 30, 36)
#: Least height of a picture, its strip of text, the gap between the pictures [px].
_HEIGHT, _STRIP, _GAP = 384, 52, 8


class Overlay:
    """Draws pictures of one size."""

    def __init__(self, sizes: tuple[tuple[int, int], ...], names: tuple[str, ...]) -> None:
        """Lay the pictures out.

        Args:
            sizes: Width and height of each camera's images [px].
            names: Names of the cameras.
        """
        self._cv2 = optional("cv2")
        self._names, self._sizes = names, sizes
        self._scale = max(1, -(-_HEIGHT // max(height for _, height in sizes)))
        self._shapes = [(self._scale * h, self._scale * w) for w, h in sizes]
        total = sum(w for _, w in self._shapes) + _GAP * (len(sizes) - 1)
        self._size = (max(h for h, _ in self._shapes) + _STRIP, max(total, 760))

    def draw(
        self, t: float, frames: tuple[Frame, ...], moments: tuple[Moments, ...],
        sighting: Sighting, ball: BallState,
    ) -> Image:  # fmt: skip
        """Return a picture in red, green, blue, shape (height, width, 3); both sizes even."""
        height, width = (n + n % 2 for n in self._size)
        canvas = np.full((height, width, 3), _GROUND, dtype=np.uint8)
        seen = {m.camera: m for m in moments}
        for frame in frames:
            k = frame.camera
            start = sum(w for _, w in self._shapes[:k]) + _GAP * k
            h, w = self._shapes[k]
            canvas[:h, start : start + w] = self._picture(frame, seen[k], sighting.found)
        for k, text in enumerate((f"t = {t:8.4f} s", _told(sighting, ball))):
            self._write(canvas, text, (10, height - _STRIP + 20 + 22 * k))
        return canvas

    def _picture(self, frame: Frame, m: Moments, agreed: bool) -> Image:
        """Return one camera's image enlarged, its detection circled."""
        cv2, s = self._cv2, self._scale
        grey = np.repeat(np.repeat(frame.pixels, s, axis=0), s, axis=1)
        picture = cv2.cvtColor(grey, cv2.COLOR_GRAY2RGB)
        if m.found:
            colour = _AGREED if agreed else _ALONE
            # Pixel u covers s columns of the picture, its centre is half of them further.
            at = (round(s * (m.u + 0.5) - 0.5), round(s * (m.v + 0.5) - 0.5))
            radius = max(round(s * (sqrt(m.area / pi) + 2.0)), 5)
            cv2.circle(picture, at, radius, colour, 1, cv2.LINE_AA)
            for du, dv in ((1, 0), (-1, 0), (0, 1), (0, -1)):
                begin = (at[0] + du * (radius + 2), at[1] + dv * (radius + 2))
                end = (at[0] + du * (radius + 9), at[1] + dv * (radius + 9))
                cv2.line(picture, begin, end, colour, 1, cv2.LINE_AA)
        self._write(picture, f"{self._names[frame.camera]}  {frame.number}", (8, 20))
        return np.asarray(picture, dtype=np.uint8)

    def _write(self, picture: Image, text: str, at: tuple[int, int]) -> None:
        """Write text into a picture."""
        cv2 = self._cv2
        cv2.putText(picture, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.5, _TEXT, 1, cv2.LINE_AA)


def _told(sighting: Sighting, ball: BallState) -> str:
    """Return the second line of text."""
    if not (ball.tracked or sighting.found):
        return "no ball that both cameras agree on"
    x, y, z = ball.r_o if ball.tracked else sighting.r_o
    speed = f"speed {np.linalg.norm(ball.dr_o):5.2f} m/s" if ball.tracked else "no track yet"
    return f"x {x:7.3f}  y {y:7.3f}  z {z:7.3f} m   {speed}"
