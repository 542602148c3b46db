"""Where an arm meets what moves: a belt before it, or a person who hands it something.

The place scales with the arm: half of its reach before its shoulder, and a belt a little below it.
The pose in which it waits is looked for: the tool above the place, its axis as wanted, from where
it comes down on all of the work area clear of itself, of the floor and of singular poses.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Final, Literal, NamedTuple

import numpy as np

from mitt.core.arm.arm import Arm
from mitt.core.arm.description import Capsule
from mitt.core.arm.kinematics import motion_of, sweep
from mitt.core.arm.limits import slowed
from mitt.core.arm.shapes import MARGIN, Shapes, Surroundings, clearance, shapes_of
from mitt.core.arm.tools import Gripper, Jaw, Suction
from mitt.core.ball.belt import RIDING
from mitt.core.ball.filter import FilterConfig
from mitt.core.catcher.generators import Generator
from mitt.core.catcher.meeting import Meeting, MeetingSettings
from mitt.core.catcher.settings import CatcherSettings
from mitt.core.errors import InputError, ModelError
from mitt.core.map.demand import uniform
from mitt.core.map.meeting import MeetingMap, unlearned_meeting
from mitt.core.map.reach import Reach, ReachScratch, reach_of, reach_scratch, reach_target
from mitt.core.signals import TICK, Array
from mitt.io.arm_file import arm_of_task, with_notes_logged
from mitt.io.load import TIP_AXES
from mitt.io.wam import wrist_wam
from mitt.lab.rivals.meeting import make_meeter
from mitt.lab.trials.catcher_settings import catcher_settings
from mitt.lab.world.overlap import check_scene
from mitt.lab.world.scene import Ball, Belt, Scene, scene_of
from mitt.lab.world.targets import InHand, Ride, drawn_reach, drawn_ride

Target = Literal["belt", "hand"]
TARGETS: Final[tuple[Target, ...]] = ("belt", "hand")
"""What moves the thing that is met."""

CARRIED: Final = FilterConfig(
    other_motion=0.998,
    watchful=True,
    min_sightings=4,
    driven_sigma=1.5,
    driven_time=0.3,
    steady_density=3e-3,
    switch_time=0.15,
)
"""What the filter assumes of a thing that is carried: it does not fly, and speeds up by 1.5 m/s^2.
"""

PART: Final = Ball(sides=(0.05, 0.06, 0.04), mass=0.1, drag=0.0)
"""The part that is met where the scene says nothing: a small box."""

PARTS_SCENE: Final = scene_of(
    {
        "base": "lab",
        "sensing": {
            "latency": 30,
            "point_noise": 0.002,
            "frame_rate": 60.0,
            "viewpoint": "above",
            "belt": {"scale": 0.01, "clock": 0.002},
        },
    },
    place="scene",
)
"""The world where parts are met and nothing is said: a camera of 60 Hz, 30 ms late, 2 mm of noise.

