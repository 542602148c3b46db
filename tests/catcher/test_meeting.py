"""Meeting as a generator: what its verdict says before moving, and how it follows and leaves."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import cache
from math import inf
from typing import Any

import numpy as np
import pytest
from support import thorough

from mitt.core.arm.arm import Arm
from mitt.core.arm.tools import Suction
from mitt.core.catcher.catcher import Catcher, CatcherSettings, Phase
from mitt.core.catcher.glide import Glide
from mitt.core.catcher.meeting import Meeting, MeetingSettings
from mitt.core.catcher.planner import PIECES
from mitt.core.map.demand import Tolerance
from mitt.core.map.meeting import unlearned_meeting
from mitt.core.signals import TICK, ArmState, Array, BallState, Senses, Sighting
from mitt.core.verdict.feasibility import Outcome
from mitt.core.verdict.pieces import Pieces, Unfinished
from mitt.io.arm_file import load_arm
from mitt.lab.trials.station import CARRIED

Q = np.array([0.2, -1.3, 1.8, -2.1, -1.5, 0.3])
ENDLESS = Tolerance(torque=1e6, speed=1e6, acceleration=1e6)


@cache
def bare() -> Arm:
    """Return a UR5e that waits in a pose."""
    arm = load_arm("ur5e", hand="none", joints=None)
    return Arm(replace(arm.model, q_ready=Q), arm.limits)


def meeting(arm: Arm | None = None, *, width: float = 0.3, **of: object) -> Meeting:
    """Return a generator whose work area is about the tool's place, with other settings."""
    arm = bare() if arm is None else arm
    place, room = bare().position(Q), np.array([0.2, width, 0.2])
    low, high = (tuple((place + x * room).tolist()) for x in (-1.0, 1.0))
    settings = MeetingSettings(low=low, high=high, above=0.05, **of)  # type: ignore[arg-type]
    return Meeting(unlearned_meeting(arm, tuple(range(6))), settings)


def part(speed: float = 0.2, ahead: float = 0.3, x: float = 0.0) -> BallState:
    """Return a part that comes along y, as far before the tool's place as is said."""
    r = bare().position(Q) + np.array([x, -ahead, -0.05])
    covariance = 1e-8 * np.eye(6)
    return BallState(
        t=0.0,
        r_o=r,
        dr_o=np.array([0.0, speed, 0.0]),
        led=True,
        ddr_o=np.zeros(3),
        covariance=covariance,
    )


def with_limits(**of: float) -> Arm:
    """Return the arm with further limits, the same of each joint."""
    each: dict[str, Any] = {name: np.full(6, x) for name, x in of.items()}
    return Arm(bare().model, replace(bare().limits, **each))


def narrow() -> Arm:
    """Return the arm with a first joint that hardly turns."""
    first, *rest = bare().model.links
    short = replace(first, q_min=Q[0] - 0.02, q_max=Q[0] + 0.02)
    return Arm(replace(bare().model, links=(short, *rest)), bare().limits)


def test_a_part_that_can_be_met_is_met_as_soon_as_all_limits_allow() -> None:
    """The motion that the verdict has looked at begins in the pose and ends with the part."""
    g = meeting()
    verdict = g.verdict(part(), Q)
    assert verdict.outcome is Outcome.FEASIBLE
    assert verdict.share <= 1.0
    assert verdict.approach is not None
    first, last = verdict.approach.motion[0], verdict.approach.motion[-1]
    assert np.allclose(first, [Q, 0.0 * Q, 0.0 * Q], atol=1e-6)
    end = verdict.t_catch + g.settings.window
    met = part().r_o + end * part().dr_o
    assert np.allclose(bare().position(last[0]), met, atol=1e-8)
    assert np.allclose(bare().jacobian(last[0]) @ last[1], part().dr_o, atol=1e-7)


