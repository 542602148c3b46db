"""Tasks as Gymnasium environments: ``mitt/Catch-v0``, ``mitt/CatchPixels-v0``.

Parts on a belt, or in a hand, are met in ``mitt/Meet-v0``, and balls hit back in ``mitt/Bat-v0``,
with keywords of their own: :class:`MeetEnv`, :class:`BatEnv`.

    import gymnasium, mitt.gym
    env = gymnasium.make("mitt/Catch-v0", scene="lab", action="residual", map="MAP.json")

| keyword  | what                                                                                |
|----------|-------------------------------------------------------------------------------------|
| `arm`    | an arm as of ``mitt.load_arm``, its name or file; it needs a hand                   |
| `limits` | its limit set; its own if left out, ``paper`` for the WAM                           |
| `scene`  | the world: a ``Scene``, the name or the file of one                                 |
| `action` | `torque`: of each joint as a share of its largest, and the closing of the hand;     |
|          | `residual`: torque on top of what the catcher with the map commands                 |
| `map`    | for `residual` and :func:`map_policy`: a learned map or its file; learned if needed |
| `ticks`  | milliseconds that an action lasts                                                   |
| `width`, | of a picture [px]                                                                   |
| `height` |                                                                                     |

docs/gym.md says what is observed and rewarded.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, final

import numpy as np

from mitt.core import checks
from mitt.core.errors import MissingPackageError

try:
    import gymnasium
    from gymnasium import spaces
except ImportError:
    raise MissingPackageError("mitt.gym", "gymnasium", "gym") from None

from mitt.core.arm.arm import Arm
from mitt.core.arm.tools import TOOLS
from mitt.core.catcher.catcher import Catcher
from mitt.core.catcher.generators import Direct
from mitt.core.catcher.given import check_arm
from mitt.core.catcher.meeting import Meeting
from mitt.core.catcher.settings import Phase
from mitt.core.map.learn import Learned
from mitt.core.map.map_design import default_design
from mitt.core.map.mapping import DirectMap, unlearned
from mitt.core.map.neighbourhood import learn
from mitt.core.signals import Array, Frame, Senses
from mitt.gym.environment import TOUCH, Component, Environment
from mitt.gym.evaluation import PolicyReturns, evaluate
from mitt.gym.policies import map_policy
from mitt.io.arm_file import arm_with_hand
from mitt.io.maps import read_map
from mitt.lab.trials.bat_station import TARGET, BatStation, bat_station
from mitt.lab.trials.landing import batted, hit_of
from mitt.lab.trials.runner import LONGEST, TrialRunner
from mitt.lab.trials.score import HELD_AFTER, trial_status, was_held
from mitt.lab.trials.source import Source, source_of, widened
from mitt.lab.trials.station import PARTS_SCENE, TARGETS, station
from mitt.lab.world.scene import Scene, scene_from
from mitt.lab.world.simulation import World
from mitt.lab.world.throws import fly
from mitt.robot.cell.feeds import Parts

__all__ = [
    "BatEnv",
    "CatchEnv",
    "CatchPixelsEnv",
    "Component",
    "Environment",
    "PolicyReturns",
    "MeetEnv",
    "evaluate",
    "map_policy",
]

#: What a second costs for each m/s of difference in velocity to a part that is to be met; time
#: after which a part has not been taken [s].
_SLIP = 0.5
_LATE = 10.0
#: Landing error at which the reward is half of its largest [m]; for how long the path of a ball
#: is known, and the time between two of its places [s].
_HALF = 0.25
_FLIES = 2.0
_STRIDE = 0.01
#: Balls whose way is in view, and for how long before they pass [s]; how far along a belt, or about
#: a hand, it goes [m].
_BALLS = 12
_COMING = 0.15
_ALONG = 0.4


class _Catching(Environment):
    """What both environments of catching share."""

    good = "caught"
    _judged_by_world = True

    def __init__(
        self,
        *,
        render_mode: str | None = None,
        arm: Arm | str | Path = "wam",
        limits: str | None = None,
        scene: Scene | str | Path | None = None,
        action: Literal["torque", "residual"] = "torque",
        map: DirectMap | Learned | str | Path | None = None,  # noqa: A002 (its name outside)
        ticks: int = 5,
        width: int = 480,
        height: int = 360,
    ) -> None:
        """Build the world; arguments as of :mod:`mitt.gym`."""
        self._set_up(render_mode, scene_from(scene), action, ticks, (width, height))
        limits = None if limits is None else checks.text("limits", limits)
        self.arm, said = (arm, None) if isinstance(arm, Arm) else arm_with_hand(arm, limits=limits)
        self._design = default_design(self.arm)
        source = source_of(
            self.arm, seed=0, count=1, drag=self.scene.ball.drag, spinning=self.scene.ball.spinning
        )
        if said is not None and said.throws is not None:
            source = widened(source, said.throws)
        self._source = source
        self._map = self._checked(map)
        f = None if action == "torque" else self.map
        base = f or unlearned(self.arm, self._design)
        self._runner = TrialRunner(self.arm, Direct(base), self.scene, pixels=self.pixels)
        hand, self._catcher = self.arm.model.hand, self._runner.catcher()
        self._take(self.arm, self._runner.world, 1.2 * (1.0 if hand is None else hand.closed))

    @property
    def map(self) -> DirectMap:
        """The map; learned now if it was not given, which takes some seconds."""
        if self._map is None:
            self._map = learn(self.arm, design=self._design).map
        return self._map

    def _checked(self, given: object) -> DirectMap | None:
        """Return the map that was given, for this arm; None where it is still to be learned."""
        if isinstance(given, str | Path):
            given = read_map(checks.path("map", given), self.arm)
        given = given.map if isinstance(given, Learned) else given
        if given is None:
            return None
        f = checks.instance("map", given, DirectMap)
        check_arm(self.arm, f)
        return f

    def _come(self) -> None:
        """Throw another ball."""
        ball = self._source.drawn(self.np_random)
        self._catcher = self._runner.release(ball, seed=int(self.np_random.integers(2**62)))
        self.images = np.zeros((2, *self.shape()), np.uint8)
        for frame in self._runner.views[-1] if self._runner.views else ():
            self.images[frame.camera] = frame.pixels

    def fresh_catcher(self) -> Catcher:
        """Return a catcher of the map that has seen nothing yet."""
        runner = TrialRunner(self.arm, Direct(self.map), self.scene, pixels=self.pixels)
        return runner.catcher()

    @property
    def views(self) -> list[tuple[Frame, ...]]:
        """Looks at the scene before the throw; none without images."""
        return self._runner.views

    def _sensed(self, k: int) -> Senses | None:
        """Return what is sensed in tick ``k`` of an action, and keep the newest images."""
        senses = super()._sensed(k)
        for frame in () if senses is None else senses.frames:
            self.images[frame.camera] = frame.pixels
        return senses

    def _over(self) -> bool:
        """Say whether the ball is held, or can be touched no more."""
        return self.world.over(longest=LONGEST, held=HELD_AFTER)

    def _late(self, *, over: bool) -> bool:
        """Say whether no ball came to the hand in time."""
        return over and self.world.first_contact is None and self.world.t >= LONGEST

    def _away(self) -> float:
        """Return how far the ball is from the catch point [m]."""
        gap = self.thing()[0] - self.world.catch_point
        return float(np.sqrt(gap @ gap))

    def _in_view(self) -> Array:
        """Return where some balls are shortly before they pass the ready hand [m]."""
        return _coming(self._source, self.arm, self.scene)

    def _outcome(self) -> dict[str, Any]:
        """Return what became of the throw."""
        phase = self._catcher.phase if self.residual else Phase.WATCH
        refused, held = self.residual and self._catcher.refused, was_held(self.arm, self.world)
        return {"status": trial_status(self.world, phase, refused=refused, was_held=held)}

    def _success(self, info: dict[str, Any]) -> float:
        """Return 1 for a ball that is held."""
        return float(info["status"] == "caught")

    def shape(self) -> tuple[int, int]:
        """Return the size of the images; none where there are none."""
        camera = self._runner.rig.cameras[0]
        return (camera.height, camera.width) if self.pixels else (0, 0)


@final
class CatchEnv(_Catching):
    """``mitt/Catch-v0``: joints, and the true position and velocity of the ball."""


@final
class CatchPixelsEnv(_Catching):
    """``mitt/CatchPixels-v0``: joints, and the newest image of each of two cameras."""

    pixels = True

    def _space(self) -> spaces.Space[Any]:
        """Return boxes: ``joints`` and ``images``."""
        high, shape = self._high[:-6].astype(np.float32), (2, *self.shape())
        return spaces.Dict(
            {
                "joints": spaces.Box(-high, high, dtype=np.float32),
                "images": spaces.Box(0, 255, shape, np.uint8),
            }
        )

    def _observed(self) -> dict[str, Any]:
        """Return joints and images."""
        return {"joints": self.joints(), "images": self.images.copy()}


@final
class MeetEnv(Environment):
    """``mitt/Meet-v0``: joints, and the true position and velocity of a part that comes by."""

    thing_is = "part"
    good = "met"

    def __init__(
        self,
        *,
        render_mode: str | None = None,
        arm: str | Path = "ur5e",
        tip: str | None = None,
        joints: Sequence[str] | None = None,
        limits: str | None = None,
        tool: Literal["suction", "jaw"] = "suction",
        target: Literal["belt", "hand"] = "belt",
        speed: float = 0.3,
        gripper_delay: float = 0.05,
        scene: Scene | str | Path | None = None,
        action: Literal["torque", "residual"] = "torque",
        ticks: int = 5,
        width: int = 480,
        height: int = 360,
    ) -> None:
        """Build the station and its world.

        Args:
            render_mode: As of Gymnasium.
            arm: Name or file of an arm.
            tip: Frame of a description file at which the tool is mounted.
            joints: Joints of the file that move.
            limits: Its limit set; its own if left out.
            tool: What takes the part.
            target: What moves it.
            speed: Mean speed of the belt, or largest of the hand [m/s].
            gripper_delay: From the command until the tool acts [s].
            scene: The world; if left out ``lab`` as ``mitt meet`` has it, with a camera whose view
                arm and tool can block, and the belt's encoder.
            action: As of :mod:`mitt.gym`.
            ticks: Milliseconds that an action lasts.
            width: Of a picture [px].
            height: Of a picture [px].
        """
        checks.one_of("tool", tool, tuple(TOOLS))
        checks.one_of("target", target, TARGETS)
        delay = checks.number("gripper_delay", gripper_delay, least=0.0, most=2.0)
        self._speed = checks.number("speed", speed, least=0.01, most=5.0)
        limits = None if limits is None else checks.text("limits", limits)
        scene = PARTS_SCENE if scene is None else scene_from(scene)
        self._set_up(render_mode, scene, action, ticks, (width, height))
        at = station(
            checks.path("arm", arm),
            replace(TOOLS[tool], delay=delay),
            target,
            scene,
            tip=tip,
            joints=joints,
            limits=limits,
        )
        self._at, self.scene = at, at.scene
        self._take(at.arm, World(at.scene, at.arm.model, limits=at.arm.limits), TOOLS[tool].closed)
        self._catcher, self._parts = self.fresh_catcher(), self._drawn_parts(0)

    def fresh_catcher(self) -> Catcher:
        """Return a catcher that meets parts by the map."""
        return Catcher(
            self.arm, Meeting(self._at.map, self._at.settings), settings=self._at.catcher
        )

    def _drawn_parts(self, seed: int) -> Parts:
        """Return what brings a part."""
        put = tuple(self._at.place.tolist())
        return Parts(self._at, speed=self._speed, seed=seed, count=1, put=put)

    def _closing(self, given: float) -> float:
        """Return how far the tool is told to close: nothing up to the middle of its action."""
        return float(max(given, 0.0) * self._closed)

    def _come(self) -> None:
        """Bring another part."""
        self._parts = self._drawn_parts(int(self.np_random.integers(2**31)))
        self.world.reset(self._parts.bring(0), self._parts.seed(0))
        self._catcher = self.fresh_catcher()

    def _over(self) -> bool:
        """Say whether the part was met, or has gone by."""
        parts, world = self._parts, self.world
        return parts.over(world, world.truth(), ready=True) or parts.held

    def _late(self, *, over: bool) -> bool:
        """Say whether the part was not taken in time."""
        return not over and self.world.t >= _LATE

    def _away(self) -> float:
        """Return how far the part is from the tool [m]."""
        return float(np.linalg.norm(self.thing()[0] - self.world.catch_point))

    def _cost(self, tau: Array) -> float:
        """Return what a second costs now; also for the difference of tool and part in velocity."""
        q, dq = self.world.data.qpos[: self.arm.n], self.world.data.qvel[: self.arm.n]
        slip = float(np.linalg.norm(self.thing()[1] - self.arm.jacobian(q) @ dq))
        return super()._cost(tau) + _SLIP * min(slip, 2.0)

    def _in_view(self) -> Array:
        """Return about where the part comes by [m]."""
        around = np.concatenate([np.eye(3), -np.eye(3)]) * (_ALONG, _ALONG, 0.0)
        return np.array(self._at.place + around)

    def _outcome(self) -> dict[str, Any]:
        """Return what became of the part."""
        if self._catcher.phase is Phase.STOPPED:
            return {"status": "stopped"}
        return {"status": self._parts.ended(self.world)["status"]}

    def _success(self, info: dict[str, Any]) -> float:
        """Return 1 for a part that was met."""
        return float(info["status"] == "met")


@final
class BatEnv(Environment):
    """``mitt/Bat-v0``: joints, and the true position and velocity of a ball to be hit back."""

    good = "returned"
    _hand_acts = False

    def __init__(
        self,
        *,
        render_mode: str | None = None,
        arm: str | Path = "wam",
        limits: str | None = None,
        target: tuple[float, float, float] = TARGET,
        action: Literal["torque", "residual"] = "torque",
        ticks: int = 5,
        scene: Scene | str | Path | None = None,
        width: int = 480,
        height: int = 360,
    ) -> None:
        """Build the arm, its paddle and their world.

        Args:
            render_mode: As of Gymnasium.
            arm: Name of an arm that has a stance, or an arm file of one.
            limits: Its limit set; its own if left out.
            target: Where balls are to go [m].
            action: As of :mod:`mitt.gym`.
            ticks: Milliseconds that an action lasts.
            scene: The world; ``lab`` if left out.
            width: Of a picture [px].
            height: Of a picture [px].
        """
        self._set_up(render_mode, scene_from(scene), action, ticks, (width, height))
        self._name, self._learned = checks.path("arm", arm), action == "residual"
        self._limits = None if limits is None else checks.text("limits", limits)
        self._target = checks.vector("target", target, 3, finite=True)
        self._at = self._station()
        at = self._at
        self._take(at.arm, World(at.scene, at.arm.model, limits=at.arm.limits), 1.0)
        self._source = source_of(
            at.arm, seed=0, count=1, drag=self.scene.ball.drag, spinning=self.scene.ball.spinning
        )
        self._times = np.arange(0.0, _FLIES, _STRIDE)
        self._path = np.zeros((len(self._times), 3))
        self._catcher = Catcher(at.arm, at.batting, settings=at.catcher)

    def _station(self) -> BatStation:
        """Return the arm where it bats."""
        return bat_station(
            self._name,
            scene=self.scene,
            target=self._target,
            limits=self._limits,
            learns=self._learned,
        )

    def fresh_catcher(self) -> Catcher:
        """Return a catcher that strikes by the map, which is learned if it was not yet."""
        if not self._learned:
            self._learned = True
            self._at = self._station()
        return Catcher(self.arm, self._at.batting, settings=self._at.catcher)

    def _come(self) -> None:
        """Throw another ball."""
        ball = self._source.drawn(self.np_random)
        self.world.reset(ball, int(self.np_random.integers(2**31)))
        flight = self.world.flight
        self._path = np.array([flight(t)[0] for t in self._times.tolist()])
        if self.residual:
            self._catcher = self.fresh_catcher()

    def _over(self) -> bool:
        """Say whether nothing more can happen to the ball."""
        return batted(self.world, self._at.target)

    def _late(self, *, over: bool) -> bool:
        """Say whether no ball came to the paddle in time."""
        world = self.world
        happened = world.first_contact is not None or world.truth().ball_on_floor
        return over and not (happened or world.diverged)

    def _touch_gain(self) -> float:
        """Return the reward of the first touch, however fast, in the action that brings it."""
        return 0.0 if self._first_touch() is None else TOUCH

    def _away(self) -> float:
        """Return how far the paddle is from where the ball will pass [m]; 0 after the contact."""
        ahead = self._path[self._times >= self.world.t]
        if self.world.first_contact is not None or not len(ahead):
            return 0.0
        return float(np.linalg.norm(ahead - self.world.catch_point, axis=1).min())

    def _in_view(self) -> Array:
        """Return where some balls are shortly before they pass the ready paddle [m]."""
        return _coming(self._source, self.arm, self.scene)

    def _outcome(self) -> dict[str, Any]:
        """Return what became of the ball."""
        hit = hit_of(self.arm, self.world, self._at.target)
        if self.world.diverged:
            return {"status": "aborted"}
        if self.residual and self._catcher.phase is Phase.STOPPED:
            return {"status": "stopped"}
        if hit is None:
            return {"status": "missed"}
        landing = {} if hit.landing is None else {"landing_m": hit.landing}
        return {
            "status": "returned" if hit.returned else "wide",
            **landing,
            "return_speed_m_s": hit.speed,
        }

    def _success(self, info: dict[str, Any]) -> float:
        """Return the more the nearer to the target a ball lands, 1 at the target."""
        return 1.0 / (1.0 + info["landing_m"] / _HALF) if "landing_m" in info else 0.0


def _coming(source: Source, arm: Arm, scene: Scene) -> Array:
    """Return where balls are shortly before they pass the hand of a ready arm [m], (k, 3)."""
    rng, hand = np.random.default_rng(0), arm.position(arm.model.q_ready)
    times, points = np.arange(0.0, _FLIES, _STRIDE), list[Array]()
    for ball in [source.drawn(rng) for _ in range(_BALLS)]:
        path = np.array([fly(ball.r, ball.dr, drag=scene.ball.drag, duration=t)[0] for t in times])
        nearest = int(np.argmin(np.linalg.norm(path - hand, axis=1)))
        points += [*path[max(nearest - round(_COMING / _STRIDE), 0) : nearest + 1]]
    return np.array(points)


gymnasium.register(id="mitt/Catch-v0", entry_point="mitt.gym:CatchEnv")
gymnasium.register(id="mitt/CatchPixels-v0", entry_point="mitt.gym:CatchPixelsEnv")
gymnasium.register(id="mitt/Meet-v0", entry_point="mitt.gym:MeetEnv")
gymnasium.register(id="mitt/Bat-v0", entry_point="mitt.gym:BatEnv")