It hangs above the belt, so that tool and arm hide the part in the end, and the belt's encoder is
read, its scale wrong by up to 1 % and its stamps by up to 2 ms.
"""

#: Numbers of joints that bring a tool to a target: its place, also its axis, also its turn; of
#: seven one is held.
_COUNTS = (3, 5, 6, 7)
#: How far above its place the tool waits, and where its way down begins [m].
_WAITS = 0.15
_ABOVE = 0.06
#: Time from the meeting until the tool begins to close [s].
_SETTLE = {"belt": 0.2, "hand": 0.0}
#: Rate at which what a person holds is followed once it is met [1/s].
_GENTLE = {"belt": 0.0, "hand": 6.0}
#: Times of the way down that are tried [s], and the share of each limit that it may take.
_DOWN = (0.2, 0.25, 0.3, 0.4, 0.5, 0.7, 1.0, 1.5, 2.5)
#: Least of them: a person is touched gently [s].
_LEAST_DOWN = {"belt": 0.2, "hand": 0.4}
_HALF = replace(uniform(0.8), speed=0.5, acceleration=0.4)
#: Places that are tried, in lengths of the arm before its shoulder, and above it [m]: where a
#: forearm points as the tool to a person does, its wrist is singular.
_SHARES = (0.5, 0.6, 0.7)
_HIGHER = {"belt": (-0.12,), "hand": (0.05, 0.2, 0.35)}
#: The same of arms that reach none of these with the tool as it is to point.
_NEARER = (0.4, 0.3)
_LOWER = {"belt": (-0.12, -0.3), "hand": (0.05, 0.2, -0.1)}
#: 1-sigma of a part's place with which a tool takes it [m].
_KNOWN = 0.02
#: Half-widths of the work area that are tried, along a belt, in lengths of the arm: fast belts want
#: long areas; and how far it goes along it at most: beyond, the tool lifts the part and rests.
_WIDE = {"belt": (0.42, 0.32, 0.22), "hand": (0.2,)}
_ALONG = 0.32
#: The least half-widths [m].
_LEAST_ROOM = {"belt": np.array([0.06, 0.06, 0.05]), "hand": np.array([0.06, 0.06, 0.1])}
#: How far inside the work area a person offers a thing [m].
_INSIDE = 0.02
#: Gap between told and true joint angles at which an arm whose tool has a largest speed gives up
#: [rad], at least, and for each m/s of that speed.
_BEHIND = 0.02
_LAGS = 0.08
#: What to do where no pose brings the tool over what moves the part, looked for towards +x.
_ELSEWHERE: dict[Target, str] = {
    "belt": "name other joints or another tip (--joints, --tip), or another place of the belt"
    " ([belt] of a scene)",
    "hand": "name other joints or another tip (--joints, --tip)",
}
#: Cosine of tool and last joint's axis above which the tool does not lie across it, and how far a
#: joint is beyond another at least, to tell which way leads out [m].
_ALONGSIDE = 0.7
_BEYOND = 0.005
#: Turns of the tool about its axis that are tried.
_QUARTERS = [
    np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    for c, s in ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))
]
#: Poses from which the one to wait in is looked for, those that tell what is in the way, of each
#: place and turn, and their seed.
_POSES = 600
_FEW = 10
_SEED = 5
#: Gap that it keeps from itself [m]. What is nearer than 10 mm as in a wrist, is not watched later.
_GAP = 0.005
#: What it keeps beyond ``MARGIN`` over the work area, to come to rest in [m], unless it waits with
#: less, and how far a joint turns at most there for a metre of the target's way [rad/m]: at
#: 0.25 m/s those of a Panda are at their speed.
_SPARE = 0.005
_STEEPEST = 10.0
#: Merits of a pose that has all; rounding of a gap [m].
_ALL = 2
_ROUNDING = 1e-6
_SIN = float(np.sin(np.deg2rad(40.0)))
_COS = float(np.cos(np.deg2rad(40.0)))
#: How the tool points: down on a belt, away from the arm and 40 degrees down to a person.
_FRAMES = {
    "belt": np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]),
    "hand": np.array([[0.0, _SIN, _COS], [1.0, 0.0, 0.0], [0.0, _COS, -_SIN]]),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Station:
    """An arm where it meets things.

    Attributes:
        arm: The arm, in the pose in which it waits.
        map: Its meeting map.
        settings: Where and how things are met.
        scene: The world.
        place: Middle of the work area, where the middle of a part comes by [m], shape (3,).
        target: What moves the part.
    """

    arm: Arm
    map: MeetingMap
    settings: MeetingSettings
    scene: Scene
    place: Array
    target: Target

    @property
    def presented(self) -> Array:
        """How a part lies on the belt, or is presented by a person: columns its axes, (3, 3).

        Its upper side is towards the tool.
        """
        return self.map.frame * [1.0, -1.0, -1.0]

    def coming(self, rng: np.random.Generator, speed: float) -> Ride | InHand:
        """Return what comes by: a part on the belt, or a thing in a hand.

        Args:
            rng: Source of the draw.
            speed: Mean speed of the belt, or largest of the hand [m/s].
        """
        if self.scene.belt is not None and self.target == "belt":
            return drawn_ride(rng, self.place, self.scene.belt.along, speed=speed)
        to = self.place + 0.03 * rng.standard_normal(3)
        area = np.array(self.settings.low) + _INSIDE, np.array(self.settings.high) - _INSIDE
        hand = drawn_reach(rng, to=to, speed=speed, within=area)
        return replace(hand, orientation=self.presented)

    @property
    def catcher(self) -> CatcherSettings:
        """Settings of its catcher."""
        return self.for_parts(catcher_settings(self.arm, self.scene))

    def for_parts(self, settings: CatcherSettings) -> CatcherSettings:
        """Return a catcher's settings for parts that are met, not for balls that fly.

        What the filter assumes of its target, half of the part's width as its radius, and the gap
        at which the arm gives up what it is kept from instead of catching up with it: wider where
        the tool has a largest speed. Of the belt it keeps clear: nothing presses on it. What is
        hidden does not stop the arm: the map gives it up in time.

        Args:
            settings: For a ball.
        """
        part = self.scene.ball
        across = part.sides[0] if part.sides else 2.0 * part.radius
        behind, around = max(_BEHIND, _LAGS * self.settings.speed), settings.around
        hand, belt = self.arm.model.hand, self.scene.belt
        part_rides = belt is not None and self.target == "belt"
        if isinstance(hand, Gripper) and belt is not None and part_rides:
            under = _under(belt, hand.yields - MARGIN)
            around = replace(around, zones=(*around.zones, under))
        read = part_rides and self.scene.sensing.belt is not None
        return replace(
            settings,
            flight=RIDING if read else CARRIED,
            belt=self.settings.along if read else None,
            sigma_ready=0.05,
            tolerance=np.inf,
            ball_radius=0.5 * across,
            adapt_dq=np.inf,
            adapt_q=behind,
            around=around,
        )

    @property
    def notes(self) -> dict[str, str]:
        """What a recording says of the world, for who draws it: texts by name."""
        scene = self.scene.model_dump_json(include={"ball", "belt", "floor"})
        return {"target": self.target, "scene": scene}

    def generator(self, name: str, *, rate: float = 100.0) -> Generator:
        """Return what meets things, by name; see :func:`mitt.lab.rivals.meeting.make_meeter`."""
        return make_meeter(name, Meeting(self.map, self.settings), rate=rate)


def station(
    name: str | Path,
    tool: Suction | Jaw,
    target: Target,
    scene: Scene,
    *,
    tip: str | None = None,
    joints: Sequence[str] | None = None,
    limits: str | None = None,
    speed: float = np.inf,
    speed_scale: float = 1.0,
) -> Station:
    """Return the station of an arm.

    Args:
        name: The arm, as of :func:`mitt.io.arm_file.arm_of_task`, and ``tip``, ``joints``.
        tool: What it carries.
        target: What moves the part.
        scene: The world; what it does not say of part and belt is filled in.
        tip: See ``name``.
        joints: See ``name``.
        limits: Limit set; that of the arm if left out.
        speed: Largest speed of the tool [m/s].
        speed_scale: Share of the joints' speed limits that is used at all.

    Raises:
        ModelError: No pose brings the tool over the work area.
        InputError: The arm stands or waits in the floor, or in the belt.
    """
    if scene.ball.sides is None:
        scene = scene.model_copy(update={"ball": PART})
    half = 0.5 * (scene.ball.sides or (0.04,) * 3)[2]
    tool = replace(tool, half=half) if isinstance(tool, Suction) else tool
    raw, free, coupling = _raw(name, tool, target, tip=tip, joints=joints, limits=limits)
    raw = Arm(raw.model, slowed(raw.limits, speed_scale))
    shoulder, reach = _shoulder(raw)
    inverse = reach_of(raw, free, coupling)
    tried = [product(_HIGHER[target], _SHARES), product(_LOWER[target], _NEARER)]
    places = [
        [shoulder + np.array([share * reach, 0.0, up]) for up, share in places] for places in tried
    ]
    if scene.belt is not None:
        places = [[np.array([*scene.belt.middle, scene.belt.height + half])]]
    found = (_best_pose(raw, inverse, target, scene, x) for x in places)
    best = next((x for x in found if x is not None), None)
    if best is None:
        said = arm_of_task(name, tip=tip, joints=joints).tip
        better = None if said is None else tip_out_of_flange(raw, said)
        across = f"the tool lies across the axis of {raw.names[-1]}: say --tip {better}"
        raise ModelError(
            f"arm {name}",
            f"one that reaches over the {target}",
            _hindrance(raw, inverse, target, scene, places[-1]),
            do=_ELSEWHERE[target] if better is None else across,
        )
    (_, q, frame), place, room = best
    if scene.belt is None and target == "belt":
        belt = Belt(middle=(float(place[0]), float(place[1])), height=float(place[2]) - half)
        scene = scene.model_copy(update={"belt": belt})
    arm = Arm(replace(raw.model, q_ready=q), raw.limits)
    check_scene(arm, scene)
    moves = scene.belt if target == "belt" else None
    low, high = _work_area(place, room, moves, reach)
    f = unlearned_meeting(arm, free, frame=frame, coupling=coupling)
    settings = MeetingSettings(
        low=tuple(low.tolist()),
        high=tuple(high.tolist()),
        above=_ABOVE,
        settle=_SETTLE[target],
        closing=_takes(tool, scene),
        speed=speed,
        gentle=_GENTLE[target],
        along=None if moves is None else tuple(moves.along.tolist()),
    )
    settings = replace(settings, down=_time_down(f, settings, place, _LEAST_DOWN[target]))
    return Station(arm=arm, map=f, settings=settings, scene=scene, place=place, target=target)


def check_seen_in_time(at: Station, speed: float) -> None:
    """Refuse parts that are seen too late for their belt, where its encoder is not read.

    Args:
        at: Where they are met.
        speed: Mean speed of the belt [m/s].

    Raises:
        InputError: By the newest sighting a part is known worse than a tool takes it.
    """
    s, of = at.scene.sensing, at.settings
    if of.along is None or s.belt is not None:
        return
    age, most = TICK * s.latency + 1.0 / s.frame_rate, _KNOWN / (of.varies * speed)
    if age > most:
        raise InputError(
            "sensing.latency",
            f"sightings of a belt of {speed:g} m/s at most {1e3 * most:.0f} ms old: its speed may"
            f" change by {100.0 * of.varies:.0f} %, and the tool takes"
            f" what is {1e3 * _KNOWN:.0f} mm off",
            f"{1e3 * age:.0f} ms ({s.latency} ms, and {1e3 / s.frame_rate:.0f} ms to the next)",
            do="let the belt's encoder be read ([sensing.belt] of the scene)",
        )


def _work_area(place: Array, room: Array, belt: Belt | None, reach: float) -> tuple[Array, Array]:
    """Return the ends of the box in which parts are met [m], shape (3,) each; along a belt."""
    low, high = place - room - 0.02, place + room + 0.02
    if belt is None:
        return low, high
    most = _ALONG * reach + 0.02
    low = np.where(belt.along < 0.0, np.maximum(low, place - most), low)
    return low, np.where(belt.along > 0.0, np.minimum(high, place + most), high)


def _time_down(f: MeetingMap, settings: MeetingSettings, place: Array, least: float) -> float:
    """Return the time of the way down on a part that rests, at least so long [s].

    It is the shortest within half of all limits, and of the tool's speed: the other half is left
    for a part that moves.
    """
    part = np.array([place, np.zeros(3), np.zeros(3)])
    for down in (x for x in _DOWN if x >= least):
        way = Meeting(f, replace(settings, down=down), _HALF)
        left = np.linspace(down, 0.0, 40)
        path = np.array([way.placed(part, x) for x in left])
        rows = f.motion_along(path, np.zeros(len(path)), 1.0)
        if np.linalg.norm(path[:, 1], axis=1).max() > 0.5 * settings.speed:
            continue
        if rows is not None and max(way.shares(rows[:, :3], left[0] - left[1]).values()) <= 1.0:
            return down
    return _DOWN[-1]


def _under(belt: Belt, above: float) -> Capsule:
    """Return what the arm keeps clear of: a roll as wide as two belts, its top along the belt's.

    As high above it as is said [m].
    """
    middle = np.array([*belt.middle, belt.height + above - belt.width])
    ends = [middle + 0.5 * way * belt.length * belt.along for way in (-1.0, 1.0)]
    start, end = ((float(x), float(y), float(z)) for x, y, z in ends)
    return Capsule(start=start, end=end, radius=belt.width)


def _takes(tool: Suction | Jaw, scene: Scene) -> float:
    """Return the time that a tool takes to close on the scene's part [s]."""
    sides = scene.ball.sides or (0.05,) * 3
    return float(tool.closing_on(0.5 * sides[0], 0.0, np.zeros(1)).takes[0])


