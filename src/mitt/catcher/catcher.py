"""The catcher: from images and encoders to torques and fingers, once a millisecond.

    Frame x2 -> Moments x2 -> Sighting -> BallState -> JointReference -> Command

``step`` makes a tick, one compiled call that knows the order of the stages
(:mod:`mitt.catcher.tick`).
``think`` comes after the command has left and does what is slow or rare: the verdict, adapting the
map, refining it where the generator does, planning the brake; it takes effect at the next tick.
The catcher takes senses and gives commands, so it does not know whether a simulated world or a real
arm is at the other end.
"""

from collections.abc import Sequence
from copy import copy, deepcopy
from typing import Any, final

import numpy as np

from mitt import checks
from mitt.ball.estimator import update
from mitt.catcher.result import (
    Result,
    ResultHandle,
    Tick,
    ball_in,
    fresh_result,
    result_handle,
    tick_of,
)
from mitt.catcher.settings import (
    BRAKE,
    FOLLOW,
    PHASES,
    REFUSED,
    STOPPED,
    WATCH,
    CatcherSettings,
    Phase,
)
from mitt.catcher.state import (
    Fields,
    State,
    StateHandle,
    arm_fields,
    begun_with,
    fresh_state,
    map_fields,
    state_handle,
)
from mitt.catcher.tick import DECIDE, GRASPS, LAGS, REVIEWS, STOPS, act, perceive, tick
from mitt.control.brake import plan_brake
from mitt.control.health import ENCODER_REASONS, is_lost
from mitt.control.monitor import doubted, good_again
from mitt.control.stopped import StoppedBy
from mitt.errors import InputError, ShapeError
from mitt.generator.feasibility import Outcome, Verdict, is_far, waiting_height
from mitt.generator.generators import Direct, Generator, Unoptimised
from mitt.generator.mapping import DirectMap
from mitt.generator.several import Several
from mitt.impact import CaughtBall, examined, speed_caps, speed_jumps
from mitt.robot.arm import Arm
from mitt.signals import (
    TICK,
    ArmState,
    Array,
    BallState,
    Command,
    Frame,
    Image,
    MapStatus,
    Senses,
    Sighting,
    command_of,
)
from mitt.vision.eyes import Eyes

__all__ = ["Catcher", "CatcherSettings", "Phase", "Tick"]

#: Speed below which a joint that brakes counts as at rest [rad/s].
_AT_REST = 1e-3
#: Time after which a ball that is far, or not seen, is looked at again for a verdict [s].
_LOOK_AGAIN = 0.02
#: Beside the bits of a tick: the map can be refined.
REFINES = 32
#: Attributes of a catcher that show its state and result, or scratch; not kept in a copy.
_SHOWN = frozenset(
    ("_scalars", "_out", "_clock", "_hand", "_brakes", "_command", "_handles", "_q", "_dq")
)


