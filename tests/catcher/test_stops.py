"""A catcher that has stopped stays so, whatever fails or is called, and says when it is done."""
# ruff: noqa: D102 (the methods of a generator)

from collections.abc import Callable
from copy import copy
from dataclasses import replace

import numpy as np
import pytest

import mitt
from mitt.core.arm.arm import Arm
from mitt.core.ball.filter import THROWN_BALL
from mitt.core.catcher import planner
from mitt.core.catcher.catcher import Catcher, Phase
from mitt.core.catcher.generators import Direct
from mitt.core.catcher.settings import GRASPS
from mitt.core.control.health import FAILED_TICKS, Reason, State
from mitt.core.errors import InputError
from mitt.core.map.learn import Learned
from mitt.core.map.mapping import DirectMap
from mitt.core.signals import TICK, Array, BallState, Command, JointReference
from mitt.core.verdict.feasibility import Approach, Verdict

RELEASE = np.array([3.6, 0.15, 0.2])
VELOCITY = np.array([-5.9, -0.2, 2.2])
FALL = np.array([0.0, 0.0, -9.81])


#: Most by which a torque may change in a tick, and least weight of the ball at a joint [N m].
CHANGE = 0.02
WEIGHT = 0.15


class Cell:
    """An exact arm, a ball seen with 1 mm of noise, and a catcher, tick by tick."""

    def __init__(self, arm: Arm, catcher: Catcher) -> None:
        """Begin at rest in the ready pose, the ball released."""
        self.arm, self.catcher, self.t, self.rng = arm, catcher, 0.0, np.random.default_rng(7)
        self.q, self.dq = arm.q_ready.copy(), np.zeros(arm.n)
        self.silent, self.braked = False, 0

    def tick(self, *, thinks: bool = True, seen: bool = True) -> Command:
        """Make a tick, then let the arm move by its torques, unless its brakes act by now."""
        r = RELEASE + self.t * VELOCITY + 0.5 * self.t**2 * FALL
        r = r + 1e-3 * self.rng.standard_normal(3)
        ball = mitt.Sighting(t=self.t, found=True, r_o=r, covariance=1e-6 * np.eye(3))
        read = self.q.copy()
        read[1] = np.nan if self.silent else read[1]
        reading = mitt.ArmState(t=self.t, q=read, dq=self.dq)
        points = (ball,) if seen else ()
        command = self.catcher.step(mitt.Senses(t=self.t, arm=reading, points=points))
        if thinks:
            self.catcher.think()
        self.braked = self.braked + 1 if command.brakes else 0
        for _ in range(2):
            if self.braked * TICK > self.arm.brakes[0].delay:
                self.dq = np.zeros(self.arm.n)
                break
            bias = self.arm.inverse_dynamics(self.q, self.dq, np.zeros(self.arm.n))
            ddq = np.linalg.solve(self.arm.mass_matrix(self.q), command.tau - bias)
            self.dq = self.dq + 0.5 * TICK * ddq
            self.q = self.q + 0.5 * TICK * self.dq
        self.t += TICK
        return command

    def until(self, what: Callable[[], bool], *, ticks: int = 1500, seen: bool = True) -> Command:
        """Make ticks until something is so."""
        for _ in range(ticks):
            command = self.tick(seen=seen)
            if what():
                return command
        raise AssertionError(f"{self.catcher.phase}, {self.catcher.stopped_by}")


def cell_of(arm: Arm, generator: object, **settings: float) -> Cell:
    """Return a cell whose filter knows that there is no drag."""
    flight = replace(THROWN_BALL, drag_mean=0.0, drag_sigma=0.002)
    given = mitt.CatcherSettings(flight=flight, **settings)  # type: ignore[arg-type]
    return Cell(arm, Catcher(arm, generator, settings=given))  # type: ignore[arg-type]


def follows(cell: Cell) -> Callable[[], bool]:
    """Return whether the arm of a cell follows at full swing."""
    return lambda: cell.catcher.phase is Phase.FOLLOW and float(np.abs(cell.dq).max()) > 2.0


