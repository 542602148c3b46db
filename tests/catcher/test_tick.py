"""The compiled tick: equal to the stages one by one, in one piece or in two, without allocation."""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
import pytest
from numba import njit
from numba.core.runtime import _nrt_python as nrt
from numba.core.runtime import rtsys
from stages import Tracker
from support import thorough

from mitt.core.arm.arm import Arm
from mitt.core.ball.filter import BallFilter
from mitt.core.catcher.catcher import CatcherSettings, Phase
from mitt.core.catcher.generators import Direct, Generator, Unoptimised
from mitt.core.catcher.tick import BESIDE, TOUCHED, tick
from mitt.core.control.closing import LONGEST_INSIDE, close, fingers_of
from mitt.core.control.easing import ease, easing_time
from mitt.core.control.encoders import (
    Encoders,
    Reading,
    estimate_joints,
    monitor_of,
    predict_acceleration,
)
from mitt.core.control.envelope import bounds_of
from mitt.core.control.health import State
from mitt.core.control.stop import Brake, mass_work, plan_brake
from mitt.core.eyes.camera import fixed_rig
from mitt.core.eyes.eyes import Eyes, EyesConfig
from mitt.core.map.mapping import DirectMap
from mitt.core.map.neighbourhood import learn
from mitt.core.signals import (
    TICK,
    ArmState,
    Array,
    BallState,
    Command,
    JointReference,
    MapStatus,
    Senses,
)
from mitt.core.verdict.feasibility import Verdict
from mitt.lab.trials.catcher_settings import filter_settings
from mitt.lab.trials.runner import TrialRunner
from mitt.lab.trials.source import aim_of
from mitt.lab.world.flights import BallPath, builtin_flights, place_flight
from mitt.lab.world.scene import TABLE_TENNIS, Ball, Scene
from mitt.lab.world.throws import Throw, default_throw

#: Agreement of the compiled tick with its stages.
SAME = 1e-11
#: That of accelerations and torques: what is eased in 10 ms multiplies the rounding of an angle.
SAME_DDQ = 1e-8
#: Longest trial [s].
LONGEST = 1.2


@pytest.fixture(scope="module")
def taught(arm: Arm) -> DirectMap:
    """The map that ``mitt catch`` learns, bounces included."""
    return learn(arm).map


@pytest.fixture(scope="module")
def throws(arm: Arm) -> list[Throw]:
    """Some default throws."""
    rng = np.random.default_rng(23)
    return [default_throw(rng, aim_of(arm)) for _ in range(3)]


@dataclass
class Notes:
    """What a generator that is watched was last asked to be."""

    now: Generator
    waiting: bool = False


@dataclass(frozen=True)
class Watched:
    """A generator that notes what becomes of it, and may hide that it is a map."""

    inner: Generator
    notes: Notes
    hidden: bool = False
    asked: list[float] = field(default_factory=list)

    def sharpness(self, ball: BallState) -> float:
        """Pass on."""
        return self.inner.sharpness(ball)

    def verdict(self, ball: BallState, q: Array) -> Verdict:
        """Pass on."""
        return self.inner.verdict(ball, q)

    def unsettled(self, ball: BallState, q: Array) -> bool:
        """Pass on."""
        return self.inner.unsettled(ball, q)

    def returns(self, ball: BallState) -> bool:
        """Pass on; the ball itself is followed from then on."""
        said = self.inner.returns(ball)
        self.notes.waiting = not said
        return said

    def waiting(self, ball: BallState) -> BallState:
        """Pass on; a surrogate target is followed from now on."""
        self.notes.waiting = True
        return self.inner.waiting(ball)

    def adapt(self, ball: BallState, q: Array, dq: Array) -> Self:
        """Pass on and note the result."""
        self.notes.now = self.inner.adapt(ball, q, dq)
        return replace(self, inner=self.notes.now)

    def reference(self, ball: BallState) -> JointReference:
        """Pass on."""
        self.asked.append(ball.t)
        return self.inner.reference(ball)

    def as_map(self) -> DirectMap | None:
        """Hand the map over, or hide it."""
        return None if self.hidden else self.inner.as_map()