@final
class Catcher:
    """Lets an arm catch; one object a throw.

    Attributes:
        certificate: What the last online step says of the catch; None where none was made.
        stopped_by: Why the catcher has stopped, and what it knew then; None where it has not.
        t_0: Time at which the arm began to move [s]; infinite before.
        state: What the catcher knows and remembers, overwritten by the next tick.
        result: What the last tick brought about, overwritten by the next.
    """

    def __init__(
        self, arm: Arm, generator: Generator, eyes: Eyes, *, settings: CatcherSettings
    ) -> None:
        """Take the arm, the generator and the eyes, of which the catcher keeps a copy."""
        checks.instance("arm", arm, Arm)
        _check_generator(generator)
        checks.instance("eyes", eyes, Eyes)
        checks.instance("settings", settings, CatcherSettings)
        self._arm, self._settings, self._map = arm, settings, generator.as_map()
        self._turns = eyes.heads > 0
        self._caught = CaughtBall(
            mass=settings.ball_mass,
            radius=settings.ball_radius,
            restitution=settings.ball_restitution,
            friction=settings.ball_friction,
            doubt=settings.ball_doubt,
        )
        self._refines = isinstance(generator, Direct) and generator.online is not None
        # What is kept of the arm with the ball is worked out now, not in the middle of a catch.
        arm_fields(arm.holding(settings.ball_mass), settings.around)
        # Who else looks for sharpness elsewhere than at the catch of the map is asked at each tick.
        plain = isinstance(generator, Direct | Unoptimised)
        self._blank = fresh_state(
            arm, eyes, settings, self._map, several=isinstance(generator, Several),
            sigma_ready=settings.sigma_ready if plain else np.inf,
        )  # fmt: skip
        self.state: State
        self.result: Result
        self._begin(generator, copy(eyes))

    def __copy__(self) -> "Catcher":
        """Return a catcher that goes on from here on its own; the arm is shared."""
        return deepcopy(self, {id(self._arm): self._arm})

    def __getstate__(self) -> dict[str, Any]:
        """Return what makes the catcher, without what only shows parts of it."""
        return {name: value for name, value in vars(self).items() if name not in _SHOWN}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take what :meth:`__getstate__` returned, and show its parts again."""
        self.__dict__.update(state)
        self._show()

    def again(self, generator: Generator) -> "Catcher":
        """Return a catcher for another throw, as this one was when it was made.

        Args:
            generator: Of the same kind and with the same map, if any.

        Raises:
            InputError: It is of another.
        """
        f, mine = _check_generator(generator), self._map
        same = f is mine or (f is not None and mine is not None and f.equals(mine))
        if not same:
            raise InputError("generator", "one with the map of this catcher", "another")
        other, eyes = object.__new__(Catcher), copy(self._eyes)
        other.__dict__.update(self.__dict__)
        other._begin(generator, eyes)
        eyes.reset()
        return other

    def _begin(self, generator: Generator, eyes: Eyes) -> None:
        """Begin a throw with a state of its own."""
        self._generator, self._given, self._eyes = generator, generator, eyes
        self.state = begun_with(self._blank, eyes)
        self.result = fresh_result(self._arm.n, max(eyes.heads, 1))
        self._show()
        self._brake = np.zeros((1, 3, self._arm.n))
        self._phase, self._todo, self._ticked = WATCH, 0, False
        self._verdict: Verdict | None = None
        self._unasked: tuple[BallState, Array] | None = None
        self.certificate: Verdict | None = None
        self.stopped_by: StoppedBy | None = None
        self.t_0 = np.inf

    def _show(self) -> None:
        """Take what is often asked for."""
        self._q, self._dq = np.zeros((2, self._arm.n))
        self._scalars, self._out = self.state.scalars[0], self.result.scalars[0]
        out = self.result.scalars
        self._clock, self._hand, self._brakes = out["t"], out["hand"], out["brakes"]
        self._command = self.result.command[:4]
        self._handles = state_handle(self.state), result_handle(self.result)

    @property
    def estimated(self) -> Array:
        """Joint angles and speeds as the encoders' monitor estimates them, shape (2, n).

        [rad, rad/s]; overwritten by the next tick.
        """
        return self.state.estimated

    @property
    def phase(self) -> Phase:
        """What the catcher is about in the next tick."""
        return PHASES[self._phase]

    @property
    def braking(self) -> float:
        """Time that braking, or a motion of :meth:`move`, takes from its start to rest [s]."""
        return len(self._brake) * TICK

    @property
    def looking(self) -> bool:
        """Whether the catcher wants images; none once its hand has closed or it has stopped."""
        return self._phase not in (BRAKE, STOPPED)

    @property
    def verdict(self) -> Verdict | None:
        """Verdict on the throw, the newest; None before the first."""
        if self._unasked is not None:
            ball, q = self._unasked
            self._verdict, self._unasked = self._generator.verdict(ball, q), None
        return self._verdict

    @property
    def tick(self) -> Tick | None:
        """What the last tick brought about; None before the first."""
        return tick_of(self.result) if self._ticked else None

    def step(self, senses: Senses) -> Command:
        """See, estimate, generate, close, track: one tick.

        Raises:
            ShapeError: The encoders, or an image, have not the size of this arm or camera.
            InputError: Something else in ``senses`` is not what it should be. The tick is not
                made then, and the catcher is as it was before.
        """
        if senses.__class__ is not Senses:
            checks.instance("senses", senses, Senses)
        self._read(senses.arm)
        images, apart, t_exposed = self._eyes.arrange(senses.frames)
        if self._todo:
            self.think()
        t = senses.t
        if senses.points and self.looking:
            self._take(senses.points, t)
        q, dq, (state, out) = self._q, self._dq, self._handles
        if self._map is None:
            perceive(images, self.backgrounds, apart, t_exposed, t, q, dq, state, out)
            self._ask()
            self._todo = act(self._brake, state, out)
        else:
            self._todo = tick(
                images, self.backgrounds, apart, t_exposed, t, q, dq, self._brake, state, out
            )
        self._ticked = True
        if self._todo & STOPS:
            self._note_stop()
        t = self._clock.item()
        if self._phase == FOLLOW:
            self.t_0 = t if t < self.t_0 else self.t_0
            if self._refines and self._out["inside"]:
                self._todo |= REFINES
        gaze = self.result.gaze.copy() if self._turns else None
        return command_of(t, self._command.copy(), self._hand.item(), gaze, self._brakes.item())

    def _read(self, arm: ArmState) -> None:
        """Take the encoders over: compiled code sees buffers of one type and the right length."""
        q, dq, n = arm.q, arm.dq, self._arm.n
        if q.shape != (n,) or dq.shape != (n,):
            raise ShapeError("senses.arm.q, .dq", f"({n},)", q.shape if len(q) != n else dq.shape,
                             do=f"give the active joints {', '.join(self._arm.names)}")  # fmt: skip
        self._q[:], self._dq[:] = q, dq

    def learn_background(self, views: Sequence[tuple[Frame, ...]]) -> None:
        """Learn what the cameras see before the throw, as :meth:`Eyes.learn_background`."""
        self._eyes.learn_background(views)

    @property
    def backgrounds(self) -> tuple[Image, ...]:
        """What :func:`mitt.catcher.tick.tick` takes as backgrounds."""
        return self._eyes.backgrounds

    @property
    def parts(self) -> tuple[Array, StateHandle, ResultHandle] | None:
        """What :func:`mitt.catcher.tick.tick` takes after the senses, for a loop over ticks.

        Such a loop goes on without :meth:`think` where :func:`mitt.catcher.tick.undecided` says so.

        None for a generator that is no map or that is refined in each tick: those ask for
        :meth:`step`.
        """
        return None if self._map is None or self._refines else self.kernel_arguments

    @property
    def kernel_arguments(self) -> tuple[Array, StateHandle, ResultHandle]:
        """What the kernels of a tick take after the senses: the brake, the state, the result."""
        return self._brake, *self._handles

    def ticked(self, todo: int, since: float) -> None:
        """Take over after a loop over ticks of one phase.

        Args:
            todo: What the last tick left to be thought about.
            since: Time of the first tick [s].
        """
        todo, since = checks.whole("todo", todo, least=0), checks.number("since", since)
        self._todo, self._ticked = todo, True
        if todo & STOPS:
            self._note_stop()
        if self._phase == FOLLOW:
            self.t_0 = min(self.t_0, since)

    @property
    def deceleration(self) -> Array:
        """What each joint can be trusted to brake with [rad/s^2], shape (n,)."""
        brake: Array = self.state.bounds[3].copy()
        return brake

    def think(self) -> None:
        """Do what is slow or rare, to be used by the next tick; best after the command has left.

        Does nothing if there is nothing to think about or it has been done.
        """
        todo, self._todo = self._todo, 0
        if todo & STOPS:
            self._phase = STOPPED
        if todo == 0 or self._phase == STOPPED:
            return
        ball = ball_in(self.result)
        if self._phase == WATCH:
            self._watch(ball)
            return
        if todo & DECIDE:
            self._reconsider(ball)
        elif todo & LAGS:
            # The ball has left the arm behind, as after a bounce: the map starts again from where
            # the arm is and how fast it moves, eq. (12), and the gap is closed on the way to the
            # catch instead of by feedback at once.
            self._adapt(ball)
        elif todo & REFINES:
            self._refine(ball)
        elif todo & REVIEWS:
            self._review(ball)
        if todo & GRASPS:
            self._grasp()

    def _note_stop(self) -> None:
        """Note why the tick just made has stopped the arm."""
        tick, encoders = tick_of(self.result), self.result.encoders.copy()
        joints = doubted(self.state.encoder_memory)
        by_encoder = tick.reason in ENCODER_REASONS and len(joints) > 0
        self.stopped_by = StoppedBy(
            state=tick.state,
            reason=tick.reason,
            joint=self._arm.names[joints[0]] if by_encoder else None,
            t=self._clock.item(),
            q=self.estimated[0].copy(),
            dq=self.estimated[1].copy(),
            q_read=encoders[0],
            dq_read=encoders[1],
            command=self._command.copy(),
            brakes=self._brakes.item(),
        )

    def stop(self) -> None:
        """Stop with the next tick, within all limits, and stay until :meth:`recover`."""
        self._scalars["stop_requested"] = True

    def move(self, motion: Array) -> None:
        """Move the waiting or braked arm along a motion instead of catching, within all limits.

        The hand stays as it is. The way is over for good: a throw takes a fresh catcher.

        Args:
            motion: q, dq, ddq each tick from the last command on, the last row at rest, shape
                (k, 3, n) [rad ...].

        Raises:
            InputError: The arm was not commanded to rest by now, or the catcher has stopped.
        """
        motion = checks.array("motion", motion, (None, 3, self._arm.n), finite=True)
        at_rest = bool(np.all(np.abs(self.result.command[1]) < _AT_REST))
        if self._phase not in (WATCH, REFUSED, BRAKE) or not at_rest or not self._ticked:
            raise InputError("move", "a catcher that waits, its arm at rest", self.phase)
        self._brake = motion
        self._scalars["t_brake"] = self._clock.item()
        self._enter(BRAKE)

    def recover(self, *, checked: bool = False) -> None:
        """Release the brakes and watch for a ball again, from where the encoders say the arm is.

        Args:
            checked: Whether a person has checked the encoders that were in doubt. If not, each has
                to have read well for 50 ticks, near to where its joint was reckoned to be, and one
                that was stuck has to have moved.

        Raises:
            InputError: The catcher has not stopped, the arm is not at rest yet, or the encoder of a
                joint is still in doubt.
        """
        at_rest = bool(np.all(np.abs(self.result.command[1]) < _AT_REST))
        if self._phase != STOPPED or not at_rest:
            raise InputError("recover", "a catcher that has stopped, its arm at rest", self.phase)
        good = good_again(self.state.encoder_memory)
        if not checked and not np.all(good):
            pairs = zip(self._arm.names, good, strict=True)
            bad = ", ".join(name for name, fine in pairs if not fine)
            do = "check the encoder, then recover(checked=True)"
            raise InputError("recover", "encoders that read well", f"doubt about {bad}", do=do)
        self._eyes.reset()
        fresh = begun_with(self._blank, self._eyes)  # the hand opens, a ball drops
        fresh.estimated[:] = self.estimated
        nothing = fresh_result(self._arm.n, max(self._eyes.heads, 1))
        for old, new in ((self.state, fresh), (self.result, nothing)):
            for mine, value in zip(old, new, strict=True):
                mine[...] = value
        self._verdict, self._unasked, self.certificate, self.t_0 = None, None, None, np.inf
        self._generator, self._phase, self.stopped_by = self._given, WATCH, None

    def _write(self, fields: Fields) -> None:
        """Overwrite fields of the state."""
        for name, value in fields.items():
            getattr(self.state, name)[...] = value

    def _take(self, points: tuple[Sighting, ...], t: float) -> None:
        """Take in positions from another source than images; none from after ``t`` [s]."""
        s = self.state
        for point in points:
            if point.found and not point.t > t + TICK:
                update(
                    s.ball_memory,
                    point.t,
                    point.r_o,
                    point.covariance,
                    s.ball_settings,
                    s.ball_work,
                )

    def _ask(self) -> None:
        """Ask a generator that is no map for the desired motion."""
        if self._phase != FOLLOW:
            return
        ball = ball_in(self.result)
        ball = self._generator.waiting(ball) if self._scalars["surrogate"] else ball
        answer, out = self._generator.reference(ball), self._out
        motion = {"q_d": answer.q_d, "dq_d": answer.dq_d, "ddq_d": answer.ddq_d,
                  "q_o": answer.q_o, "dq_o": answer.dq_o}  # fmt: skip
        for row, (name, value) in zip(self.result.reference, motion.items(), strict=False):
            row[:] = checks.vector(f"reference.{name}", value, self._arm.n)
        out["inside"] = answer.status is MapStatus.INSIDE
        out["time_to_catch"] = answer.time_to_catch if out["inside"] else np.inf

    def _enter(self, phase: int) -> None:
        """Begin another phase with the next tick."""
        self._phase = phase
        self._scalars["phase"] = phase

    def _watch(self, ball: BallState) -> None:
        """Give the verdict once the ball is known well enough, or when it is due.

        A verdict is for good, so it waits until the ball is as near as it has to be for a start,
        and until a ball that has left the images is back in them.
        """
        if ball.t < self._scalars["t_look"]:
            return
        due = ball.t - ball.t_first >= self._settings.watch
        if not due and self._generator.sharpness(ball) > self._settings.sigma_ready:
            return
        if self._generator.unsettled(ball, self.estimated[0]):
            # What the verdict says besides is reckoned where somebody asks for it.
            self._unasked = ball, self.estimated[0].copy()
            return
        if self._is_out_of_sight() or is_far(ball, self._arm.position(self.estimated[0])):
            self._unasked = ball, self.estimated[0].copy()
            self._scalars["t_look"] = ball.t + _LOOK_AGAIN
            return
        verdict = self._generator.verdict(ball, self.estimated[0])
        if not isinstance(self._generator, Unoptimised):  # alpha = 0 is never refused
            bandwidth = self._settings.bandwidth
            verdict = examined(self._arm, verdict, self._caught, bandwidth=bandwidth)
        self._verdict, self._unasked = verdict, None
        if verdict.outcome is Outcome.UNSETTLED:
            return
        if verdict.outcome is Outcome.UNREACHABLE:
            if due:
                self._enter(REFUSED)
            return
        self._scalars["surrogate"] = verdict.outcome is Outcome.OPEN
        self._adapt(self._generator.waiting(ball) if self._scalars["surrogate"] else ball)
        self._make_room(verdict)
        self._enter(FOLLOW)

    def _is_out_of_sight(self) -> bool:
        """Say whether an arm that followed the ball would stop at once: it is not seen any more."""
        age, sigma = self._out["age"].item(), self._out["sigma"].item()
        return bool(is_lost(age, sigma, self._settings.tolerance))

    def _make_room(self, verdict: Verdict) -> None:
        """Keep the joints that the ball will drive on below their speed limits by as much.

        The motors' torque is kept to what is left of it at such speeds.
        """
        if verdict.approach is not None:
            given = self._arm, verdict.approach, self._caught
            self.state.bounds[2] = speed_caps(*given)
            self.state.jump[:] = speed_jumps(*given)

    def _reconsider(self, ball: BallState) -> None:
        """Follow the ball itself as soon as it can be caught; its stand-in until then."""
        if self._generator.returns(ball):
            self._scalars["surrogate"] = False
            self._adapt(ball)

    def _adapt(self, ball: BallState) -> None:
        """Let the generator start from where the arm is."""
        q, dq = self.estimated.copy()
        self._generator = self._generator.adapt(ball, q, dq)
        f = self._generator.as_map()
        if f is not None:
            self._write(map_fields(f))
            self._scalars["waiting_height"] = waiting_height(f)

    def _review(self, ball: BallState) -> None:
        """Follow another map where the present one cannot catch any more what it could at first."""
        hoped = self.verdict is not None and self.verdict.outcome is Outcome.FEASIBLE
        if hoped and isinstance(self._generator, Several) and self._generator.astray(ball):
            self._adapt(ball)

    def _refine(self, ball: BallState) -> None:
        """Let the generator make its map a little better for the rest of this flight."""
        if isinstance(self._generator, Direct):
            self._generator = refined = self._generator.refined(ball)
            self.state.alpha[:] = refined.map.alpha
            self.certificate = refined.certificate(ball)

    def _grasp(self) -> None:
        """Brake from the last command on: the fingers will have closed.

        The model carries the ball's weight from then on.
        """
        t = self._clock.item()
        loaded = self._arm.holding(self._settings.ball_mass)
        self._brake = plan_brake(loaded, t, self.result.command[:3].copy()).table(TICK)
        self._write(arm_fields(loaded, self._settings.around))
        self._scalars["t_brake"] = t
        self._enter(BRAKE)


def _check_generator(generator: Generator) -> DirectMap | None:
    """Return the map of a generator, if it is one; refuse what is no generator."""
    if not isinstance(generator, Generator):
        raise InputError("generator", "a generator", checks.shown(generator))
    return generator.as_map()