#: What cannot be met, by the limit that binds.
REFUSED: dict[str, Callable[[], tuple[Meeting, BallState]]] = {
    "area": lambda: (meeting(), part(speed=0.2, ahead=-0.4)),
    "window": lambda: (meeting(closing=2.0), part(speed=1.0)),
    "domain": lambda: (meeting(width=5.0), part(speed=0.1, ahead=-3.0)),
    "tool": lambda: (meeting(speed=0.02), part()),
    "speed:": lambda: (replace(meeting(), tolerance=replace(ENDLESS, speed=0.01)), part()),
    "torque:": lambda: (replace(meeting(), tolerance=replace(ENDLESS, torque=0.01)), part()),
    "acceleration:": lambda: (meeting(with_limits(acceleration=0.2)), part()),
    "jerk:": lambda: (meeting(with_limits(jerk=1.0)), part()),
    "torque_rate:": lambda: (meeting(with_limits(torque_rate=0.5)), part()),
    "range:shoulder_pan": lambda: (replace(meeting(narrow()), tolerance=ENDLESS), part()),
}


@pytest.mark.parametrize("binding", REFUSED)
def test_a_part_that_cannot_be_met_is_refused_with_the_limit_that_binds(binding: str) -> None:
    """Too fast for a limit, out of reach, or gone before the tool has closed; it does not start."""
    g, ball = REFUSED[binding]()
    verdict = g.verdict(ball, Q)
    assert verdict.outcome is Outcome.UNSETTLED
    assert verdict.binding_limit.startswith(binding)
    assert g.adapt(ball, Q, np.zeros(6)).start == inf


def test_what_a_verdict_has_planned_is_not_planned_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """A robot waits for commands while the catcher thinks; of a newer estimate it plans anew."""
    way, tried = Meeting._way, list[float]()

    def counted(self: Meeting, ball: BallState, q: Array, T: float) -> Any:  # noqa: ANN401
        tried.append(T)
        return way(self, ball, q, T)

    monkeypatch.setattr(Meeting, "_way", counted)
    g, ball = meeting(arm=with_limits(acceleration=20.0)), part()
    verdict = g.verdict(ball, Q)
    asked = len(tried)
    assert verdict.outcome is Outcome.FEASIBLE
    assert 1 < asked <= 5
    begun = g.adapt(ball, Q, np.zeros(6))
    assert begun.start + begun.after == verdict.t_catch
    assert len(tried) == asked
    later = replace(ball, t=0.1)
    assert g.adapt(later, Q, np.zeros(6)).start == 0.1
    assert len(tried) > asked


def begins(period: float, first: float, drift: float, pause: float | None = None) -> float:
    """Return when an arm begins to meet a part that comes along, after the first tick [s].

    Args:
        period: Of the loop [s].
        first: Time of its first tick [s].
        drift: By how much its clock is fast.
        pause: Between two verdicts [s]; as the generator says if None.
    """
    of = CatcherSettings(flight=CARRIED, sigma_ready=0.05)
    with pytest.MonkeyPatch.context() as patch:
        if pause is not None:
            patch.setattr(Meeting, "pause", lambda _: pause)
        catcher, still = Catcher(bare(), meeting(), settings=of), np.zeros(6)
        for k in range(round(2.0 / period)):
            since = k * period
            t = first + since * (1.0 + drift)
            r_o = part(ahead=1.0).r_o + since * part().dr_o
            seen = Sighting(t=t, found=True, r_o=r_o, covariance=1e-6 * np.eye(3))
            catcher.step(Senses(t=t, arm=ArmState(t=t, q=Q, dq=still), points=(seen,)))
            catcher.think()
            if catcher.phase is not Phase.WATCH:
                return since
    return inf


@pytest.mark.parametrize("period", [0.0005, 0.002, 0.004, 0.007])
def test_a_meeting_begins_in_time_in_any_loop(period: float) -> None:
    """Whatever its period, the number of its first millisecond, and the drift of its clock.

    As if it thought about it in each tick, but for 10 ms.
    """
    rng = np.random.default_rng(round(1e6 * period))
    for first in (0.001 * rng.integers(1, 8), 1.7e9 + rng.uniform(0.0, 0.008)):
        drift = rng.uniform(-2e-4, 2e-4)
        best = begins(period, first, drift, pause=0.0)
        assert 0.3 < best < inf
        assert begins(period, first, drift) < best + 0.01