class Joints:
    """The estimate of the joints, by the monitor as an object."""

    def __init__(self, arm: Arm) -> None:
        """Start with nothing read."""
        self.monitor, self.work = monitor_of(arm, Encoders()), mass_work(arm)
        self.estimated = np.array([arm.q_ready, np.zeros(arm.n)])
        self.monitor.bounds[:] = bounds_of(arm)

    def read(self, senses: Senses, estimated: Array, impact_dq: Array) -> ArmState:
        """Return the joints as the catcher estimates them, which has to be the monitor's estimate.

        The stages go on from the catcher's own: feedback makes 6,400 of each rounding.
        """
        read = np.array([senses.arm.q, senses.arm.dq])
        when = Reading(TICK, TICK, 0.0)
        estimate_joints(self.monitor, read, False, impact_dq, when, self.estimated)
        assert np.allclose(self.estimated, estimated, rtol=SAME, atol=SAME)
        self.estimated[:] = estimated
        return ArmState(t=senses.t, q=estimated[0].copy(), dq=estimated[1].copy())

    def after(self, arm: Arm, command: Command) -> None:
        """Note what was commanded, and what acceleration it brings."""
        self.monitor.bounds[:] = bounds_of(arm)
        predict_acceleration(self.monitor, arm.tables, self.estimated, command.tau, self.work)


class Staged:
    """The stages one by one, as objects; which phase it is, and which map, it is told."""

    def __init__(self, arm: Arm, settings: CatcherSettings, notes: Notes) -> None:
        """Set the stages up."""
        self.arm, self.settings, self.notes = arm, settings, notes
        self.eyes = Eyes(fixed_rig(), EyesConfig(ball_radius=settings.ball_radius))
        self.track = BallFilter(settings.flight)
        s = settings
        self.fingers = fingers_of(arm.model.hand, s.ball_radius, s.ball_restitution).copy()[0]
        self.tracker = Tracker(arm, bandwidth=settings.bandwidth, load=settings.ball_mass)
        self.joints = Joints(arm)
        self.wanted = np.array([arm.q_ready, np.zeros(arm.n), np.zeros(arm.n)])
        self.brake: Brake | None = None
        self.command: Command | None = None
        self.t_last, self.beside, self.impact_dq = 0.0, False, np.zeros(arm.n)
        self.lagged = False

    def step(
        self, senses: Senses, phase: Phase, estimated: Array
    ) -> tuple[Command, JointReference | None]:
        """Make one tick; what the catcher believes of the joints is held to the monitor."""
        reference, time = None, np.inf
        arm = self.joints.read(senses, estimated, self.impact_dq)
        if phase is not Phase.BRAKE:
            self._guide(senses)
            seen = (self.eyes.step(senses.frames),) if senses.frames else senses.points
            for sighting in seen:
                P = sighting.covariance
                wide = P + TOUCHED**2 * np.eye(3) if self.beside and senses.frames else P
                self.track.update(replace(sighting, covariance=wide))
        if phase is Phase.FOLLOW:
            ball = self.track.state(senses.t)
            ball = self.notes.now.waiting(ball) if self.notes.waiting else ball
            reference = self.notes.now.reference(ball)
            lags, before = self._lags(reference, estimated), self.lagged
            self.lagged = lags
            if reference.status is MapStatus.INSIDE:
                time = reference.time_to_catch
            if lags and not before:
                q, dq, ddq = self.tracker.safety_filter.last
                self.wanted = np.array([q + TICK * (dq + 0.5 * TICK * ddq), dq + TICK * ddq, ddq])
            else:
                asked = np.array([self.wanted[0], np.zeros(self.arm.n), np.zeros(self.arm.n)])
                if reference.status is MapStatus.INSIDE:
                    asked = np.array([reference.q_d, reference.dq_d, reference.ddq_d])
                ease(self.wanted, asked, senses.t - self.t_last, easing_time(time))
        elif phase is Phase.BRAKE:
            self.wanted = self._braking().at(senses.t)
        self.beside = time < BESIDE
        command = self.tracker.step(arm, self.wanted, hand=0.0).command
        self.command = command._replace(hand=self._closing(senses.t, time, command))
        self.joints.after(self.tracker.arm, self.command)
        self.t_last = senses.t
        return self.command, reference

    def _lags(self, reference: JointReference, estimated: Array) -> bool:
        """Say whether the reference has left the arm behind: such a tick goes on as the last."""
        s = self.settings
        if reference.status is not MapStatus.INSIDE or reference.time_to_catch < s.adapt_until:
            return False
        apart = np.abs(np.array([reference.q_d, reference.dq_d]) - estimated).max(axis=1)
        return bool(apart[0] >= s.adapt_q or apart[1] >= s.adapt_dq)

    def _closing(self, t: float, time: float, command: Command) -> float:
        """Return the closing angle."""
        if np.isinf(time):
            return float(close(self.fingers, t, time, np.zeros((2, 3)), np.zeros(3), 0.0))
        ball, q, dq = self.track.state(t), command.q, command.dq
        gap = np.array([ball.r_o - self.arm.position(q), ball.dr_o - self.arm.jacobian(q) @ dq])
        later = self.settings.torque_lead - TICK
        ahead = min(max(time, 0.0), LONGEST_INSIDE)
        palm = self.arm.orientation(q + ahead * dq)[:, 2]
        return float(close(self.fingers, t, time, gap, palm, later))

    def _guide(self, senses: Senses) -> None:
        """Tell the eyes what the estimate of the tick before says of the ball."""
        if not senses.frames:
            return
        ball = self.track.state(self.t_last)
        t = max(frame.t for frame in senses.frames)
        self.eyes.guide(ball, t, alone=not self.beside)

    def keep_below(self, speeds: Array) -> None:
        """Take the speeds below which the catcher keeps the joints, as its verdict says."""
        self.tracker.safety_filter.bounds["dq_max"] = speeds

    def _braking(self) -> Brake:
        """Return the brake, planned from the last command when it is first asked for."""
        if self.brake is None:
            assert self.command is not None
            last = np.array([self.command.q, self.command.dq, self.command.ddq])
            loaded = self.arm.holding(self.settings.ball_mass)
            self.brake = plan_brake(loaded, self.t_last, last)
            last = self.tracker.safety_filter.last
            self.tracker = Tracker(loaded, bandwidth=self.settings.bandwidth)
            self.tracker.safety_filter.begin(last[0], last[1])
        return self.brake


