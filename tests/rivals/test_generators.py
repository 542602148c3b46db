"""Every rival behind the generator's call: finite, repeatable, and able to catch."""

import re
import sys
from collections.abc import Callable
from dataclasses import replace
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from support import ball_state

from mitt.core.arm.arm import Arm
from mitt.core.arm.hands import HandModel
from mitt.core.catcher.generators import Generator
from mitt.core.errors import InputError, UnknownNameError
from mitt.core.map.learn import Learned
from mitt.core.map.map_design import default_design
from mitt.core.map.mapping import DirectMap, unlearned
from mitt.core.signals import Array, BallState, JointReference, MapStatus
from mitt.core.verdict.feasibility import Outcome
from mitt.io.wam import wam, wam_limits
from mitt.lab.rivals.intercept import Intercept
from mitt.lab.rivals.planned import Plan, Planned, Planner
from mitt.lab.rivals.pursuit import rival as rival_by
from mitt.lab.trials import registry
from mitt.lab.trials.registry import available, factory_of, make_generator
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.source import source_of
from mitt.lab.world.scene import Scene
from mitt.lab.world.throws import Throw

#: Rivals that are told nothing.
HONEST = ("ik", "quintic", "ruckig", "mpc", "ds")
G = np.array([0.0, 0.0, -9.81])


@pytest.fixture(name="rival", params=HONEST)
def _rival(request: pytest.FixtureRequest, learned: Learned) -> Generator:
    """Each rival in turn."""
    return make_generator(str(request.param), learned.map)


def test_a_rival_is_finite_whatever_the_ball(rival: Generator, arm: Arm) -> None:
    """Before it was adapted, after it, and for balls that are no numbers."""
    ball = ball_state(np.array([3.0, 0.1, 0.5]), np.array([-6.0, 0.0, 1.5]), G)
    started = rival.adapt(ball, arm.q_ready, np.zeros(3))
    for generator in (rival, started):
        for bad in (0.1, np.nan, np.inf, 1e300):
            given = replace(ball, t=0.01, r_o=np.array([bad, 0.0, 0.0]))
            reference = generator.reference(given)
            rows = (reference.q_d, reference.dq_d, reference.ddq_d, reference.q_o, reference.dq_o)
            assert all(np.all(np.isfinite(row)) for row in rows)


def test_what_a_rival_calls_unsettled_is_what_its_verdict_says(rival: Generator, arm: Arm) -> None:
    """Led past the arm at every distance and height, near and far in time."""
    said = set()
    for k in range(60):
        r_o = np.array([3.0 - 0.04 * k, 0.02 * k - 0.4, 0.5 - 0.02 * k])
        ball = replace(ball_state(r_o, np.array([-3.0, 0.2, 0.1]), np.zeros(3)), led=k % 7 != 0)
        known = rival.unsettled(ball, arm.q_ready)
        assert known == (rival.verdict(ball, arm.q_ready).outcome is Outcome.UNSETTLED)
        said.add(known)
    assert said == {True, False}


def test_a_rival_starts_where_the_arm_is(
    rival: Generator, arm: Arm, ball_of: Callable[[int, float], BallState]
) -> None:
    """At the time of adapting it asks for the arm's own position and speed."""
    q, dq, ball = arm.q_ready + 0.05, np.array([0.2, -0.1, 0.3]), ball_of(3, 0.08)
    reference = rival.adapt(ball, q, dq).reference(ball)
    assert reference.status is MapStatus.INSIDE
    assert np.allclose(reference.q_d, q, atol=1e-9)
    assert np.allclose(reference.dq_d, dq, atol=1e-9)
    assert reference.time_to_catch > 0.1


def test_a_rival_repeats_itself(
    rival: Generator, arm: Arm, ball_of: Callable[[int, float], BallState]
) -> None:
    """Asked twice about an instant, with another ball between, it says the same to the bit."""
    run = rival.adapt(ball_of(3, 0.08), arm.q_ready, np.zeros(3))
    for t in (0.08, 0.081, 0.082, 0.2):
        ball = ball_of(3, t)
        first = run.reference(ball)
        run.reference(replace(ball, r_o=ball.r_o + 0.02))
        again = run.reference(ball)
        assert np.array_equal(first.q_d, again.q_d)
        assert np.array_equal(first.ddq_d, again.ddq_d)
        assert first.time_to_catch == again.time_to_catch


