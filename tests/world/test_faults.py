"""Each kind of fault by itself: it does what it says, at its time, and the same each time."""

from pathlib import Path

import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.arm.hands import HandModel
from mitt.core.errors import InputError
from mitt.core.eyes.camera import fixed_rig
from mitt.core.signals import TICK, ArmState, Array, Command, Frame, Senses, Sighting
from mitt.io.load import build_arm
from mitt.lab.world.disturbances import DisturbedTrial, Undisturbed
from mitt.lab.world.faults import ActiveFaults, AnyFault, true_rig
from mitt.lab.world.scene import Scene, exact_scene, read_scene
from mitt.lab.world.simulation import World
from mitt.lab.world.throws import Throw
from mitt.lab.world.throws import fly as exactly

PLACE = np.array([3.0, 0.1, 0.4])
THROW = Throw(r=np.array([3.6, 0.1, 0.2]), dr=np.array([-5.0, 0.0, 2.6]))
#: Ticks of a run through the stages.
TICKS = 400


class Plain:
    """Sensors without noise or delay; frames of two cameras, or points."""

    def __init__(self, *, pixels: bool = False) -> None:
        """Count frames from zero."""
        self._pixels, self._number = pixels, -1

    def turn(self, gaze: Array | None, duration: float) -> None:
        """Stand still."""

    def read(
        self, t: float, q: Array, dq: Array, r_o: Array, dr_o: Array, *, look: bool = True
    ) -> Senses:
        """Return exact readings."""
        assert dr_o.shape == r_o.shape
        self._number += 1
        frames: tuple[Frame, ...] = ()
        points: tuple[Sighting, ...] = ()
        if look and self._pixels:
            image = np.full((8, 8), self._number % 256, np.uint8)
            frames = tuple(Frame(t=t, camera=k, number=self._number, pixels=image) for k in (0, 1))
        elif look:
            points = (Sighting(t=t, found=True, r_o=r_o.copy(), covariance=1e-6 * np.eye(3)),)
        return Senses(t=t, arm=ArmState(t=t, q=q, dq=dq), frames=frames, points=points)


STILL = np.zeros(3)


def plan_of(*faults: dict[str, object]) -> tuple[AnyFault, ...]:
    """Return a plan as a scene file gives it."""
    return Scene.model_validate({"faults": list(faults)}).faults


def faults_of(plan: tuple[AnyFault, ...], *, seed: int = 7, arm: Arm | None = None) -> ActiveFaults:
    """Return the faults of a trial."""
    flight = Undisturbed(ball=THROW, drag=0.04, hand=np.array([0.8, 0.0, 0.0]))
    limits, active = (None, (0, 1, 2)) if arm is None else (arm.limits, arm.model.active)
    return ActiveFaults(plan, seed, DisturbedTrial(flight, limits, active))


def run(*faults: dict[str, object], pixels: bool = False, seed: int = 7) -> list[Senses]:
    """Return what arrives in each tick of a run in which joint angles rise by 1 rad/s."""
    sensors = faults_of(plan_of(*faults), seed=seed).sensors(Plain(pixels=pixels), pixels=pixels)
    rate = np.ones(3)
    return [sensors.read(k * TICK, k * TICK * rate, rate, PLACE, STILL) for k in range(TICKS)]


def fly(*faults: dict[str, object], ticks: int = 450, seed: int = 7) -> World:
    """Return a world after a flight in which the arm hangs on no torque."""
    world = _world(exact_scene().model_copy(update={"faults": plan_of(*faults)}))
    world.reset(THROW, seed)
    for _ in range(ticks):
        world.sense()
        world.apply(still(world.t))
    return world


def still(t: float) -> Command:
    """Return a command of no torque."""
    nothing = np.zeros(3)
    return Command(t=t, joints=np.array([nothing] * 4), hand=0.0)


