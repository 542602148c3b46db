"""Where an arm bats: its paddle, the poses in which it waits and strikes, its map, and its balls.

Balls come at the height of a person's chest or head, before the arm: there a paddle can face the
thrower. The flights from which batting is learned are drawn where they end, as those of
:mod:`mitt.core.map.neighbourhood`: about a place, with a speed and a direction there, and flown
backwards. Each is struck at the instant within the settings' time about that place at which the
strike is easiest. All are believed slightly wrongly at t_0.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np

from mitt.core import checks
from mitt.core.arm.arm import Arm
from mitt.core.arm.tools import Paddle, inertia_share
from mitt.core.ball.flight import acceleration, advance
from mitt.core.catcher.batting import Batting, BattingSettings
from mitt.core.catcher.settings import CatcherSettings
from mitt.core.errors import InputError, ModelError, meant
from mitt.core.eyes.camera import Rig, fixed_rig, look_at
from mitt.core.map.batting import BattingMap, easiest, learn_batting, unlearned_batting
from mitt.core.map.demand import Tolerance
from mitt.core.map.learn import Flight, Learned, LearnSettings
from mitt.core.map.map_design import MapDesign
from mitt.core.map.neighbourhood import LEARNING_SEED, Neighbourhood
from mitt.core.map.striking import Impact, PaddleStrike
from mitt.core.signals import Array
from mitt.io.arm_file import arm_of_task, with_notes_logged
from mitt.lab.trials.catcher_settings import COMES, catcher_settings, rig_in
from mitt.lab.trials.source import ranges_of
from mitt.lab.world.build import TOUCH, restitution_on
from mitt.lab.world.flights import CATCH_FRACTION, RecordedFlight, place_flight, smooth
from mitt.lab.world.overlap import check_scene
from mitt.lab.world.scene import Scene
from mitt.lab.world.throws import ThrowRanges

#: How balls come to a paddle: those of the default throws that are aimed at a box before the arm.
STRUCK = Neighbourhood(
    flights=100,
    kicked=0.0,
    bounced=0.0,
    after=0.008,
    box=(0.05, 0.15, 0.1),
    arrival=(4.8, 6.9),
    descent=(0.3, 0.75),
    azimuth=(-0.12, 0.12),
    flight=(0.38, 0.55),
    t_0=(0.0, 0.0),
)
#: Draws for each flight that is wanted, at most.
_DRAWS = 10
#: Where balls are sent where nothing is said [m].
TARGET: Final = (3.0, 0.0, 0.3)
#: Where the cameras are and what they look at, from where balls are struck [m]: in view are all
#: default throws, and the returns as far as they tell their velocity.
_BACK = (-2.15, 1.7, 1.35)
_AHEAD = np.array([1.32, 0.0, 0.02])
#: Recorded flights are struck so long after their bounce [s], if so much of it is recorded, or
#: else so long before it; the arm then has so long for its motion.
_AFTER_BOUNCE = 0.3
_ENOUGH = 0.2
_BEFORE_BOUNCE = 0.1
_SOON = (0.2, 0.4)
#: Half-widths of the box that balls are aimed at [m].
_BOX = (0.05, 0.15, 0.1)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BatStation:
    """An arm where it bats.

    Attributes:
        arm: The arm with its paddle, in the pose in which it waits; its aim is where balls pass.
        batting: What moves it, learned.
        scene: The world.
        target: Where balls are sent [m], shape (3,); None for a shield.
        rig: The cameras.
    """

    arm: Arm
    batting: Batting
    scene: Scene
    target: Array | None
    rig: Rig

    @property
    def catcher(self) -> CatcherSettings:
        """Settings of its catcher; the ball is never in its hand."""
        of = catcher_settings(self.arm, self.scene)
        sigma = max(of.flight.lift_sigma, of.flight.push_sigma / COMES)
        return replace(of, ball_mass=0.0, flight=replace(of.flight, lift_sigma=sigma))

    def generator(self, known: BattingSettings) -> Batting:
        """Return what moves the arm, as it is believed that balls bounce off the paddle.

        It has planned nothing yet: plans are those of one ball.
        """
        return Batting(self.batting.map, known, self.batting.tolerance)


@dataclass(frozen=True, slots=True, kw_only=True)
class Stance:
    """How an arm stands to bat.

    Attributes:
        joints: Joints that move.
        middle: Pose of the middle strike [rad].
        ready: Pose in which it waits [rad].
        design: Of its map.
        held: Joints that aim, besides the free ones of the map.
        tolerance: Share of each limit at which a ball is refused.
    """

    joints: tuple[str, ...]
    middle: tuple[float, ...]
    ready: tuple[float, ...]
    design: MapDesign
    held: tuple[int, ...]
    tolerance: Tolerance = field(default_factory=Tolerance)


#: Stances by arm. Those of the others are the best of random poses that strike a ball of 5.7 m/s,
#: and balls around it, with the least share of their speeds; of a Panda, whose accelerations bind,
#: also of these and of its ranges. Asked for 1.45 of its speed, a joint of a Panda that had lagged
#: went beyond it for 4 ms; up to 1.4 none of 59 did.
_STANCES: Final = {
    "wam": Stance(
        joints=("j1", "j2", "j3", "j4"), middle=(0.0, 0.2, 0.0, 0.9), ready=(0.0, 0.4, 0.0, 0.75),
        design=MapDesign(catch_joint=3, free=(0, 1, 3), inward=6.0), held=(2,),
    ),
    "ur5e": Stance(
        joints=("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint",
                "wrist_2_joint", "wrist_3_joint"),
        middle=(-0.196, -0.977, 0.729, -0.324, 1.405, 0.0),
        ready=(-0.196, -0.977, 0.729, -0.324, 1.405, 0.0),
        design=MapDesign(catch_joint=2, free=(0, 1, 2), inward=6.0), held=(3, 4),
    ),
    "franka-panda": Stance(
        joints=tuple(f"panda_joint{k + 1}" for k in range(7)),
        middle=(1.662, 1.241, -2.146, -1.556, 2.272, 3.208, 0.0),
        ready=(1.694, 1.227, -2.056, -1.508, 2.261, 3.351, 0.0),
        design=MapDesign(catch_joint=3, free=(0, 2, 3), inward=6.0), held=(1, 4, 5),
        tolerance=Tolerance(speed=1.4),
    ),
}  # fmt: skip


def bat_station(
    name: str | Path,
    *,
    scene: Scene,
    target: Array | None,
    limits: str | None = None,
    around: Neighbourhood = STRUCK,
    learns: bool = True,
) -> BatStation:
    """Return the station of an arm.

    Args:
        name: Name of an arm whose stance is known, or an arm file of one.
        scene: The world.
        target: Where balls are sent [m], shape (3,); None for a shield.
        limits: Limit set; that of the arm if left out.
        around: How balls come, without the box, which is that of the arm.
        learns: Whether its map is learned; without, to check what was said.

    Raises:
        ModelError: No pose brings the paddle before the arm.
        InputError: The arm strikes too few of these balls.
    """
    ball = scene.ball
    touch = Paddle().touch if ball.material is None else TOUCH[ball.material]
    paddle = Paddle(half=ball.radius, touch=touch)
    raw, stance = arm_with_paddle(name, paddle, limits=limits)
    middle = np.array(stance.middle)
    place = raw.position(middle)
    model = replace(raw.model, q_ready=np.array(stance.ready), aim=np.array([place, _BOX]))
    arm = Arm(model, raw.limits)
    check_scene(arm, scene)
    settings = BattingSettings(
        target=None if target is None else (float(target[0]), float(target[1]), float(target[2])),
        impact=impact_of(scene, paddle),
    )
    g = unlearned_batting(arm, stance.design, stance.held, middle)
    if learns:
        g = learn_strikes(g, settings, place, around=replace(around, box=_BOX))[0]
    batting = Batting(map=g, settings=settings, tolerance=stance.tolerance)
    return BatStation(
        arm=arm, batting=batting, scene=scene, target=target, rig=rig_in(bat_rig(place), scene)
    )


def impact_of(scene: Scene, paddle: Paddle) -> Impact:
    """Return how ball and paddle part in a scene, before any ball: of one without spin."""
    ball, contact = scene.ball, scene.contact
    return Impact(
        mass=ball.mass,
        restitution=restitution_on(scene, paddle),
        fall=paddle.fall if contact.fall is None else contact.fall,
        loss=paddle.loss(hollow=ball.hollow, tangential=contact.tangential),
        drag=ball.drag,
        radius=ball.radius,
        inertia=inertia_share(hollow=ball.hollow),
        lift=ball.lift_constant,
    )


def bat_rig(place: Array) -> Rig:
    """Return two cameras that do not move, as those of :func:`mitt.core.eyes.camera.fixed_rig`.

    They look down from behind the arm to either side: so the arm, which comes from below, does not
    hide the ball, and the paddle does only in the last 20 ms.

    Args:
        place: Middle of where balls are struck [m], shape (3,).
    """
    cameras = tuple(
        replace(
            camera,
            T_world_cam=look_at(
                place + np.array([_BACK[0], side * _BACK[1], _BACK[2] + 0.05 * side]),
                place + _AHEAD,
            ),
        )
        for camera, side in zip(fixed_rig().cameras, (1.0, -1.0), strict=True)
    )
    return Rig(cameras=cameras)


def throw_ranges(speed: tuple[float, float] | None, station: BatStation) -> ThrowRanges:
    """Return the ranges of throws of some speeds [m/s]; as default throws where None."""
    usual = ranges_of(station.arm)
    if speed is None:
        return usual
    low, high = usual.distance
    return replace(usual, speed=speed, duration=(0.95 * low / speed[1], high / speed[0]))


def coming(
    speed: tuple[float, float] | None = None, recordings: Sequence[RecordedFlight] = ()
) -> Neighbourhood:
    """Return how balls come to be struck: as throws, of some speeds [m/s], or as recorded flights.

    Recorded flights are measured where they are struck (:func:`strike_share`).
    """
    if speed is not None:
        return replace(STRUCK, arrival=(0.85 * speed[0], speed[1]))
    if not recordings:
        return STRUCK
    flights = [place_flight(x, np.zeros(3), rng=None) for x in recordings]
    met = [x.at(x.after(strike_share(of)))[1] for x, of in zip(flights, recordings, strict=True)]
    speeds = np.linalg.norm(met, axis=1)
    descents = np.arcsin(-np.array(met)[:, 2] / speeds)
    return replace(
        STRUCK,
        arrival=(float(speeds.min()), float(speeds.max())),
        descent=(float(descents.min()), float(descents.max())),
        flight=_SOON,
    )


def strike_share(recording: RecordedFlight) -> float:
    """Return the share of its time since the release after which a recorded flight is struck.

    Some time after its bounce, when the ball is known again; one whose recording ends soon after
    the bounce is struck before it.
    """
    curve = smooth(recording.t, recording.r)
    lasts, hits = float(curve.edges[-1]) - curve.release, curve.bounces - curve.release
    if hits.size and lasts - hits[-1] >= _ENOUGH:
        return float(hits[-1] + _AFTER_BOUNCE) / lasts
    ends = float(hits[-1]) if hits.size else lasts
    return min(CATCH_FRACTION, (ends - _BEFORE_BOUNCE) / lasts)


def arm_with_paddle(
    name: str | Path, paddle: Paddle, *, limits: str | None = None
) -> tuple[Arm, Stance]:
    """Return an arm with a paddle on the plate where its hand is, and how it stands to bat.

    Raises:
        ModelError: Its stance is not known.
        MittError: The arm cannot be.
    """
    file = arm_of_task(name)
    stance = _STANCES.get(str(file.arm))
    if stance is None:
        raise ModelError(
            f"arm {name}",
            f"one whose stance for batting is known: {', '.join(_STANCES)}, or an arm file of one",
            file.arm,
            do=meant(str(name), _STANCES)
            or "choose one of these; mitt meet and mitt catch take any arm",
        )
    arm = file.carrying(paddle, joints=stance.joints, limits=limits)
    return with_notes_logged(arm, name), stance


def learn_strikes(
    g: BattingMap,
    batting: BattingSettings,
    place: Array,
    *,
    around: Neighbourhood = STRUCK,
    spread: tuple[float, float, float] = (0.0, 0.0, 0.0),
    seed: int = LEARNING_SEED,
    settings: LearnSettings | None = None,
) -> tuple[BattingMap, Learned]:
    """Learn a batting map over balls that come to a place.

    Args:
        g: The map, unlearned.
        batting: Target and impact.
        place: Middle of where balls are struck [m], shape (3,).
        around: How they come there; kicks and bounces are left out.
        spread: By how much the target lies elsewhere, at most, along each axis [m].
        seed: Of the flights.
        settings: How to learn.

    Raises:
        InputError: Fewer than one ball in ten can be struck so.
    """
    place, rng = checks.vector("place", place, 3, finite=True), np.random.default_rng(seed)
    flights = list[tuple[Flight, PaddleStrike]]()
    for _ in range(_DRAWS * around.flights):
        drawn = _drawn(g, batting, place, around, (rng, np.array(spread)))
        flights += [] if drawn is None else [drawn]
        if len(flights) == around.flights:
            return learn_batting(g, flights, settings=settings)
    raise InputError(
        "place",
        "one where balls can be struck towards the target",
        place.tolist(),
        do="move target or place, or leave another joint free",
    )


def _drawn(
    g: BattingMap,
    batting: BattingSettings,
    place: Array,
    around: Neighbourhood,
    of: tuple[np.random.Generator, Array],
) -> tuple[Flight, PaddleStrike] | None:
    """Draw a flight, and how its ball is struck; None where it cannot be."""
    rng, spread = of
    drag = float(rng.uniform(*around.drag))
    r = place + np.array(around.box) * rng.uniform(-1.0, 1.0, 3)
    down, side = rng.uniform(*around.descent), rng.uniform(*around.azimuth)
    ahead = np.cos(down)
    v = -rng.uniform(*around.arrival) * np.array(
        [ahead * np.cos(side), ahead * np.sin(side), np.sin(down)]
    )
    target = None if batting.aim is None else batting.aim + spread * rng.uniform(-1.0, 1.0, 3)
    lasts, noise = float(rng.uniform(*around.flight)), rng.standard_normal((2, 3))
    impact = replace(batting.impact, drag=drag)

    def met(dt: float) -> tuple[float, PaddleStrike] | None:
        strike = g.strike(_row(r, v, dt, drag)[:2], target, impact)
        if strike is None or not g.aims(strike, target):
            return None
        return g.ease(strike, g.arm.q_ready, lasts + dt), strike

    found = easiest(met, batting.window(0.0))
    best = found[0][1] if found and found[0][1][0] < np.inf else None
    if best is None:
        return None
    ball_met = best[1].ball
    t = np.append(np.linspace(0.0, lasts, around.instants - 1), lasts + around.after)
    ball = np.array([_row(ball_met[0], ball_met[1], x - lasts, drag) for x in t])
    seen = ball[0].copy()
    seen[:2] += noise * [[around.sigma_r], [around.sigma_dr]]
    return Flight(t=t, ball=ball, seen=seen), best[1]


def _row(r: Array, v: Array, dt: float, drag: float) -> Array:
    """Return r_o, dr_o, ddr_o of a flight so much later [s], shape (3, 3)."""
    row = np.array([r, v, np.zeros(3)])
    advance(row[0], row[1], drag, dt)
    acceleration(row[1], drag, row[2])
    return row
