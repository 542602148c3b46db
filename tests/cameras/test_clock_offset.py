"""The clock offset: found from a moving hand, open from a resting one."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mitt.core.errors import InputError
from mitt.core.signals import Array
from mitt.robot.cameras.hand_calibration import ClockProblem, clock_problem
from mitt.robot.cameras.least_squares import fit

#: A millisecond is 6 mm of flight: a quarter of one is what calibration should leave.
CLOCK = 2.5e-4


def waved(t: Array) -> Array:
    """Return a hand that waves at up to 1.5 m/s [m], shape (n, 3)."""
    return np.column_stack(
        (0.7 + 0.15 * np.sin(7.0 * t), 0.2 * np.sin(5.0 * t + 1.0), 0.3 + 0.1 * np.sin(9.0 * t))
    )


def records(offset: float, rng: np.random.Generator, *, noise: float = 1e-3) -> ClockProblem:
    """Return the problem of a camera at 250 Hz, an arm at 1 kHz, a gap of 8 mm."""
    t_arm, t_seen = np.arange(0.0, 4.0, 0.001), np.arange(1.0, 3.0, 0.004)
    seen = waved(t_seen + offset) + np.array((0.005, -0.006, 0.002))
    seen += noise * rng.standard_normal(seen.shape)
    return clock_problem(t_seen=t_seen, seen=seen, t_arm=t_arm, hand=waved(t_arm), search=1.0)


@settings(max_examples=15)
@given(offset=st.floats(-0.9, 0.9), seed=st.integers(0, 99))
def test_the_offset_is_found(offset: float, seed: int) -> None:
    """Any offset within the search, to 0.25 ms with 1 mm of noise, and its sigma says so."""
    solved = fit(records(offset, np.random.default_rng(seed)), robust=True)
    assert solved.problem.offset == pytest.approx(offset, abs=CLOCK)
    assert abs(solved.problem.offset - offset) < 5.0 * solved.sigma_of("offset")
    assert np.abs(solved.problem.gap - (0.005, -0.006, 0.002)).max() < 1e-3


def test_the_jacobian_is_central_differences() -> None:
    """To 1e-3, as far as an interpolated log has derivatives."""
    p = records(0.1, np.random.default_rng(0))
    J = p.jacobian()
    for k, step in enumerate(1e-3 * np.eye(4)):
        d = (p.moved(-step).residuals() - p.moved(step).residuals()) / 2e-3
        assert np.abs(d - J[:, k]).max() < 1e-3


def test_a_hand_at_rest_tells_no_offset() -> None:
    """Its standard deviation is far beyond a millisecond, or infinite."""
    t, rng = np.arange(0.0, 2.0, 0.004), np.random.default_rng(0)
    rest = np.tile((0.7, 0.0, 0.3), (len(t), 1))
    seen = rest + 1e-3 * rng.standard_normal(rest.shape)
    solved = fit(clock_problem(t_seen=t, seen=seen, t_arm=t, hand=rest, search=0.1), robust=True)
    assert not solved.sigma_of("offset") < 1e-3
    assert "offset" in solved.undetermined


def test_records_that_do_not_overlap_are_refused() -> None:
    """The message asks to compare the times."""
    t = np.arange(0.0, 1.0, 0.004)
    with pytest.raises(InputError, match="overlap"):
        clock_problem(t_seen=t + 50.0, seen=waved(t), t_arm=t, hand=waved(t), search=1.0)