def _world(scene: Scene) -> World:
    """Return a world with the WAM."""
    arm = build_arm("wam", limits="paper", hand=HandModel())
    return World(scene, arm.model, limits=arm.limits)


def path(world: World) -> Array:
    """Return the ball's way, shape (k, 3)."""
    return world.trace().r_o


ALL = [
    {"kind": "noise", "magnitude": 0.01},
    {"kind": "outlier", "magnitude": 0.3, "chance": 0.1},
    {"kind": "dropout", "magnitude": 0.5},
    {"kind": "frozen"},
    {"kind": "latency", "magnitude": 0.01},
    {"kind": "late", "magnitude": 0.004},
    {"kind": "duplicate", "magnitude": 0.3},
    {"kind": "calibration", "magnitude": 0.01},
    {"kind": "nan", "magnitude": 0.1},
    {"kind": "clock", "magnitude": 1.0},
    {"kind": "encoder", "fault": "jump"},
]


@pytest.mark.parametrize("fault", ALL, ids=lambda fault: str(fault["kind"]))
@pytest.mark.parametrize("pixels", [False, True])
def test_the_same_seed_gives_the_same_senses_and_another_seed_others(
    fault: dict[str, object], pixels: bool
) -> None:
    first, again = run(fault, pixels=pixels), run(fault, pixels=pixels)
    for a, b in zip(first, again, strict=True):
        assert a.t == b.t
        np.testing.assert_array_equal(a.arm.q, b.arm.q)
        assert [(f.t, f.camera, f.number) for f in a.frames] == [
            (f.t, f.camera, f.number) for f in b.frames
        ] or np.isnan([f.t for f in a.frames]).any()
        for p, q in zip(a.points, b.points, strict=True):
            np.testing.assert_array_equal(p.r_o, q.r_o)


def test_an_entry_draws_the_same_whatever_stands_beside_it() -> None:
    """Streams belong to entries by number: a second entry changes nothing of the first."""
    alone = [s.points[0].r_o for s in run({"kind": "noise", "magnitude": 0.01})]
    both = run({"kind": "noise", "magnitude": 0.01}, {"kind": "encoder", "fault": "jump"})
    np.testing.assert_array_equal(alone, [s.points[0].r_o for s in both])


def test_noise_has_the_size_it_says_and_only_in_its_time() -> None:
    senses = run({"kind": "noise", "magnitude": 0.01, "start": 0.1, "length": 0.2})
    off = np.array([s.points[0].r_o - PLACE for s in senses])
    assert not off[:100].any()
    assert not off[301:].any()
    assert 0.009 < off[100:300].std() < 0.011


def test_outliers_are_so_far_off_and_so_frequent() -> None:
    off = [
        np.linalg.norm(s.points[0].r_o - PLACE)
        for s in run({"kind": "outlier", "magnitude": 0.3, "chance": 0.2})
    ]
    hit = np.array(off) > 1e-9
    np.testing.assert_allclose(np.array(off)[hit], 0.3)
    assert 0.12 < hit.mean() < 0.28


def test_a_dropout_takes_one_camera_or_all() -> None:
    one = run({"kind": "dropout", "camera": 1, "start": 0.1, "length": 0.05}, pixels=True)
    assert [len(s.frames) for s in one[90:160]] == [2] * 10 + [1] * 50 + [2] * 10
    assert all(f.camera == 0 for s in one[100:150] for f in s.frames)
    assert not any(s.frames for s in run({"kind": "dropout"}, pixels=True))


def test_a_frozen_camera_repeats_its_last_frame_and_its_stamp() -> None:
    frozen = run({"kind": "frozen", "camera": 0, "start": 0.1, "length": 0.1}, pixels=True)
    for senses in frozen[100:200]:
        assert senses.frames[0].number == 99
        assert senses.frames[0].t == pytest.approx(0.099)
        assert senses.frames[1].t == senses.t
    assert frozen[200].frames[0].number == 200