def compare(
    arm: Arm,
    generator: Generator,
    ball: Throw | BallPath,
    *,
    pixels: bool,
    kind: Ball | None = None,
) -> set[Phase]:
    """Hold a trial's ticks to the stages; return the phases that it went through."""
    scene = Scene(ball=kind or Ball())
    notes, b = Notes(generator), scene.ball
    runner = TrialRunner(arm, Watched(generator, notes), scene, pixels=pixels)
    settings = CatcherSettings(
        ball_mass=b.mass, ball_radius=b.radius, flight=filter_settings(b.drag, b.mass)
    )
    catcher, staged = runner.catcher(), Staged(arm, settings, notes)
    phases: set[Phase] = set()
    runner.world.reset(ball, 5)
    while runner.world.t < LONGEST:
        senses, phase = runner.world.sense(look=catcher.looking), catcher.phase
        if phase is Phase.STOPPED:  # the stages have no monitor that could stop them
            break
        if phase is Phase.FOLLOW:
            staged.keep_below(catcher.state.safety.bounds["dq_max"])
        sent = catcher.step(senses)
        staged.impact_dq = catcher.state.impact_dq
        command, reference = staged.step(senses, phase, catcher.estimated)
        made = catcher.tick
        assert made is not None
        if made.state is State.ABORT:
            break
        differ(sent, command, made.reference, reference)
        runner.world.apply(sent)
        catcher.think()
        phases.add(phase)
    return phases


def differ(
    sent: Command, command: Command, made: JointReference | None, reference: JointReference | None
) -> None:
    """Refuse a tick that is not that of the stages."""
    for name in ("q", "dq", "ddq", "tau", "hand", "t"):
        ours, theirs = (np.asarray(getattr(x, name)) for x in (sent, command))
        same = SAME_DDQ if name in {"ddq", "tau"} else SAME
        assert np.all(np.abs(ours - theirs) <= same * np.maximum(np.abs(theirs), 1.0)), name
    assert (made is None) == (reference is None)
    if made is not None and reference is not None and reference.status is MapStatus.INSIDE:
        for name in ("q_d", "dq_d", "ddq_d", "q_o", "dq_o", "time_to_catch"):
            ours, theirs = (np.nan_to_num(getattr(x, name)) for x in (made, reference))
            assert np.all(np.abs(ours - theirs) <= SAME * np.maximum(np.abs(theirs), 1.0)), name


