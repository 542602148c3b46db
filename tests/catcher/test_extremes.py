"""The extremes of every setting, through ticks, verdict and brake; and sightings of other times."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, get_type_hints

import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.catcher.catcher import Catcher, CatcherSettings, Phase
from mitt.core.map.learn import Learned
from mitt.core.signals import GRAVITY, TICK, ArmState, Array, Senses, Sighting

BALL = replace(CatcherSettings().flight, drag_mean=0.0, drag_sigma=0.002)
"""What is thrown: it flies without drag."""
EXTREMES = [
    (name, int(x) if name == "setpoint_delay" else x)
    for name, hint in get_type_hints(CatcherSettings, include_extras=True).items()
    for bounds in getattr(hint, "__metadata__", ())
    for x in (bounds.least, bounds.most)
]


def place(t: float) -> Array:
    """Return where the ball is [m]."""
    out: Array = np.array((3.6, 0.15, 0.2)) + t * np.array((-5.9, -0.2, 2.2))
    out[2] -= 0.5 * GRAVITY * t * t
    return out


def catch(
    arm: Arm,
    learned: Learned,
    wrong: Sequence[tuple[int, Sighting]] = (),
    **settings: Any,  # noqa: ANN401
) -> tuple[Catcher, float, list[Array]]:
    """Throw a ball at an arm that does as it is commanded.

    Returns:
        The catcher, how near the catch point came to the ball [m], and the commands.
    """
    catcher = Catcher(arm, learned.map, settings=CatcherSettings(flight=BALL, **settings))
    q, dq, near, commands = arm.q_ready, np.zeros(arm.n), np.inf, []
    rng, extra = np.random.default_rng(1), dict(wrong)
    for k in range(700):
        t = k * TICK
        z = place(t) + 1e-3 * rng.standard_normal(3)
        seen = [Sighting(t=t, found=True, r_o=z, covariance=1e-6 * np.eye(3))]
        seen += [extra[k]] if k in extra else []
        senses = Senses(t=t, arm=ArmState(t=t, q=q, dq=dq), points=tuple(seen))
        command = catcher.step(senses)
        catcher.think()
        q, dq = command.q, command.dq
        near = min(near, float(np.linalg.norm(arm.position(q) - place(t))))
        commands.append(command.joints)
        if catcher.done:
            break
    return catcher, near, commands


@pytest.mark.parametrize(("name", "value"), EXTREMES)
def test_no_setting_that_is_allowed_breaks_a_throw(
    arm: Arm, learned: Learned, name: str, value: float
) -> None:
    """From the first sight to the end: no exception, and no command that is not finite."""
    catcher, _, commands = catch(arm, learned, **{name: value})  # type: ignore[arg-type]  # a setting
    assert np.isfinite(commands).all()
    verdict = catcher.verdict
    assert verdict is None or np.isfinite(verdict.share)


def test_a_ball_that_the_hand_cannot_hold_is_refused_for_it(arm: Arm, learned: Learned) -> None:
    """Too large for the open fingers, or too small for them to reach: before the arm moves."""
    for radius in (0.005, 0.08, 0.12, 0.5):
        catcher, _, commands = catch(arm, learned, ball_radius=radius)
        assert catcher.phase is Phase.REFUSED
        assert catcher.verdict is not None
        assert catcher.verdict.binding_limit == "grip"
        assert np.array_equal(commands[-1][0], arm.q_ready)


def test_a_sighting_of_another_time_ends_no_throw(arm: Arm, learned: Learned) -> None:
    """One or a burst, stale or ahead, where the ball was or elsewhere: the same commands."""
    _, near, usual = catch(arm, learned)
    assert near < 0.01
    for k, stamp in ((3, -5.0), (60, 3600.0), (350, -0.65), (350, 0.5), (480, -0.7)):
        burst = [
            (
                k + i,
                Sighting(
                    t=(k + i) * TICK + stamp,
                    found=True,
                    r_o=np.ones(3),
                    covariance=1e-6 * np.eye(3),
                ),
            )
            for i in range(8)
        ]
        _, _, commands = catch(arm, learned, burst)
        assert np.array_equal(commands, usual)