def test_a_rival_is_at_the_ball_at_the_catch(
    rival: Generator, arm: Arm, ball_of: Callable[[int, float], BallState]
) -> None:
    """On a flight that is known exactly, the reference meets position and speed of the ball."""
    run, t = rival.adapt(ball_of(5, 0.08), arm.q_ready, np.zeros(3)), 0.08
    reference = run.reference(ball_of(5, t))
    while reference.time_to_catch > 0.0005:
        t += 0.001
        reference = run.reference(ball_of(5, t))
    ball = ball_of(5, t)
    assert np.linalg.norm(arm.position(reference.q_d) - ball.r_o) < 0.005
    assert np.linalg.norm(arm.jacobian(reference.q_d) @ reference.dq_d - ball.dr_o) < 0.3


def test_verdicts_say_what_is_in_reach(
    rival: Generator, arm: Arm, ball_of: Callable[[int, float], BallState]
) -> None:
    """A default throw is feasible; one that flies past at 3 m is not; a low one is open."""
    assert rival.verdict(ball_of(3, 0.08), arm.q_ready).outcome is Outcome.FEASIBLE
    far = ball_state(np.array([3.0, 3.0, 2.0]), np.array([-6.0, 0.0, 2.0]), G)
    assert rival.verdict(far, arm.q_ready).outcome is Outcome.UNREACHABLE
    low = ball_state(np.array([2.5, 0.0, 0.0]), np.array([-4.0, 0.0, 0.0]), G)
    assert rival.verdict(low, arm.q_ready).outcome is Outcome.OPEN
    assert not rival.returns(low)


def test_an_open_throw_is_waited_for_at_the_nominal_height(
    rival: Generator, arm: Arm, learned: Learned
) -> None:
    """The surrogate target keeps its way over the ground and tops out within reach."""
    low = ball_state(np.array([2.5, 0.1, 0.0]), np.array([-4.0, 0.0, -1.0]), G)
    surrogate = rival.waiting(low)
    assert np.array_equal(surrogate.r_o[:2], low.r_o[:2])
    reach = np.hypot(*arm.position(learned.map.start)[:2])
    after = (np.hypot(*low.r_o[:2]) - reach) / 4.0
    assert surrogate.dr_o[2] - 9.81 * after == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("name", [*HONEST, "clairvoyant"])
def test_a_rival_catches(
    name: str, arm: Arm, learned: Learned, throw_of: Callable[[int], Throw]
) -> None:
    """One default throw, seen as points, is caught within every limit."""
    runner = TrialRunner(arm, make_generator(name, learned.map), Scene(), pixels=False)
    trial = runner.run(0, throw_of(5), seed=3).trial
    assert trial.status == "caught"
    assert trial.limit_violations == 0


@pytest.mark.parametrize("name", ["quintic", "ruckig", "mpc"])
def test_a_rival_catches_with_motors_that_cannot_match_the_ball_s_velocity(
    name: str, throw_of: Callable[[int], Throw]
) -> None:
    """It lets the ball close in, as a map of this arm does, and keeps the limits.

    But for a thousandth in the tick of the impact, which drives the joints on.
    """
    arm = Arm(wam(HandModel()), wam_limits("wam-80v"))
    f = unlearned(arm, default_design(arm))
    runner = TrialRunner(arm, make_generator(name, f), Scene(), pixels=False)
    trial = runner.run(0, throw_of(5), seed=3).trial
    assert trial.status == "caught"
    assert max(*trial.peak_torque_ratio, *trial.peak_speed_ratio) < 1.001


def test_names_are_listed_and_unknown_ones_refused() -> None:
    """The message names every generator."""
    assert {"direct", "unoptimised", "clairvoyant", *HONEST} <= set(available())
    with pytest.raises(UnknownNameError, match=r"ik.*quintic.*clairvoyant"):
        factory_of("magic")


def test_another_package_adds_a_generator(
    monkeypatch: pytest.MonkeyPatch, learned: Learned
) -> None:
    """An entry point of the group is found by its name, and a broken one is one line."""
    from importlib.metadata import EntryPoint  # noqa: PLC0415 (beside its use)

    points = (
        EntryPoint("mine", "mitt.lab.rivals.planned:make_quintic", registry.GROUP),
        EntryPoint("broken", "no_such_package:make", registry.GROUP),
    )
    monkeypatch.setattr(registry, "entry_points", lambda **_: points)
    assert "mine" in available()
    ball = ball_state(np.array([3.0, 0.1, 0.5]), np.array([-6.0, 0.0, 1.5]), G)
    assert make_generator("mine", learned.map).sharpness(ball) < 0.1
    with pytest.raises(InputError, match="broken") as caught:
        make_generator("broken", learned.map)
    assert "\n" not in str(caught.value)