def test_a_frozen_camera_that_goes_on_numbering_repeats_pixels_alone() -> None:
    frozen = run({"kind": "frozen", "numbered": True, "start": 0.1}, pixels=True)
    assert frozen[150].frames[0].number == 150
    assert frozen[150].frames[0].pixels[0, 0] == 99


@pytest.mark.parametrize("stamped", [True, False])
def test_latency_delays_all_alike(stamped: bool) -> None:
    """Stamped frames say when they were exposed; unstamped ones claim to be fresh."""
    late = run({"kind": "latency", "magnitude": 0.02, "stamped": stamped}, pixels=True)
    assert not any(s.frames for s in late[:20])
    for k in range(20, TICKS):
        assert late[k].frames[0].number == k - 20
        assert late[k].frames[0].t == pytest.approx(late[k].t - (0.02 if stamped else 0.0))


def test_late_points_come_beside_those_that_are_on_time_and_none_is_lost() -> None:
    """One in ten late by 5 ms: so many are late, and all others come at once."""
    senses = run({"kind": "late", "magnitude": 0.005, "chance": 0.1})
    delays = {p.t: s.t - p.t for s in senses for p in s.points}
    assert len(delays) >= TICKS - 5
    late = [delay for delay in delays.values() if delay > 1e-9]
    assert late == pytest.approx([0.005] * len(late))
    assert 0.05 < len(late) / len(delays) < 0.16


def test_a_late_frame_gives_way_to_a_newer_one_of_its_camera() -> None:
    """Nothing waits behind it: what comes in a tick is the newest that is due."""
    senses = run({"kind": "late", "magnitude": 0.005, "chance": 0.2}, pixels=True)
    for k, s in enumerate(senses):
        for frame in s.frames:
            assert k - frame.number in (0, 5)
        assert len({frame.camera for frame in s.frames}) == len(s.frames)
    on_time = sum(s.frames[0].number == k for k, s in enumerate(senses) if s.frames)
    assert 0.7 < on_time / TICKS < 0.9


@pytest.mark.parametrize("pixels", [True, False])
def test_a_latency_that_ends_is_over_after_its_delay(pixels: bool) -> None:
    """20 ms of it from 0.10 to 0.15 s: the last late one comes at 0.17 s, beside a new one."""
    fault = {"kind": "latency", "magnitude": 0.02, "start": 0.1, "length": 0.05}
    senses = run(fault, pixels=pixels)
    for k, s in enumerate(senses):
        stamps = [*(frame.t for frame in s.frames), *(point.t for point in s.points)]
        if 100 <= k < 120:
            assert not stamps
        else:
            assert max(stamps) == pytest.approx(s.t - (0.02 if 120 <= k < 150 else 0.0))
    waited = [p.t for s in senses[150:170] for p in s.points if p.t < s.t - 1e-9]
    assert pixels or len(waited) == 20
    assert not any(len(s.points) > 1 for s in senses[170:])


def test_duplicates_repeat_the_frame_before() -> None:
    numbers = [
        s.frames[0].number for s in run({"kind": "duplicate", "magnitude": 0.3}, pixels=True)
    ]
    steps = np.diff(numbers)
    assert steps.min() == 0
    assert 0.2 < np.mean(steps == 0) < 0.4


@pytest.mark.parametrize("where", ["points", "stamps", "encoders"])
def test_nan_stands_where_it_is_told_to(where: str) -> None:
    senses = run({"kind": "nan", "where": where, "magnitude": 0.5})
    wrong = {
        "points": [bool(np.isnan(s.points[0].r_o).any()) for s in senses],
        "stamps": [bool(np.isnan(s.points[0].t)) for s in senses],
        "encoders": [bool(np.isnan(s.arm.q).any()) for s in senses],
    }
    for place, hits in wrong.items():
        assert (0.4 < np.mean(hits) < 0.6) if place == where else not any(hits)