def test_a_verdict_is_worked_out_a_few_pieces_a_tick(monkeypatch: pytest.MonkeyPatch) -> None:
    """No call of a loop works more out, and piece by piece it is the verdict that it is at once."""
    worked, of, think = [0], Pieces.of, Catcher.think

    def counted(pieces: Pieces, *args: Any, **kwargs: Any) -> Any:  # noqa: ANN401
        before, answer = pieces.left, of(pieces, *args, **kwargs)
        worked[-1] += before > pieces.left or before == inf
        return answer

    def thought(catcher: Catcher) -> None:
        worked.append(0)
        think(catcher)

    with monkeypatch.context() as patch:
        patch.setattr(Pieces, "of", counted)
        patch.setattr(Catcher, "think", thought)
        assert begins(TICK, 0.001, 0.0) < inf
    assert max(worked) == PIECES
    g, ball, pieces, times = meeting(arm=with_limits(acceleration=20.0)), part(), Pieces(0), 0
    said = None
    while said is None:
        pieces.grant(1)
        times += 1
        with suppress(Unfinished):
            said, begun = g.consider(ball, Q, None, pieces)
    assert times > 4
    assert said == meeting(arm=with_limits(acceleration=20.0)).verdict(ball, Q)
    assert begun.adapt(ball, Q, np.zeros(6)).start + begun.after == said.t_catch


def test_the_way_to_a_part_begins_before_the_part_is_in_reach() -> None:
    """Within all limits, and it ends with the part all the same."""
    ball = part(speed=0.8, ahead=1.0)
    g = meeting(width=0.5)
    assert not g.map.virtual(np.array([ball.r_o, np.zeros(3), np.zeros(3)]))[0]
    g = g.adapt(ball, Q, np.zeros(6))
    assert g.start == 0.0
    assert np.any(g.pull)
    rows = np.zeros((3, 6))
    for t in np.arange(0.0, g.after + 0.01, TICK).tolist():
        now = replace(ball, t=t, r_o=ball.r_o + t * ball.dr_o)
        said = g.reference(now)
        rows = np.array([said.q_d, said.dq_d, said.ddq_d])
        assert t > 0.0 or np.allclose(rows, [Q, 0.0 * Q, 0.0 * Q], atol=1e-6)
    assert np.allclose(bare().position(rows[0]), now.r_o, atol=1e-6)
    assert np.allclose(bare().jacobian(rows[0]) @ rows[1], now.dr_o, atol=1e-6)


def test_under_way_the_tool_is_with_the_part_whatever_it_does_and_lifts_it_to_rest() -> None:
    """A part that is slowed down on the way is met with its position and velocity all the same."""
    ball = part(speed=0.3)
    g = meeting(settle=0.05).adapt(ball, Q, np.zeros(6))
    assert g.start == 0.0
    r, speed, left, rows = ball.r_o.copy(), 0.3, inf, np.zeros((3, 6))
    for tick in range(1, 3000):
        slower = -0.3 if 200 < tick <= 500 else 0.0
        speed += TICK * slower
        r[1] += TICK * speed
        now = replace(
            ball,
            t=tick * TICK,
            r_o=r.copy(),
            dr_o=np.array([0.0, speed, 0.0]),
            ddr_o=np.array([0.0, slower, 0.0]),
        )
        said = g.reference(now)
        left, rows = said.time_to_catch, np.array([said.q_d, said.dq_d, said.ddq_d])
        if left <= 0.0:
            break
    assert left <= 0.0
    assert np.linalg.norm(bare().position(rows[0]) - r) < 2e-4
    assert np.linalg.norm(bare().jacobian(rows[0]) @ rows[1] - [0.0, speed, 0.0]) < 2e-3
    away = g.leaving(rows)
    assert away is not None
    assert np.allclose(away[0], rows, atol=1e-6)
    assert np.allclose(away[-1, 1:], 0.0, atol=1e-7)
    lifted = bare().position(away[-1, 0]) - bare().position(rows[0])
    lifted -= 0.5 * TICK * (len(away) - 1) * bare().jacobian(rows[0]) @ rows[1]
    assert np.allclose(lifted, -0.05 * g.map.frame[:, 2], atol=1e-9)
    steps = np.diff(away[:, 0], axis=0) - TICK * 0.5 * (away[1:, 1] + away[:-1, 1])
    assert np.abs(steps).max() < 1e-6