def arm_with_tool(
    name: str | Path,
    tool: Suction | Jaw,
    *,
    tip: str | None = None,
    joints: Sequence[str] | None = None,
    limits: str | None = None,
) -> Arm:
    """Return an arm with a tool, as of :func:`station`, with the joints that move at any target.

    Raises:
        MittError: The arm cannot be, or so many joints bring no tool to a target.
    """
    file = arm_of_task(name, tip=tip, joints=joints)
    told = tuple(joints or ())
    arm = file.carrying(tool, joints=told, limits=limits)
    if arm.n not in _COUNTS and file.held and not told:  # held for a catch alone
        arm = file.carrying(tool, joints=(*file.joints, *file.held), limits=limits)
    if arm.n not in _COUNTS:
        given = f"{arm.n}: {', '.join(arm.names)}"
        raise ModelError(
            f"arm {name}", "3, 5, 6 or 7 joints that move", given, do="name others (--joints)"
        )
    return with_notes_logged(arm, name)


def _raw(
    name: str | Path,
    tool: Suction | Jaw,
    target: Target,
    *,
    tip: str | None,
    joints: Sequence[str] | None,
    limits: str | None,
) -> tuple[Arm, tuple[int, ...], Array | None]:
    """Return an arm with a tool, the joints that bring it to a target, and how others follow.

    Of seven joints the third is held, where it is straight. The WAM carries the tool on its wrist,
    whose pitch follows two joints, so that three reach the target and the tool's direction stays.
    """
    file = arm_of_task(name, tip=tip, joints=joints)
    if file.arm == "wam" and (limits or file.limits) in (None, "paper"):
        arm = wrist_wam(tool)
        pitch = float(np.arccos(_FRAMES[target][2, 2])) - arm.q_ready[1]
        ready = np.array([0.0, arm.q_ready[1], 0.5 * pitch, 0.5 * pitch])
        bent = Arm(replace(arm.model, q_ready=ready), arm.limits)
        return bent, (0, 1, 2), np.array([[0.0, -1.0, -1.0]])
    whole = arm_with_tool(name, tool, tip=tip, joints=joints, limits=limits)
    if whole.n == 7:
        names = (*whole.names[:2], *whole.names[3:])
        whole = file.carrying(tool, joints=names, limits=limits)
    return whole, tuple(range(whole.n)), None