@pytest.mark.parametrize("clock", ["tick", "camera"])
def test_a_clock_jumps_and_jumps_back(clock: str) -> None:
    senses = run(
        {"kind": "clock", "clock": clock, "magnitude": -3600.0, "start": 0.1, "length": 0.1},
        pixels=True,
    )
    for k in (99, 100, 199, 200):
        off = -3600.0 if 100 <= k < 200 else 0.0
        assert senses[k].frames[0].t == pytest.approx(k * TICK + off)
        assert senses[k].t == pytest.approx(k * TICK + (off if clock == "tick" else 0.0))


def test_encoders_lie_as_they_are_told_and_their_speed_follows() -> None:
    def joint(fault: str, magnitude: float = 0.25) -> tuple[Array, Array]:
        senses = run(
            {"kind": "encoder", "fault": fault, "joint": 1, "magnitude": magnitude, "start": 0.1}
        )
        assert all(s.arm.q[0] == pytest.approx(s.t) for s in senses)
        return np.array([s.arm.q[1] for s in senses]), np.array([s.arm.dq[1] for s in senses])

    t = TICK * np.arange(TICKS)
    q, dq = joint("stuck")
    assert np.all(q[100:] == q[99])
    assert not dq[100:].any()
    q, dq = joint("jump")
    np.testing.assert_allclose(q[100:], t[100:] + 0.25)
    assert dq[100] == pytest.approx(251.0)
    assert dq[101] == pytest.approx(1.0)
    q, dq = joint("dropout")
    assert np.isnan(q[100:]).all()
    assert np.isnan(dq[100:]).all()
    q, _ = joint("sign")
    np.testing.assert_allclose(q[100:], -t[100:])
    q, _ = joint("step", 0.01)
    np.testing.assert_allclose(q[100:] / 0.01, np.rint(q[100:] / 0.01), atol=1e-9)


def test_calibration_errors_move_cameras_by_the_size_they_say() -> None:
    rig = fixed_rig()
    assert true_rig(rig, (), np.random.default_rng(0)).cameras == rig.cameras
    off = []
    for seed in range(200):
        (fault,) = plan_of({"kind": "calibration", "part": "focal", "magnitude": 0.02})
        wrong = true_rig(rig, (fault,), np.random.default_rng(seed))
        off += [c.f_px / d.f_px - 1.0 for c, d in zip(wrong.cameras, rig.cameras, strict=True)]
    assert 0.017 < np.std(off) < 0.023


def test_calibration_of_angles_keeps_places_and_of_places_keeps_angles() -> None:
    rig = fixed_rig()
    for part, kept in (("angles", "centre"), ("place", "rotation")):
        (fault,) = plan_of({"kind": "calibration", "part": part, "magnitude": 0.02})
        wrong = true_rig(rig, (fault,), np.random.default_rng(1))
        for a, b in zip(wrong.cameras, rig.cameras, strict=True):
            first, second = (c.centre if kept == "centre" else c.rotation for c in (a, b))
            np.testing.assert_array_equal(first, second)
            assert np.abs(a.T_world_cam - b.T_world_cam).max() > 1e-4


def test_weak_motors_give_a_share_of_their_limit_and_no_more(arm: Arm) -> None:
    wire = faults_of(plan_of({"kind": "torque", "magnitude": 0.5, "start": 0.1}), arm=arm)
    rest = np.zeros(3)
    strong = still(0.0)._replace(joints=np.array([rest, rest, rest, [1e3, -1e3, 1.0]]))
    np.testing.assert_array_equal(wire.command(0.0, strong).tau, strong.tau)
    bound = 0.5 * arm.limits.tau_peak[list(arm.model.active)]
    np.testing.assert_allclose(wire.command(0.2, strong).tau, [bound[0], -bound[1], 1.0])


def test_weak_motors_need_to_know_the_limits() -> None:
    with pytest.raises(InputError, match="limits"):
        faults_of(plan_of({"kind": "torque"}))