def rest(q: Array) -> Array:
    """Return a motion that stays where it is."""
    return np.array([[q, np.zeros(len(q)), np.zeros(len(q))]] * 3)


CALLS: dict[str, Callable[[Catcher], object]] = {
    "move": lambda c: c.move(rest(c.result.command[0].copy())),
    "recover": lambda c: c.recover(checked=True),
    "let_go": lambda c: c.let_go(),
    "stop": lambda c: c.stop(),
    "ticked": lambda c: c.ticked(0, 0.0),
    "ticked, grasps": lambda c: c.ticked(GRASPS, 0.0),
    "think": lambda c: c.think(),
    "again": lambda c: c.again(c._planner._given),
    "verdict": lambda c: c.verdict,
    "copy": copy,
}


@pytest.mark.parametrize("thinks", [False, True])
@pytest.mark.parametrize("name", CALLS)
@pytest.mark.parametrize("moving", [False, True])
def test_no_call_undoes_a_stop(
    arm: Arm, learned: Learned, name: str, moving: bool, thinks: bool
) -> None:
    """At rest and at full swing, before the catcher thinks and after: it stays stopped."""
    cell = cell_of(arm, learned)
    cell.until(follows(cell) if moving else lambda: cell.t > 0.01, seen=moving)
    cell.silent = True
    while cell.catcher.stopped_by is None:
        command = cell.tick(thinks=False, seen=moving)
    catcher = cell.catcher
    assert catcher.phase is Phase.STOPPED
    assert not catcher.looking
    assert not catcher.done
    if thinks:
        catcher.think()
    if name in ("move", "recover", "let_go"):
        with pytest.raises(InputError, match=name):
            CALLS[name](catcher)
    else:
        made = CALLS[name](catcher)
        cell.catcher = catcher = made if name == "copy" and isinstance(made, Catcher) else catcher
    for _ in range(250):
        before, command = np.abs(command.dq), cell.tick(seen=moving)
        assert catcher.phase is Phase.STOPPED
        assert command.brakes
        assert np.all(np.abs(command.dq) <= before + 1e-9)
    assert catcher.done
    assert not command.tau.any()


def test_a_hand_lets_go_once_its_arm_has_braked(arm: Arm, learned: Learned) -> None:
    """The ball's weight leaves the torques, no faster than they may change; before, none does."""
    cell = cell_of(arm, learned, ball_mass=0.15)
    catcher = cell.catcher
    with pytest.raises(InputError, match="watch"):
        catcher.let_go()
    cell.tick()
    with pytest.raises(InputError, match="before its first tick"):
        catcher.take_over(np.zeros(arm.n))
    cell.until(lambda: catcher.phase is Phase.BRAKE)
    with pytest.raises(InputError, match="moves"):
        catcher.let_go()
    cell.arm = arm.holding(0.15)
    held = cell.until(lambda: catcher.done, seen=False)
    assert held.hand > 0.5
    catcher.state.tracking.change[:] = CHANGE
    catcher.let_go()
    cell.arm = arm
    commands = [held, *(cell.tick(seen=False) for _ in range(100))]
    assert commands[1].hand == 0.0
    change = np.diff([x.tau for x in commands], axis=0)
    assert np.abs(change).max() <= (1.0 + 1e-9) * CHANGE
    assert np.abs(commands[-1].tau - held.tau).max() > WEIGHT


def test_a_motion_is_taken_as_it_was_given(arm: Arm, learned: Learned) -> None:
    """What becomes of its array afterwards moves nothing, and the arm is done at its end."""
    cell = cell_of(arm, learned)
    cell.until(lambda: cell.t > 0.01, seen=False)
    motion = rest(cell.catcher.result.command[0].copy())
    motion[-1, 1] = 5e-5
    cell.catcher.move(motion)
    motion += 1.0
    assert not cell.catcher.done
    for _ in range(80):
        command = cell.tick(seen=False)
        assert np.array_equal(command.dq, np.zeros(arm.n))
    assert np.abs(command.q - arm.q_ready).max() < 1e-3
    assert cell.catcher.done