def _shoulder(arm: Arm) -> tuple[Array, float]:
    """Return where the second joint is in the ready pose [m], (3,), and how far the arm reaches."""
    m = motion_of(arm.n)
    sweep(arm.chain, arm.q_ready, np.zeros(arm.n), m)
    at = m.origin[0, 1].copy()
    rng, low, high = np.random.default_rng(_SEED), arm.q_min, arm.q_max
    tips = [arm.position(rng.uniform(low, high)) for _ in range(400)]
    return at, float(max(np.linalg.norm(tip - at) for tip in tips))


def _hindrance(
    arm: Arm, inverse: Reach, target: Target, scene: Scene, places: Sequence[Array]
) -> str:
    """Return what is in the way of a pose to wait in: what stops those that come farthest."""
    w, frame, rng = reach_scratch(inverse), _FRAMES[target], np.random.default_rng(_SEED)
    shapes, room = shapes_of(arm, Surroundings(floor=scene.floor)), 0.03 * (arm.q_max - arm.q_min)
    met, clear, beyond = 0, False, np.zeros(arm.n)
    for place, turn in product(places, _QUARTERS):
        w.frame[:] = frame @ turn
        for _ in range(_FEW):
            start = rng.uniform(np.maximum(arm.q_min, -2.6), np.minimum(arm.q_max, 2.6))
            q = _brought(inverse, w, place - _WAITS * frame[:, 2], start)
            if q is not None:
                met += 1
                beyond += (q < arm.q_min + room) | (q > arm.q_max - room)
                clear |= _is_sound(arm, inverse, q, w.frame) and _gap_in(arm, shapes, q) > _GAP
    if met == 0:
        return "no pose that brings the tool there, pointing as it should"
    worst = int(np.argmax(beyond))
    if beyond[worst] > 0.5 * met:
        return f"poses beyond the range of {arm.names[worst]}"
    return "no pose from where it is reached all over" if clear else "poses too near to itself"