def test_commands_come_late_or_not_at_all() -> None:
    wire = faults_of(plan_of({"kind": "command", "magnitude": 0.005}))
    hands = [wire.command(k * TICK, still(0.0)._replace(hand=float(k))).hand for k in range(50)]
    assert hands == [max(float(k - 5), 0.0) for k in range(50)]
    lossy = faults_of(plan_of({"kind": "command", "lost": 0.5}))
    hands = [lossy.command(k * TICK, still(0.0)._replace(hand=float(k))).hand for k in range(400)]
    kept = np.diff(hands) == 0.0
    assert 0.4 < kept.mean() < 0.6


def test_an_empty_plan_leaves_the_world_as_it_was() -> None:
    np.testing.assert_array_equal(path(fly()), path(fly()))


def test_a_drag_that_nobody_told_is_that_drag() -> None:
    """A factor of 3 flies as the kernel flies with three times the coefficient."""
    ticks = 300
    wanted, _ = exactly(THROW.r, THROW.dr, drag=0.12, duration=ticks * TICK)
    given = path(fly({"kind": "drag", "magnitude": 3.0}, ticks=ticks))[-1]
    assert np.linalg.norm(given - wanted) < 2e-4
    assert np.linalg.norm(given - path(fly(ticks=ticks))[-1]) > 0.02


def test_still_air_is_no_gust_and_no_spin_no_lift() -> None:
    ways = [path(fly({"kind": k, "magnitude": 0.0}, ticks=200)) for k in ("gust", "spin")]
    for way in ways:
        np.testing.assert_allclose(way, path(fly(ticks=200)), atol=1e-9)


def test_spin_bends_the_flight_and_keeps_its_speed() -> None:
    spun, straight = fly({"kind": "spin", "magnitude": 0.1}, ticks=200), fly(ticks=200)
    gap = np.linalg.norm(path(spun)[-1] - path(straight)[-1])
    assert gap > 0.01
    speeds = [
        np.linalg.norm(w.trace().dr_o[-1])
        + 9.81 / np.linalg.norm(w.trace().dr_o[-1]) * (w.trace().r_o[-1, 2])
        for w in (spun, straight)
    ]
    assert speeds[0] == pytest.approx(speeds[1], rel=0.02)


@pytest.mark.parametrize("size", [0.5, 2.0])
def test_a_kick_changes_the_velocity_by_its_size_at_its_time(size: float) -> None:
    kicked, plain = fly({"kind": "kick", "magnitude": size}), fly()
    jumps = np.linalg.norm(np.diff(kicked.trace().dr_o - plain.trace().dr_o, axis=0), axis=1)
    k = int(np.argmax(jumps))
    assert jumps[k] == pytest.approx(size, rel=1e-3)
    assert np.delete(jumps, k).max() < 0.02 * size
    np.testing.assert_allclose(path(kicked)[:k], path(plain)[:k], rtol=0.0, atol=1e-14)


def test_a_plate_turns_the_normal_velocity_back_and_leaves_the_other() -> None:
    angle, e = 0.2, 0.6
    bounced = fly({"kind": "bounce", "magnitude": angle, "restitution": e})
    dr = bounced.trace().dr_o
    k = int(np.argmax(np.linalg.norm(np.diff(dr, axis=0), axis=1)))
    change, speed = np.linalg.norm(dr[k + 1] - dr[k]), np.linalg.norm(dr[k])
    assert change == pytest.approx((1.0 + e) * speed * np.sin(angle), rel=0.02)


def test_a_ball_passes_a_plate_that_it_does_not_meet() -> None:
    """The plate is so small that a flight kicked aside before it goes by."""
    faults = (
        {"kind": "kick", "magnitude": 3.0, "share": 0.2},
        {"kind": "bounce", "share": 0.6, "size": 0.01},
    )
    np.testing.assert_allclose(path(fly(*faults)), path(fly(faults[0])), atol=1e-12)


