"""Recorded motions of targets."""

import numpy as np

from mitt.lab.world.flights import RecordedFlight
from mitt.lab.world.targets import recorded


def test_a_motion_with_even_samples_keeps_its_speed() -> None:
    """At 100 Hz samples lie on the edge of the smoothing window, up to rounding."""
    t = np.array([float(f"{0.01 * k:.2f}") for k in range(300)])
    r = np.outer(t, [0.0, 0.2, 0.0]) + np.array([0.6, 0.0, 0.3])
    motion = recorded(RecordedFlight(name="a", t=t, r=r), np.array([0.6, 0.0, 0.3]), None)
    assert np.allclose(np.linalg.norm(motion.dr, axis=1), 0.2, atol=1e-9)