def tip_out_of_flange(arm: Arm, tip: str) -> str | None:
    """Return the tip with its axis that leads out of the flange, where a tool lies across that.

    Flanges turn about what leads out of them, and many files call that another axis than z.

    Args:
        arm: The arm; its tool points along the z axis of its tip.
        tip: As of :func:`mitt.load_arm`.
    """
    m, R = motion_of(arm.n), arm.orientation(arm.q_ready)
    sweep(arm.chain, arm.q_ready, np.zeros(arm.n), m)
    origin, axis = m.origin[0], m.line[0, -1]
    beyond = [float((origin[-1] - p) @ axis) for p in origin[-2::-1]]
    along = next((x for x in beyond if abs(x) > _BEYOND), 0.0)
    if abs(axis @ R[:, 2]) > _ALONGSIDE or along == 0.0:
        return None
    frame, _, said = tip.rpartition(":")
    frame, turn = (frame, TIP_AXES[said]) if frame and said in TIP_AXES else (tip, np.eye(3))
    out = turn @ R.T @ axis * np.sign(along)
    return f"{frame}:{max(TIP_AXES, key=lambda x: float(TIP_AXES[x][:, 2] @ out))}"


class Waiting(NamedTuple):
    """A pose in which an arm waits.

    Attributes:
        merits: How much of :func:`waiting_pose`'s wishes it fulfils all over the work area: 0 to 2.
        q: The pose [rad], shape (n,).
        frame: Columns: where the tool's axes point, shape (3, 3).
    """

    merits: int
    q: Array
    frame: Array