@pytest.mark.parametrize(
    "fault",
    [
        {"kind": "kick", "magnitude": 2.0},
        {"kind": "bounce"},
        {"kind": "gust", "magnitude": 8.0},
        {"kind": "spin", "magnitude": 0.05},
        {"kind": "drag", "magnitude": 3.0},
        {"kind": "spring"},
        {"kind": "carried"},
        {"kind": "flutter"},
        {"kind": "elastic"},
        {"kind": "light"},
    ],
    ids=lambda fault: str(fault["kind"]),
)
def test_the_flight_beforehand_is_the_flight_that_then_happens(fault: dict[str, object]) -> None:
    """To the bit at each tick, until anything is touched."""
    world = fly(fault, ticks=400)
    trace = world.trace()
    ticks = int(np.argmax(trace.seen != 0)) or len(trace.t)
    rehearsed = _faults_of(plan_of(fault)).untouched_flight(0.04)
    assert ticks > 200
    assert np.array_equal(rehearsed.r[:ticks], trace.r_o[:ticks])


def _faults_of(plan: tuple[AnyFault, ...]) -> ActiveFaults:
    """Return the faults that a world of :func:`fly` had."""
    start = _world(exact_scene())
    start.reset(THROW, 7)
    flight = Undisturbed(ball=THROW, drag=0.04, hand=start.truth().position)
    return ActiveFaults(plan, 7, DisturbedTrial(flight, None, (0, 1, 2)))


def test_a_payload_weighs_on_the_hand() -> None:
    heavy, light = fly({"kind": "payload", "magnitude": 2.0}, ticks=1), fly(ticks=1)
    assert heavy.model.body_mass.sum() - light.model.body_mass.sum() == pytest.approx(2.0)


@pytest.mark.parametrize("kind", ["spring", "carried"])
def test_a_led_ball_moves_as_its_velocity_says_and_not_as_a_throw(kind: str) -> None:
    ball = faults_of(plan_of({"kind": kind})).ball
    assert not isinstance(ball, Throw)
    for t in np.linspace(0.01, 1.2, 50):
        slope = (ball.at(t + 1e-6)[0] - ball.at(t - 1e-6)[0]) / 2e-6
        np.testing.assert_allclose(ball.at(t)[1], slope, atol=1e-6)
    np.testing.assert_allclose(ball.at(0.0)[1], 0.0, atol=1e-12)


def test_a_spring_passes_its_middle_at_the_speed_it_says() -> None:
    ball = faults_of(plan_of({"kind": "spring", "magnitude": 4.0})).ball
    assert not isinstance(ball, Throw)
    speeds = [np.linalg.norm(ball.at(t)[1]) for t in np.arange(0.0, 2.0, 1e-3)]
    assert max(speeds) == pytest.approx(4.0, rel=1e-4)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ('kind = "sneeze"', "kick"),
        ('kind = "kick"', "wanted a value, got none"),
        ('kind = "kick"\nmagnitude = -1.0', "greater than or equal to 0"),
        ('kind = "kick"\nmagnitude = nan', "finite"),
        ('kind = "kick"\nmagnitude = 1.0\nwhen = 2.0', "share"),
        ('kind = "encoder"\nfault = "step"\nmagnitude = 0.0', "above 0"),
    ],
)
def test_a_fault_that_cannot_be_meant_is_refused_in_one_line(
    tmp_path: Path, text: str, word: str
) -> None:
    file = tmp_path / "scene.toml"
    file.write_text(f"[[faults]]\n{text}\n")
    with pytest.raises(InputError, match=word) as refused:
        read_scene(file)
    assert "\n" not in str(refused.value)
    assert str(file) in str(refused.value)