def test_a_name_that_two_packages_give_is_refused(
    monkeypatch: pytest.MonkeyPatch, learned: Learned
) -> None:
    """Nobody could say whose numbers they are."""
    from importlib.metadata import EntryPoint  # noqa: PLC0415 (beside its use)

    points = tuple(EntryPoint("mine", f"{x}:make", registry.GROUP) for x in ("theirs", "ours"))
    monkeypatch.setattr(registry, "entry_points", lambda **_: points)
    with pytest.raises(InputError, match="one package that adds it, got ours:make and theirs:make"):
        make_generator("mine", learned.map)


def _no_number(motion: Array, t: float, catch: Intercept) -> Plan:
    """Return a plan that is none."""
    return SimpleNamespace(at=lambda _: np.full((3, 3), np.nan) * t * catch.t_c + motion)


def _no_way(motion: Array, t: float, catch: Intercept) -> Plan:
    """Break down."""
    raise KeyError(f"{motion} {t} {catch}")


@pytest.mark.parametrize(
    ("planner", "words"), [(_no_number, "finite numbers, got NaN"), (_no_way, "KeyError")]
)
def test_a_planner_of_another_package_is_held_to_its_motion(
    monkeypatch: pytest.MonkeyPatch, learned: Learned, planner: Planner, words: str
) -> None:
    """Made into a generator by ``rival``, which is ours: what fails is the package's own."""
    from importlib.metadata import EntryPoint  # noqa: PLC0415 (beside its use)

    package = ModuleType("of_somebody")
    vars(package)["make"] = lambda f: rival_by(f, Planned(planner=planner))
    monkeypatch.setitem(sys.modules, "of_somebody", package)
    point = EntryPoint("mine", "of_somebody:make", registry.GROUP)
    monkeypatch.setattr(registry, "entry_points", lambda **_: (point,))
    made = make_generator("mine", learned.map)
    runner = TrialRunner(learned.map.arm, made, Scene(), pixels=False)
    source = source_of(learned.map.arm, seed=1, count=1, drag=0.04)
    trial = runner.throw(source, 0).trial
    assert trial.status == "stopped"
    assert trial.stopped_by is not None
    assert re.search(f"generator 'mine'.*{words}", str(trial.stopped_by["hint"]))


class Faulty:
    """A generator of another package that breaks down, or answers what is no answer."""

    def __init__(self, f: DirectMap) -> None:
        """Take the map that it is made from."""
        self._f = f

    def sharpness(self, ball: BallState) -> float:
        """Break down."""
        raise ZeroDivisionError(f"two\nlines {ball.t}")

    def verdict(self, ball: BallState, q: Array) -> str:
        """Say it in words."""
        return f"feasible {ball.t} {q}"

    def unsettled(self, ball: BallState, q: Array) -> bool:
        """Wait for nothing."""
        return bool(ball.t < q[0] - 1e9)

    def returns(self, ball: BallState) -> bool:
        """Follow whatever comes."""
        return ball.tracked

    def waiting(self, ball: BallState) -> BallState:
        """Wait for nothing."""
        return ball

    def adapt(self, ball: BallState, q: Array, dq: Array) -> None:
        """Forget to return what starts there."""

    def reference(self, ball: BallState) -> JointReference:
        """Divide by zero somewhere."""
        return replace(self._f.reference(ball), q_d=np.full(3, np.nan))

    def as_map(self) -> None:
        """Say that this is no map."""


def test_an_error_of_another_package_is_said_to_be_that_package_s(
    monkeypatch: pytest.MonkeyPatch, learned: Learned
) -> None:
    """When it is made and when it is asked: one line that names the generator."""
    from importlib.metadata import EntryPoint  # noqa: PLC0415 (beside its use)

    package = ModuleType("of_somebody")
    vars(package)["make"] = Faulty
    vars(package)["half"] = lambda _f: SimpleNamespace(sharpness=None)
    vars(package)["fail"] = lambda f: f.nothing
    monkeypatch.setitem(sys.modules, "of_somebody", package)
    points = tuple(
        EntryPoint(x, f"of_somebody:{x}", registry.GROUP) for x in ("make", "fail", "half")
    )
    monkeypatch.setattr(registry, "entry_points", lambda **_: points)
    ball = ball_state(np.array([3.0, 0.1, 0.5]), np.array([-6.0, 0.0, 1.5]), G)
    made = make_generator("make", learned.map)
    for name, call in (
        ("make", lambda: made.sharpness(ball)),
        ("make", lambda: made.verdict(ball, learned.map.arm.q_ready)),
        ("make", lambda: made.reference(ball)),
        ("make", lambda: made.adapt(ball, learned.map.arm.q_ready, np.zeros(3))),
        ("fail", lambda: make_generator("fail", learned.map)),
        ("half", lambda: make_generator("half", learned.map)),
    ):
        with pytest.raises(InputError, match=f"generator '{name}'") as caught:
            call()
        assert "repair that package" in str(caught.value)
        assert "\n" not in str(caught.value)