@pytest.mark.parametrize("leaves", [True, False])
def test_a_tool_in_step_closes_sooner_where_the_part_leaves_not_where_it_enters(
    leaves: bool,
) -> None:
    """Its work area; a belt that slows down brings a part there later than it was met."""
    ball = part(speed=0.3)
    g = meeting(settle=0.2, closing=0.05).adapt(ball, Q, np.zeros(6))
    met = ball.r_o[1] + 0.3 * g.after
    side: dict[str, Any] = (
        {"high": (9.0, met + 0.02, 9.0)} if leaves else {"low": (-9.0, met + 0.05, -9.0)}
    )
    g = replace(g, settings=replace(g.settings, **side))
    for tick in range(1, round(g.after / TICK) + 12):
        t = tick * TICK
        now = replace(ball, t=t, r_o=ball.r_o + t * ball.dr_o)
        left = g.reference(now).time_to_catch
    assert left < inf
    assert (left < 0.1) == leaves


def led(g: Meeting, rng: np.random.Generator, speed: float, jumps: float) -> tuple[str, Array]:
    """Lead a tool after a part whose estimate jumps with each sighting, until it closes or not.

    Returns why it was given up, or nothing, and how far tool and estimate then were from each
    other [m, m/s].
    """
    ball = part(speed=speed, ahead=0.35 * speed)
    g = g.adapt(ball, Q, np.zeros(6))
    assert g.start == 0.0
    r, v, off, drift = ball.r_o.copy(), speed, np.zeros(3), np.zeros(3)
    apart = np.full(2, np.inf)
    for tick in range(1, 6000):
        v += TICK * 1.5 * np.sin(9.0 * tick * TICK + rng.uniform(-0.3, 0.3))
        r = r + np.array([0.0, TICK * v, 0.0])
        if tick % 16 == 0:
            off, drift = jumps * rng.standard_normal(3), 5.0 * jumps * rng.standard_normal(3)
        now = replace(ball, t=tick * TICK, r_o=r + off, dr_o=np.array([0.0, v, 0.0]) + drift)
        said = g.reference(now)
        tool = [bare().position(said.q_d), bare().jacobian(said.q_d) @ said.dq_d]
        estimate = g.known(now)
        apart = np.array([np.linalg.norm(x - y) for x, y in zip(tool, estimate[:2], strict=True)])
        if said.time_to_catch <= g.settings.closing:
            return "", apart
        if g.glide.ended:
            break
    return g.glide.ended, apart


@pytest.mark.parametrize("gentle", [0.0, 6.0])
@pytest.mark.parametrize("speed", thorough([0.3, 1.5], [1.0]))
def test_a_tool_closes_in_step_or_not_at_all(speed: float, gentle: float) -> None:
    """Whatever a belt or a hand does, and however badly it is seen; it ends with a reason."""
    rng, ends = np.random.default_rng(round(10 * speed)), list[str]()
    along = None if gentle else (0.0, 1.0, 0.0)
    for k in range(8):
        g = meeting(
            width=0.5, along=along, gentle=gentle, closing=0.05, settle=0.0 if gentle else 0.1
        )
        why, apart = led(replace(g, tolerance=ENDLESS), rng, speed, 1e-4 * 2.0**k)
        ends.append(why)
        if not why:
            assert apart[0] <= 0.003
            assert apart[1] <= 0.035
    assert "" in ends
    assert set(ends) - {""} <= {"window", "area", "taken", "domain"}
    assert gentle or "window" in ends