def waiting_pose(
    arm: Arm, inverse: Reach, frame: Array, place: Array, room: Array, floor: float
) -> Waiting | None:
    """Return the pose in which an arm waits for what comes to a place; None where none reaches all.

    Of many that have the tool above the place, turned about its axis by quarters: those from where
    no place in the work area turns a joint fast, as a singular wrist does; of these, if there are
    any, those clear of the arm itself and of the floor all over it; of these the one whose tool has
    the most room to move.

    Args:
        arm: The arm.
        inverse: What brings its tool to a target.
        frame: Columns: where the tool's axes are to point, but for such a turn, shape (3, 3).
        place: Middle of the work area [m], shape (3,).
        room: Half of its sizes [m], shape (3,).
        floor: Height of the floor [m].
    """
    w, around = reach_scratch(inverse), Surroundings(floor=floor)
    rng, above = np.random.default_rng(_SEED), place - _WAITS * frame[:, 2]
    area = [place + room * x for x in product((-1.0, 0.0, 1.0), repeat=3)]
    corners = [place + room * x for x in product((-1.0, 1.0), repeat=3)]
    area, corners = (x + [y - _ABOVE * frame[:, 2] for y in x] for x in (area, corners))
    turns, shapes = [frame @ x for x in _QUARTERS], shapes_of(arm, around)
    best: tuple[int, float, Array, Array] | None = None
    merits = dict[bytes, int]()
    for k in range(_POSES):
        w.frame[:] = turned = turns[k % len(turns)]
        start = rng.uniform(np.maximum(arm.q_min, -2.6), np.minimum(arm.q_max, 2.6))
        q = _brought(inverse, w, above, start)
        if q is None or not _is_sound(arm, inverse, q, turned):
            continue
        worth = _ease(arm, inverse, w, corners, q)
        hopes = worth > 0.0 and (best is None or (_ALL, worth) > best[:2])
        if hopes and _gap_in(arm, shapes, q) > _GAP:
            alike = (np.round(q, 3) + 0.0).tobytes()
            if alike not in merits:
                merits[alike] = _merits(arm, inverse, w, area, q, around)
            if best is None or (merits[alike], worth) > best[:2]:
                best = merits[alike], worth, q, turned
    return None if best is None else Waiting(best[0], *best[2:])