def test_a_stop_that_was_asked_for_lets_nothing_begin(arm: Arm, learned: Learned) -> None:
    """Between `stop` and its tick no motion is taken."""
    cell = cell_of(arm, learned)
    cell.until(lambda: cell.t > 0.01, seen=False)
    cell.catcher.stop()
    with pytest.raises(InputError, match="move"):
        CALLS["move"](cell.catcher)
    cell.tick(seen=False)
    assert cell.catcher.phase is Phase.STOPPED


def test_a_throw_is_done_once_the_arm_rests_and_is_held(arm: Arm, learned: Learned) -> None:
    """After a catch, a refusal, a stop, an encoder that fails: at rest, by torques or brakes."""
    for kind in ("caught", "stopped", "silent", "refused"):
        cell = cell_of(arm, learned, ball_mass=5.0 if kind == "refused" else 0.07)
        if kind in ("stopped", "silent"):
            cell.until(follows(cell))
            cell.silent = kind == "silent"
        if kind == "stopped":
            cell.catcher.stop()
        command = cell.until(lambda cell=cell: cell.catcher.done)  # type: ignore[misc]
        phases = {"caught": Phase.BRAKE, "refused": Phase.REFUSED}
        assert cell.catcher.phase is phases.get(kind, Phase.STOPPED)
        assert np.abs(cell.dq).max() < 0.06
        assert command.brakes == (kind == "silent")
        assert bool(command.tau.any()) == (kind != "silent")
        q = cell.q.copy()
        for _ in range(100):
            cell.tick()
        assert cell.catcher.done
        assert np.abs(cell.q - q).max() < 0.01


class Odd:
    """A generator of somebody: a map whose answers are spoilt from a tick on."""

    def __init__(
        self, f: DirectMap, spoils: str, spoil: Callable[[object], object], last: int
    ) -> None:
        """Take the map, which answer is spoilt, how, and in how many of its calls."""
        self._g = Direct(f)
        self.spoils, self._spoil, self.left, self.after = spoils, spoil, last, 0

    def _said(self, name: str, *given: object) -> object:
        """Return an answer, spoilt while it is to be."""
        answer = getattr(self._g, name)(*given)
        if name == self.spoils and self.after > 0:
            self.after -= 1
        elif name == self.spoils and self.left > 0:
            self.left -= 1
            return self._spoil(answer)
        return answer

    def sharpness(self, *x: object) -> object:
        return self._said("sharpness", *x)

    def verdict(self, *x: object) -> object:
        return self._said("verdict", *x)

    def unsettled(self, *x: object) -> object:
        return self._said("unsettled", *x)

    def returns(self, *x: object) -> object:
        return self._said("returns", *x)

    def waiting(self, *x: object) -> object:
        return self._said("waiting", *x)

    def reference(self, *x: object) -> object:
        return self._said("reference", *x)

    def adapt(self, *x: object) -> object:
        adapted = self._said("adapt", *x)
        if isinstance(adapted, Direct):
            self._g = adapted
            return self
        return adapted

    def as_map(self) -> None:
        return None


def fails(_: object) -> object:
    """Raise what nobody expects."""
    raise ZeroDivisionError("in a generator")


def changed(**fields: Callable[[JointReference], object]) -> Callable[[object], object]:
    """Return what changes fields of a reference."""

    def spoil(answer: object) -> object:
        assert isinstance(answer, JointReference)
        new = {name: spoilt(answer) for name, spoilt in fields.items()}
        return replace(answer, **new)  # type: ignore[arg-type]

    return spoil


def of_verdict(**fields: object) -> Callable[[object], object]:
    """Return what changes fields of a verdict."""

    def spoil(answer: object) -> object:
        assert isinstance(answer, Verdict)
        return replace(answer, **fields)  # type: ignore[arg-type]

    return spoil