@pytest.mark.parametrize("seed", range(4))
def test_whatever_a_hand_does_the_tool_is_no_faster_than_it_may_be(seed: int) -> None:
    """It runs away, comes back, jumps; what cannot be followed is given up with a reason."""
    rng, most, ball = np.random.default_rng(seed), 0.25, part(speed=0.05, ahead=0.05)
    g = meeting(speed=most, down=0.9).adapt(ball, Q, np.zeros(6))
    assert g.start == 0.0
    r, dr, to, poses = ball.r_o.copy(), ball.dr_o.copy(), ball.dr_o.copy(), [Q]
    for tick in range(1, 2500):
        if tick % 250 == 0:
            away = bare().position(Q) - [0.0, 0.0, 0.05] - r
            to = 2.0 * away + (0.1 + 0.3 * seed) * rng.standard_normal(3)
        dr += TICK / 0.05 * (to - dr)
        r += TICK * dr + (0.01 * rng.standard_normal(3) if tick % 400 == 0 else 0.0)
        now = replace(ball, t=tick * TICK, r_o=r.copy(), dr_o=dr.copy())
        said = g.reference(now)
        if said.time_to_catch == inf:
            break
        poses.append(said.q_d)
    way = np.diff([bare().position(q) for q in poses], axis=0) / TICK
    assert len(way) > 100
    assert np.linalg.norm(way, axis=1).max() <= 1.05 * most
    ended = said.time_to_catch == inf
    assert (g.verdict(now, Q).binding_limit in ("tool", "area", "taken")) == ended


def test_what_is_due_closes_however_late_it_is() -> None:
    """In step for long enough by the tick in which its time is over: it closes; out of step not."""
    g = meeting(settle=0.1, closing=0.05).adapt(part(), Q, np.zeros(6))
    t = g.start + g.after + g.settings.window + g.settings.longest + 0.004
    late = replace(part(), t=t, r_o=bare().position(Q), dr_o=np.zeros(3))
    g.glide.to(t, g.known(late), np.zeros((3, 3)))
    for off, ended in ((0.0, ""), (0.01, "window")):
        g.glide.calm, g.glide.closes, g.glide.ended = t - 0.2, inf, ""
        seen = replace(late, r_o=late.r_o + np.array([off, 0.0, 0.0]))
        left = g.time_left(seen, np.array([Q, 0.0 * Q]))
        assert g.glide.ended == ended
        assert left == (inf if ended else pytest.approx(0.049))


def test_what_is_blocked_while_a_tool_closes_is_let_go() -> None:
    """The arm cannot follow any more: it brakes, and opens what would close on nothing."""
    arm = Arm(replace(bare().model, hand=Suction(length=0.03, delay=0.3)), bare().limits)
    of = CatcherSettings(flight=CARRIED, sigma_ready=0.05, adapt_dq=inf)
    catcher = Catcher(arm, meeting(arm, closing=0.3), settings=of)
    q, dq, closing = arm.q_ready, np.zeros(6), 0
    for tick in range(4000):
        t = tick * TICK
        r_o = part().r_o + t * part().dr_o
        seen = Sighting(t=t, found=True, r_o=r_o, covariance=1e-8 * np.eye(3))
        command = catcher.step(Senses(t=t, arm=ArmState(t=t, q=q, dq=dq), points=(seen,)))
        braked = catcher.phase is Phase.BRAKE
        catcher.think()
        if braked:
            break
        q, dq = command.q.copy(), command.dq.copy()
        closing += command.hand > 0.0
        if closing == 20:
            catcher.state.safety.bounds["dq_max"] = 0.005
    assert closing > 20
    assert catcher.verdict is not None
    assert catcher.verdict.binding_limit == "blocked"
    assert command.hand == 0.0


