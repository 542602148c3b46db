"""What flows: what a user has to say of a ball, and what follows from it."""

import numpy as np
import pytest

import mitt
from mitt.core.ball.flight import acceleration
from mitt.core.errors import InputError
from mitt.core.map.learn import Learned

_R = np.array([2.8, 0.1, 0.5])
_DR = np.array([-5.4, -0.1, 1.2])


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
        t=0.3,
        tracked=True,
        r_o=_R,
        dr_o=_DR,
        ddr_o=short.ddr_o,
        drag=0.04,
        covariance=1e-6 * np.eye(6),
        t_seen=0.3,
        t_first=0.0,
        led=False,
    )
    mine, other = (learned.map.reference(x) for x in (short, full))
    assert np.array_equal(mine.q_d, other.q_d)
    assert np.array_equal(mine.ddq_d, other.ddq_d)
    assert mine.time_to_catch == other.time_to_catch


def test_a_ball_without_a_velocity_is_refused() -> None:
    """One line, also where the acceleration would follow from it."""
    for dr in (None, [1.0, 2.0], "fast"):
        with pytest.raises(InputError if not isinstance(dr, list) else ValueError, match=r"dr_o"):
            mitt.BallState(t=0.3, r_o=_R, dr_o=dr)  # type: ignore[arg-type]


@pytest.mark.parametrize("drag", [-1.0, -0.999, -1e-12, 1e9, np.nan, np.inf, 10.001])
def test_a_drag_that_no_ball_has_is_refused(drag: float) -> None:
    """None of them means anything else, as that the ball is led."""
    for ddr_o in (None, np.zeros(3)):
        with pytest.raises(mitt.MittError, match="drag"):
            mitt.BallState(t=0.3, r_o=_R, dr_o=_DR, ddr_o=ddr_o, drag=drag)  # type: ignore[arg-type]


def test_a_covariance_is_one() -> None:
    """Any product L L' passes, of whatever rank and scale; no matrix with a negative variance."""
    rng = np.random.default_rng(3)
    for k in range(200):
        L = rng.normal(size=(6, 1 + k % 6)) * 10.0 ** rng.uniform(-6, 2, (6, 1))
        P = L @ L.T
        assert np.array_equal(mitt.BallState(t=0.3, r_o=_R, dr_o=_DR, covariance=P).covariance, P)
        _, axes = np.linalg.eigh(P / np.sqrt(np.outer(P.diagonal(), P.diagonal())))
        sigma = np.sqrt(P.diagonal())
        worse = P - np.outer(sigma, sigma) * np.outer(axes[:, 0], axes[:, 0])
        odd = P.copy()
        odd[0, 1] += sigma[0] * sigma[1]
        for bad in (-P, worse, odd, np.where(np.eye(6) > 0, np.nan, P), np.full((6, 6), np.inf)):
            with pytest.raises(mitt.MittError, match="covariance"):
                mitt.BallState(t=0.3, r_o=_R, dr_o=_DR, covariance=bad)
