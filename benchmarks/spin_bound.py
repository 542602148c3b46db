"""What a flight can tell of a spin: the Cramer-Rao bound of points of 1 mm at 1 kHz.

    python benchmarks/spin_bound.py

The ball is that of the scene ``lab``, with 150 rad/s of backspin at 5.8 m/s. The bound is that of
place, velocity, drag and w of the lift together, with drag known to 17 % and each component of the
spin to 87 rad/s before. It is given for the spin as its flight shows it where K is exact; an error
of K, or of w, is 1 / c times larger in the size of the spin.
"""

import numpy as np

from mitt.core.ball.flight import advance_spinning
from mitt.core.ball.spin import lift_constant
from mitt.core.signals import Array
from mitt.lab.world.scene import named_scene

SPIN = 150.0
START = np.array([3.0, 0.0, 0.5, -5.3, 0.0, 2.4])
#: Noise of a point [m], and by how much each parameter is moved for a slope.
NOISE = 1e-3
NUDGE = np.array([1e-4] * 6 + [1e-3] * 4)


def path(of: Array, count: int) -> tuple[Array, Array]:
    """Return places of so many ms, one after the other, and the velocity at the end."""
    r, v, out = of[:3].copy(), of[3:6].copy(), []
    lift = (of[7], of[8], of[9], 0.0)
    for _ in range(count):
        out.append(r.copy())
        advance_spinning(r, v, of[6], lift, 1e-3)
    return np.array(out).ravel(), v


def main() -> None:
    """Print a row for each time that the ball is seen."""
    ball = named_scene("lab").ball
    K, speed = lift_constant(ball.radius, ball.mass), float(np.linalg.norm(START[3:]))
    c = speed / (speed + 2.0 * ball.radius * SPIN)
    of = np.concatenate([START, [ball.drag, 0.0, c * K * SPIN, 0.0]])
    known = np.concatenate([np.zeros(6), [(0.17 * ball.drag) ** -2], [(c * K * 87.0) ** -2] * 3])
    for seen in (0.2, 0.3, 0.4, 0.5):
        count = round(1e3 * seen)
        slopes = [
            (path(of + h * axis, count)[0] - path(of - h * axis, count)[0]) / (2.0 * h)
            for h, axis in zip(NUDGE, np.eye(10), strict=True)
        ]
        J = np.column_stack(slopes)
        P = np.linalg.inv(J.T @ J / NOISE**2 + np.diag(known))[7:, 7:] / (c * K) ** 2
        along = path(of, count)[1]
        along /= np.linalg.norm(along)
        axes = along, np.array([0.0, 1.0, 0.0]), np.cross(along, [0.0, 1.0, 0.0])
        sigma = [float(np.sqrt(axis @ P @ axis)) for axis in axes]
        print(
            f"{seen:.1f} s: along {sigma[0]:.0f}, level across {sigma[1]:.1f}, "
            f"upright across {sigma[2]:.1f} rad/s; 1 / c = {1.0 / c:.1f}"
        )


if __name__ == "__main__":
    main()