#: How answers are spoilt: in which call, and what `stopped_by` says of it.
SPOILT: dict[str, tuple[str, Callable[[object], object], str]] = {
    "raises": ("reference", fails, "ZeroDivisionError: in a generator"),
    "None": ("reference", lambda _: None, "JointReference"),
    "time": ("reference", changed(time_to_catch=lambda _: np.nan), "time_to_catch"),
    "no time": ("reference", changed(time_to_catch=lambda _: "soon"), "time_to_catch"),
    "q_d": ("reference", changed(q_d=lambda x: x.q_d * np.nan), "q_d"),
    "q_o": ("reference", changed(q_o=lambda x: x.q_o * np.inf), "q_o"),
    "shape": ("reference", changed(dq_d=lambda x: x.dq_d[:2]), "dq_d"),
    "verdict": ("verdict", lambda _: "feasible", "Verdict"),
    "no verdict": ("verdict", fails, "ZeroDivisionError"),
    "share": ("verdict", of_verdict(share="much"), "verdict.share"),
    "no catch": ("verdict", of_verdict(t_catch=None), "verdict.t_catch"),
    "no rows": (
        "verdict",
        of_verdict(approach=Approach(motion=np.zeros((0, 3, 3)), step=0.01, dr_o=np.zeros(3))),
        "verdict.approach.motion",
    ),
    "sharpness": ("sharpness", lambda _: np.nan, "sharpness"),
    "adapt": ("adapt", lambda _: None, "a generator"),
    "unsettled": ("unsettled", lambda _: "no", "unsettled"),
}


@pytest.mark.parametrize("name", SPOILT)
def test_a_generator_that_fails_stops_the_arm(arm: Arm, learned: Learned, name: str) -> None:
    """In whatever call: no exception, no command that jumps, a stop that names what failed."""
    spoils, spoil, says = SPOILT[name]
    odd = Odd(learned.map, spoils, spoil, 10**6)
    odd.after = 200 if spoils == "reference" else 0
    cell = cell_of(arm, odd)
    before = cell.tick()
    swing = 0.0
    while cell.catcher.stopped_by is None and cell.t < 1.0:
        command = cell.tick()
        assert np.all(np.isfinite(command.joints))
        assert np.abs(command.q - before.q).max() <= TICK * arm.dq_max.max() + 1e-9
        before, swing = command, max(swing, float(np.abs(command.dq).max()))
    by = cell.catcher.stopped_by
    assert by is not None
    assert by.reason is Reason.FAILED
    assert says in by.hint
    assert "\n" not in by.hint
    assert cell.catcher.hint == by.hint
    assert (swing > 1.0) == (spoils == "reference")
    cell.until(lambda: cell.catcher.done)
    odd.left = 0
    cell.catcher.recover()
    assert cell.catcher.hint is None
    cell.tick(seen=False)
    assert cell.catcher.phase is Phase.WATCH


class Writes(Odd):
    """A generator that writes to whatever it is given."""

    def _said(self, name: str, *given: object) -> object:
        answer = getattr(self._g, name)(*given)
        for x in given:
            arrays = (x.r_o, x.dr_o, x.ddr_o, x.covariance) if isinstance(x, BallState) else (x,)
            for array in arrays:
                assert isinstance(array, np.ndarray)
                array[:] = np.nan
        return answer


def test_a_generator_may_write_to_what_it_is_given(arm: Arm, learned: Learned) -> None:
    """It changes nothing: the commands are those of one that does not."""
    odd, fair = Writes(learned.map, "", fails, 0), Odd(learned.map, "", fails, 0)
    cells = cell_of(arm, odd), cell_of(arm, fair)
    for _ in range(600):
        commands = [cell.tick() for cell in cells]
        assert np.array_equal(commands[0].joints, commands[1].joints)
    assert cells[0].catcher.phase is Phase.BRAKE


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"arms": None}, "not iterable"),
        ({"arms": (1,)}, "arms: wanted an Arm"),
        ({"as_map": lambda _: 1 / 0}, "ZeroDivisionError"),
        ({"as_map": lambda _: 5}, "DirectMap"),
    ],
    ids=["no arms", "numbers", "raises", "no map"],
)
def test_a_generator_that_cannot_say_what_it_is_for_is_refused(
    arm: Arm, learned: Learned, fields: dict[str, object], says: str
) -> None:
    """Before any tick, by its name."""
    odd = type("Lost", (Odd,), fields)(learned.map, "", fails, 0)
    with pytest.raises(InputError, match=r"^generator Lost: ") as caught:
        Catcher(arm, odd)
    assert says in str(caught.value)