@pytest.mark.parametrize("kind", [Direct, Unoptimised])
@pytest.mark.parametrize("pixels", thorough([False], [True]))
def test_the_tick_is_its_stages(
    arm: Arm,
    taught: DirectMap,
    throws: list[Throw],
    kind: Callable[[DirectMap], Generator],
    pixels: bool,
) -> None:
    """Whole trials, from images or points, from the first sight to rest: equal to 1e-12."""
    for throw in throws[: 1 if pixels else 2]:
        phases = compare(arm, kind(taught), throw, pixels=pixels)
        learned = {Phase.WATCH, Phase.FOLLOW, Phase.BRAKE}
        assert phases == learned or (kind is Unoptimised and phases == learned - {Phase.BRAKE})


@pytest.mark.parametrize("number", [0, 1, 2, 3])
def test_the_tick_is_its_stages_through_a_bounce(arm: Arm, taught: DirectMap, number: int) -> None:
    """Recorded flights, with open verdicts, bounces and maps adapted anew: equal to 1e-12."""
    rng = np.random.default_rng(2)
    path = place_flight(builtin_flights()[number], arm.position(taught.start), rng=rng)
    assert Phase.FOLLOW in compare(arm, Direct(taught), path, pixels=False, kind=TABLE_TENNIS)


@pytest.mark.parametrize("pixels", [True, False])
def test_two_halves_are_the_whole(
    arm: Arm, taught: DirectMap, throws: list[Throw], pixels: bool
) -> None:
    """A generator that hides its map is asked in between, and the trial is the same."""
    logs = []
    for hidden in (False, True):
        notes = Notes(Direct(taught))
        watched = Watched(Direct(taught), notes, hidden=hidden)
        runner = TrialRunner(arm, watched, Scene(), pixels=pixels)
        logs.append(runner.run(0, throws[0], seed=7, log=True).log)
        assert bool(watched.asked) == hidden
    assert logs[0] is not None
    assert logs[1] is not None
    assert np.allclose(logs[0].tau, logs[1].tau, rtol=0.0, atol=1e-9)
    assert np.allclose(logs[0].truth.qpos, logs[1].truth.qpos, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("early", [True, False])
def test_thinking_late_is_thinking(
    arm: Arm, taught: DirectMap, throws: list[Throw], early: bool
) -> None:
    """A loop that never calls ``think`` gets the same commands: the next step does it first."""
    runner = TrialRunner(arm, Direct(taught), Scene(), pixels=False)
    catchers = [runner.catcher(), runner.catcher()]
    runner.world.reset(throws[1], 3)
    for _ in range(700):
        senses = runner.world.sense()
        sent = [catcher.step(senses) for catcher in catchers]
        assert np.array_equal(sent[0].tau, sent[1].tau)
        catchers[int(early)].think()
        runner.world.apply(sent[0])
    assert catchers[0].phase is Phase.BRAKE


@njit
def again(times, start, images, backgrounds, q, dq, brake, state, result):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN201
    """Make the same tick many times."""
    todo = 0
    for k in range(times):
        t = start + 0.001 * k
        seen, read = (images, backgrounds, 0, t - 0.001), (t, t, q, dq)
        todo |= tick(seen, read, brake, state, result)
    return todo


@pytest.mark.parametrize("until", [0.03, 0.2, 0.8])
def test_the_tick_allocates_nothing(
    arm: Arm, taught: DirectMap, throws: list[Throw], until: float
) -> None:
    """Watching, following, braking: memory is asked for no more often in 50 ticks than in one."""
    runner = TrialRunner(arm, Direct(taught), Scene(), pixels=True)
    catcher = runner.catcher()
    runner.world.reset(throws[0], 3)
    catcher.learn_background(runner.world.views_before(2))
    while runner.world.t < until:
        senses = runner.world.sense()
        runner.world.apply(catcher.step(senses))
        catcher.think()
    images = tuple(frame.pixels for frame in senses.frames)
    rest = (
        senses.t + 0.001,
        images,
        catcher.backgrounds,
        senses.arm.q,
        senses.arm.dq,
        catcher._planner.brake,
    )
    nrt.memsys_enable_stats()
    counts = []
    for times in (1, 1, 50):
        before = rtsys.get_allocation_stats()
        again(times, *rest, *deepcopy(catcher).kernel_arguments[1:])
        after = rtsys.get_allocation_stats()
        counts.append((after.alloc - before.alloc, after.mi_alloc - before.mi_alloc))
    assert counts[2] == counts[1]
