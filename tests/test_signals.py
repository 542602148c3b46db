"""What flows: what a user has to say of a ball, and what follows from it."""

import numpy as np
import pytest

import mitt
from mitt.ball.flight import acceleration
from mitt.errors import InputError
from mitt.generator.learn import Learned

_R, _DR = np.array([2.8, 0.1, 0.5]), np.array([-5.4, -0.1, 1.2])


def test_a_ball_is_a_time_a_place_and_a_velocity() -> None:
    """Acceleration, as the flight model has it, and times follow."""
    ball, ddr = mitt.BallState(t=0.3, r_o=_R, dr_o=_DR, drag=0.04), np.empty(3)
    acceleration(_DR, 0.04, ddr)
    np.testing.assert_allclose(ball.ddr_o, ddr, rtol=1e-14)
    assert ball.tracked
    assert not ball.led
    assert (ball.t_seen, ball.t_first) == (0.3, 0.3)
    assert mitt.BallState(t=0.3, r_o=_R, dr_o=_DR, t_seen=0.2).t_first == 0.2
    assert not ball.covariance.any()


def test_what_is_left_out_changes_no_reference(learned: Learned) -> None:
    """The map gives the same for a ball that says all and for one that says what is used."""
    short = mitt.BallState(t=0.3, r_o=_R, dr_o=_DR, drag=0.04)
    full = mitt.BallState(
        t=0.3, tracked=True, r_o=_R, dr_o=_DR, ddr_o=short.ddr_o, drag=0.04,
        covariance=1e-6 * np.eye(6), t_seen=0.3, t_first=0.0, led=False,
    )  # fmt: skip
    mine, other = (learned.map.reference(x) for x in (short, full))
    assert np.array_equal(mine.q_d, other.q_d)
    assert np.array_equal(mine.ddq_d, other.ddq_d)
    assert mine.time_to_catch == other.time_to_catch


def test_a_ball_without_a_velocity_is_refused() -> None:
    """One line, also where the acceleration would follow from it."""
    for dr in (None, [1.0, 2.0], "fast"):
        with pytest.raises(InputError if not isinstance(dr, list) else ValueError, match=r"dr_o"):
            mitt.BallState(t=0.3, r_o=_R, dr_o=dr)  # type: ignore[arg-type]