def test_what_cannot_move_or_recover_says_why(arm: Arm, learned: Learned) -> None:
    """Not by its phase alone, which may be the right one."""
    cell = cell_of(arm, learned)
    with pytest.raises(InputError, match="make a tick first"):
        cell.catcher.move(rest(cell.q))
    cell.tick(seen=False)
    cell.catcher.stop()
    with pytest.raises(InputError, match="told to stop"):
        cell.catcher.move(rest(cell.q))
    with pytest.raises(InputError, match="got watch"):
        cell.catcher.recover()


@pytest.mark.parametrize("name", ["raises", "time", "q_d", "shape", "None"])
def test_a_generator_that_fails_in_a_few_ticks_is_bridged(
    arm: Arm, learned: Learned, name: str
) -> None:
    """The ball is caught all the same, and the ticks say so."""
    spoils, spoil, _ = SPOILT[name]
    odd = Odd(learned.map, spoils, spoil, FAILED_TICKS - 1)
    odd.after = 200
    cell, states, nearest = cell_of(arm, odd), list[State](), np.inf
    while not cell.catcher.done:
        cell.tick()
        tick = cell.catcher.tick
        assert tick is not None
        states += [tick.state] if tick.reason is Reason.FAILED else []
        ball = RELEASE + cell.t * VELOCITY + 0.5 * cell.t**2 * FALL
        nearest = min(nearest, float(np.linalg.norm(arm.position(cell.q) - ball)))
    assert states == [State.DEGRADED] * (FAILED_TICKS - 1)
    assert cell.catcher.phase is Phase.BRAKE
    assert nearest < 0.03