def _best_pose(
    raw: Arm, inverse: Reach, target: Target, scene: Scene, places: Sequence[Array]
) -> tuple[Waiting, Array, Array] | None:
    """Return the best pose to wait in, above which place, and the room about it [m].

    None where no pose brings the tool over any of the places.
    """
    best: tuple[Waiting, Array, Array] | None = None
    _, reach = _shoulder(raw)
    sideways = Belt().along  # where nothing says how things come
    along = scene.belt.along if scene.belt and target == "belt" else sideways
    for wide, place in product(_WIDE[target], places):
        room = np.maximum(wide * reach * np.abs(along), _LEAST_ROOM[target])
        found = waiting_pose(raw, inverse, _FRAMES[target], place, room, scene.floor)
        if found is not None and (best is None or found.merits > best[0].merits):
            best = found, place, room
            if found.merits == _ALL:
                break
    return best


def _brought(inverse: Reach, w: ReachScratch, to: Array, start: Array) -> Array | None:
    """Return the pose that brings the tool to a place, from a start; None where there is none."""
    rows = _followed(inverse, w, to, np.zeros(3), start)
    return None if rows is None else rows[0].copy()


def _followed(
    inverse: Reach, w: ReachScratch, to: Array, speed: Array, start: Array
) -> Array | None:
    """Return q, dq, ddq of a tool that comes by a place at a velocity, from a start, (3, n)."""
    rows = np.zeros((3, len(start)))
    rows[0] = start
    return rows if reach_target(inverse, np.array([to, speed, np.zeros(3)]), rows, w) else None


def _is_sound(arm: Arm, inverse: Reach, q: Array, frame: Array) -> bool:
    """Say whether a pose is in the joints' ranges, its tool pointing as wanted, not opposite."""
    room = 0.03 * (arm.q_max - arm.q_min)
    inside = bool(np.all((q > arm.q_min + room) & (q < arm.q_max - room)))
    turned = arm.orientation(q)
    along = np.sum(turned * frame, axis=0)  # cosines of the tool's axes with those wanted
    k = len(inverse.free)
    told = along if k == 6 else along[2:] if k == 5 or k < arm.n else along[:0]
    return inside and bool(np.all(told > 0.9))


def _ease(arm: Arm, inverse: Reach, w: ReachScratch, corners: list[Array], q: Array) -> float:
    """Return the smallest singular value of the tool's motion over all corners; 0 out of reach."""
    least = np.inf
    for corner in corners:
        at = _brought(inverse, w, corner, q)
        if at is None or np.any((at < arm.q_min) | (at > arm.q_max)):
            return 0.0
        least = min(least, float(np.linalg.svd(arm.jacobian(at), compute_uv=False)[-1]))
    middle, half = 0.5 * (arm.q_max + arm.q_min), 0.5 * (arm.q_max - arm.q_min)
    return least * (1.2 - float(np.abs((q - middle) / half).max()))


def _merits(
    arm: Arm, inverse: Reach, w: ReachScratch, area: list[Array], q: Array, around: Surroundings
) -> int:
    """Return 1 for a pose from where no place asks for a joint too fast, 2 if it is clear, too."""
    poses = []
    for to in area:
        ways = [_followed(inverse, w, to, speed, q) for speed in np.eye(3)]
        asked = [np.inf if x is None else float(np.abs(x[1]).max()) for x in ways]
        if ways[0] is None or max(asked) > _STEEPEST:
            return 0
        poses.append(ways[0][0])
    shapes = shapes_of(Arm(replace(arm.model, q_ready=q), arm.limits), around)
    least = min(_gap_in(arm, shapes, q) - _ROUNDING, MARGIN + _SPARE)
    return _ALL if all(_gap_in(arm, shapes, x) >= least for x in poses) else 1


def _gap_in(arm: Arm, shapes: Shapes, q: Array) -> float:
    """Return how far an arm in a pose is from itself and from the floor [m]."""
    return float(clearance(arm.bodies, q, shapes.table, shapes.pairs, shapes.ends))