@pytest.mark.parametrize(
    ("speed", "belt", "why"),
    [(0.2, True, ""), (1.2, True, "hidden"), (0.2, False, "hidden"), (0.0, True, "")],
)
def test_what_is_hidden_is_held_by_its_belt(speed: float, belt: bool, why: str) -> None:
    """For as long as the belt's speed tells where it is; a free thing as long as its filter does.

    It stays across the belt where it was seen, whatever the filter's noise makes of it.
    """
    across, along = np.array([0.01, 0.0, 0.0]), (0.0, 1.0, 0.0) if belt else None
    seen = replace(part(speed=speed, ahead=0.3 * speed + 0.01), covariance=1e-6 * np.eye(6))
    g = replace(meeting(along=along), start=0.0, after=1.0)
    g = replace(g, map=g.map.adapt(g.known(seen), np.array([Q, 0 * Q, 0 * Q]), 1.0) or g.map)
    g.follow(seen)
    for tick in range(1, 450):
        t = tick * TICK
        place = seen.r_o + t * (seen.dr_o + across)
        now = replace(seen, t=t, r_o=place, dr_o=seen.dr_o + across)
        now = replace(now, t_seen=0.0, covariance=(1e-6 + (0.8 * t * t) ** 2) * np.eye(6))
        g.follow(now)
        if g.glide.ended:
            break
    assert g.glide.ended == why
    if belt:
        assert g.known(now)[0] == pytest.approx(seen.r_o + now.t * seen.dr_o, abs=1e-12)


#: How a part is lost, by why: it runs off, falls out of a hand, leaves its belt, is elsewhere.
LOST: dict[str, tuple[str, tuple[float, float, float] | None, Array, float]] = {
    "away": ("area", None, np.array([0.0, 0.5, 0.0]), 0.0),
    "fallen": ("taken", None, np.array([0.0, 0.0, -1.0]), 0.0),
    "off the belt": ("taken", (0.0, 1.0, 0.0), np.array([0.4, 0.0, 0.3]), 0.0),
    "jumped": ("taken", None, np.array([0.0, 0.1, 0.0]), 0.12),
}


@pytest.mark.parametrize("how", LOST)
def test_a_part_that_is_lost_is_given_up(how: str) -> None:
    """Before the tool has reached where it would have been; the reason is said."""
    why, along, then, jump = LOST[how]
    ball = part(speed=0.1, ahead=0.05)
    g = meeting(along=along).adapt(ball, Q, np.zeros(6))
    assert g.start == 0.0
    r, until = ball.r_o.copy(), g.after - 0.5 * g.settings.down
    for tick in range(1, 2000):
        lost = tick * TICK > until
        dr = then if lost else ball.dr_o
        r += TICK * dr + (jump if lost else 0.0) * np.array([1.0, 0.0, 0.0])
        jump = 0.0 if lost else jump
        now = replace(ball, t=tick * TICK, r_o=r.copy(), dr_o=dr)
        if g.reference(now).time_to_catch == inf:
            break
    verdict = g.verdict(now, Q)
    assert verdict.outcome is Outcome.UNSETTLED
    assert verdict.binding_limit == why
    if why == "taken":
        assert now.t < until + 0.01


def test_an_estimate_that_jumps_is_followed_without_a_jump_and_without_a_lag() -> None:
    """Not even of the acceleration; and across a belt what jumps is closed more slowly."""
    glide, along = Glide(), np.array([0.0, 1.0, 0.0])
    across = np.eye(3) - np.outer(along, along)

    def given(t: float) -> Array:
        r = np.array([0.0, 0.4 * t, 0.0]) + (0.003 if t > 0.1005 else 0.0)
        return np.array([r, 0.4 * along, np.zeros(3)])

    rows = np.array([glide.to(k * TICK, given(k * TICK), across) for k in range(1500)])
    change = np.abs(np.diff(rows[:, 2], axis=0)).max()
    assert 0.0 < change < 0.3
    assert np.allclose(rows[-1, 0], given(1.499)[0], atol=1e-5)
    assert np.allclose(rows[-1, 1], 0.4 * along, atol=1e-4)
    off = np.abs(rows[250, 0] - given(0.25)[0])
    assert off[1] < 0.5 * off[0]