@pytest.mark.parametrize("name", ["plan_brake", "examined", "speed_caps", "ball_in"])
def test_a_plan_that_fails_stops_the_arm(
    arm: Arm, learned: Learned, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is thought between ticks may raise as well, as a solver does."""

    def raises(*_: object, **__: object) -> object:
        raise RuntimeError("no solution")

    cell = cell_of(arm, learned)
    monkeypatch.setattr(planner, name, raises)
    cell.until(lambda: cell.catcher.done)
    by = cell.catcher.stopped_by
    assert by is not None
    assert by.reason is Reason.FAILED
    assert "RuntimeError: no solution" in by.hint


def test_an_arm_that_recovers_is_taken_over_from_its_brakes_smoothly(
    arm: Arm, learned: Learned
) -> None:
    """Torques build up from none at their rate, and the brakes hold until they have."""
    rate = 1000.0
    slow = Arm(arm.model, replace(arm.limits, torque_rate=np.full(len(arm.model.links), rate)))
    cell = cell_of(slow, replace(learned.map, arm=slow))
    cell.until(lambda: cell.t > 0.05, seen=False)
    cell.silent = True
    cell.until(lambda: cell.catcher.done, seen=False)
    cell.silent = False
    cell.until(lambda: cell.t > 0.4, seen=False)
    q, before, held = cell.q.copy(), np.zeros(arm.n), 0
    cell.catcher.recover(checked=True)
    carried = slow.inverse_dynamics(q, np.zeros(arm.n), np.zeros(arm.n))
    for _ in range(60):
        command = cell.tick(seen=False)
        assert np.all(np.abs(command.tau - before) <= rate * TICK * (1.0 + 1e-9))
        short = np.abs(command.tau - carried).max() > 0.5
        assert command.brakes or not short
        before, held = command.tau, held + command.brakes
    assert 10 <= held <= 25
    assert not command.brakes
    assert cell.catcher.phase is Phase.WATCH
    assert np.abs(cell.q - q).max() < 0.005


def test_a_stop_held_by_torques_is_taken_over_from_them(arm: Arm, learned: Learned) -> None:
    """After a stop that was asked for, the torque goes on from the last one."""
    rate = 1000.0
    slow = Arm(arm.model, replace(arm.limits, torque_rate=np.full(len(arm.model.links), rate)))
    cell = cell_of(slow, replace(learned.map, arm=slow))
    cell.until(lambda: cell.t > 0.02, seen=False)
    cell.catcher.stop()
    before = cell.until(lambda: cell.catcher.done, seen=False).tau
    cell.catcher.recover()
    cell.q = cell.q + 0.02  # it was pushed meanwhile
    for _ in range(30):
        command = cell.tick(seen=False)
        assert np.all(np.abs(command.tau - before) <= rate * TICK * (1.0 + 1e-9))
        assert not command.brakes
        before = command.tau


def _shown(arm: Arm, learned: Learned, seen: Callable[[float], mitt.Sighting | None]) -> Catcher:
    """Return a catcher after 4 s of sightings as they are told, each 5 ms."""
    catcher = Catcher(arm, learned)
    for k in range(800):
        t = 5e-3 * k
        reading = mitt.ArmState(t=t, q=arm.q_ready, dq=np.zeros(arm.n))
        sighting = seen(t)
        points = () if sighting is None else (sighting,)
        catcher.step(mitt.Senses(t=t, arm=reading, points=points))
    return catcher


def _ball(t: float) -> Array:
    """Return where a ball is that rolls to and fro, far from the arm [m]."""
    return np.array([3.0 + 0.5 * np.sin(3.0 * t), 0.4 * np.cos(t), 0.1])


HINTS: dict[str, tuple[str, Callable[[float], mitt.Sighting | None]]] = {
    "millimetres": (
        "metres",
        lambda t: mitt.Sighting(t=t, found=True, r_o=1e3 * _ball(t), covariance=np.eye(3)),
    ),
    "square millimetres": (
        "in mm^2",
        lambda t: mitt.Sighting(t=t, found=True, r_o=_ball(t), covariance=np.eye(3)),
    ),
    "clock ahead": (
        "ahead of their ticks",
        lambda t: mitt.Sighting(t=t + 1.7e9, found=True, r_o=_ball(t), covariance=1e-6 * np.eye(3)),
    ),
    "clock behind": (
        "behind their ticks",
        lambda t: mitt.Sighting(t=t - 20.0, found=True, r_o=_ball(t), covariance=1e-6 * np.eye(3)),
    ),
    "repeated": (
        "same place",
        lambda t: mitt.Sighting(t=t, found=True, r_o=_ball(0.0), covariance=1e-6 * np.eye(3)),
    ),
    "not found": (
        "no sighting for",
        lambda t: mitt.Sighting(t=t, found=False, r_o=np.zeros(3), covariance=np.eye(3)),
    ),
    "nothing": ("no sighting for", lambda t: None),  # noqa: ARG005
}


@pytest.mark.parametrize("name", HINTS)
def test_a_catcher_that_will_never_see_its_ball_says_why(
    arm: Arm, learned: Learned, name: str
) -> None:
    """One line; nothing while all is well, nor for one odd sighting."""
    says, seen = HINTS[name]
    assert Catcher(arm, learned).hint is None
    hint = _shown(arm, learned, seen).hint
    assert hint is not None
    assert says in hint
    assert "\n" not in hint

    def once(t: float) -> mitt.Sighting | None:
        good = mitt.Sighting(t=t, found=True, r_o=_ball(t), covariance=1e-6 * np.eye(3))
        return seen(t) if abs(t - 3.995) < 1e-9 else good

    assert _shown(arm, learned, once).hint is None