def test_a_late_kick_comes_so_long_before_the_ball_is_nearest() -> None:
    """Drawn between two times: within them, and not always at the same."""
    seen = []
    for seed in range(20):
        plan = plan_of(
            {"kind": "kick", "magnitude": 2.0, "share": 1.0, "before": 0.15, "later": 0.1}
        )
        flight = Undisturbed(ball=THROW, drag=0.04, hand=np.array([0.8, 0.0, 0.0]))
        path = ActiveFaults(plan, seed, DisturbedTrial(flight, None, ())).untouched_flight(0.04)
        off = [np.linalg.norm(path.dr[k] - flight.at(k * TICK)[1]) for k in range(len(path.r))]
        seen.append(flight.nearest() - int(np.argmax(np.array(off) > 0.5)) * TICK)
    assert 0.05 - 2 * TICK <= min(seen) < 0.08
    assert 0.12 < max(seen) <= 0.15 + 2 * TICK


def test_a_flutter_has_the_acceleration_and_the_memory_that_it_says() -> None:
    """Without the pull: its standard deviation, and what is left after a correlation time."""
    found = []
    for seed in range(40):
        fault = {"kind": "flutter", "magnitude": 20.0, "correlation": 0.05, "pull": 0.0}
        flight = Undisturbed(ball=THROW, drag=0.04, hand=np.array([0.8, 0.0, 0.0]))
        ball = ActiveFaults(plan_of(fault), seed, DisturbedTrial(flight, None, ())).ball
        assert not isinstance(ball, Throw)
        times = np.arange(0.15, 1.5, TICK)
        dr = np.array([ball.at(t)[1] - flight.at(t)[1] for t in times])
        found.append(np.diff(dr, axis=0) / TICK)
    ddr = np.array(found)
    assert np.std(ddr) == pytest.approx(20.0, rel=0.06)
    later = np.mean(ddr[:, :-50] * ddr[:, 50:]) / np.mean(ddr**2)
    assert later == pytest.approx(np.exp(-1.0), abs=0.08)


def test_a_flutter_stays_about_its_path() -> None:
    """The pull keeps it within reach of what it flutters about, and it starts there."""
    for seed in range(10):
        flight = Undisturbed(ball=THROW, drag=0.04, hand=np.array([0.8, 0.0, 0.0]))
        ball = ActiveFaults(
            plan_of({"kind": "flutter"}), seed, DisturbedTrial(flight, None, ())
        ).ball
        assert not isinstance(ball, Throw)
        off = [np.linalg.norm(ball.at(t)[0] - flight.at(t)[0]) for t in np.arange(0.0, 1.5, 0.01)]
        assert off[0] == 0.0
        assert 0.02 < max(off) < 0.6


@pytest.mark.parametrize("kind", ["elastic", "light"])
def test_what_flies_otherwise_still_passes_where_the_throw_did(kind: str) -> None:
    """Within a hand of it, so that methods are compared and not luck."""
    for seed in range(5):
        flight = Undisturbed(ball=THROW, drag=0.04, hand=np.array([0.8, 0.0, 0.0]))
        ball = ActiveFaults(plan_of({"kind": kind}), seed, DisturbedTrial(flight, None, ())).ball
        assert not isinstance(ball, Throw)
        goal = flight.at(flight.nearest())[0]
        gaps = [np.linalg.norm(ball.at(t)[0] - goal) for t in np.arange(0.0, 1.5, TICK)]
        assert min(gaps) < 0.1
        other = [np.linalg.norm(ball.at(t)[0] - flight.at(t)[0]) for t in (0.3, 0.4)]
        assert max(other) > 0.02


def test_a_slack_string_pulls_at_nothing() -> None:
    """Only aiming, which ends at the goal itself, remains."""
    fault = {"kind": "elastic", "slack": 1.0, "slackest": 1.0}
    flight = Undisturbed(ball=THROW, drag=0.04, hand=np.array([0.8, 0.0, 0.0]))
    ball = ActiveFaults(plan_of(fault), 1, DisturbedTrial(flight, None, ())).ball
    assert not isinstance(ball, Throw)
    for t in (0.1, 0.3):
        np.testing.assert_allclose(ball.at(t)[0], flight.at(t)[0], atol=5e-3)
