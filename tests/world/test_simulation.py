"""The world: the ball flies as it should, the catcher is told what it should, trials repeat."""

import mujoco
import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.signals import TICK, Array, Command, Frame, Senses
from mitt.io.load import build_arm
from mitt.lab.world.engine import plant_of, survey
from mitt.lab.world.flights import builtin_flights, place_flight
from mitt.lab.world.imaging import Imager
from mitt.lab.world.scene import TABLE_TENNIS, Scene, Sensing, exact_scene
from mitt.lab.world.simulation import World
from mitt.lab.world.throws import Throw, fly

FLIGHT_M = 1e-6  # both fly by the same kernel, in other steps
THROW = Throw(r=np.array([3.5, 0.1, 0.3]), dr=np.array([-6.0, -0.1, 2.0]))
PAST = Throw(r=np.array([3.5, 1.5, 0.3]), dr=np.array([-6.0, 0.0, 2.0]))


def hold(arm: Arm, senses: Senses, q: Array, *, hand: float = 0.0) -> Command:
    """Return a command that holds a pose by computed torque."""
    q_now, dq_now = senses.arm.q, senses.arm.dq
    tau = arm.inverse_dynamics(q_now, dq_now, 900.0 * (q - q_now) - 60.0 * dq_now)
    return Command(t=senses.t, joints=np.array([q, 0 * q, 0 * q, tau]), hand=hand)


def run(world: World, arm: Arm, ticks: int, q: Array | None = None) -> None:
    """Hold a pose for so many ticks."""
    for _ in range(ticks):
        world.apply(hold(arm, world.sense(), arm.q_ready if q is None else q))


@pytest.fixture(name="exact", scope="module")
def _exact() -> World:
    """A world without mismatch and noise."""
    return World(exact_scene(), build_arm("wam").model)


@pytest.fixture(name="rough", scope="module")
def _rough() -> World:
    """A world with the default mismatch and noise."""
    return World(Scene(), build_arm("wam").model)


def test_a_thrown_ball_flies_as_reckoned(exact: World, arm: Arm) -> None:
    """The world's flight is Runge-Kutta's over the whole way, and the trace holds it."""
    exact.reset(PAST, 0)
    run(exact, arm, 500)
    r, dr = fly(PAST.r, PAST.dr, drag=0.04, duration=0.5)
    truth, trace = exact.truth(), exact.trace()
    assert truth.t == pytest.approx(0.5)
    assert truth.r_o == pytest.approx(r, abs=FLIGHT_M)
    assert truth.dr_o == pytest.approx(dr, abs=1e-5)
    assert len(trace.t) == 501
    assert np.array_equal(trace.r_o[0], PAST.r)
    assert np.array_equal(trace.dr_o[-1], truth.dr_o)
    assert trace.q[-1] == pytest.approx(arm.q_ready, abs=1e-3)
    assert trace.position[-1] == pytest.approx(arm.position(truth.q), abs=1e-12)
    assert exact.first_contact is None
    assert not exact.diverged
    assert not truth.touching


def test_a_trial_is_its_seed(rough: World, arm: Arm) -> None:
    """The same seed repeats a trial bit for bit, whatever was run before; another differs."""
    traces = []
    for seed in (3, 4, 3):
        rough.reset(THROW, seed)
        run(rough, arm, 300)
        traces.append(rough.trace())
    assert np.array_equal(traces[0].qpos, traces[2].qpos)
    assert np.array_equal(traces[0].tau, traces[2].tau)
    assert not np.array_equal(traces[0].qpos, traces[1].qpos)


def test_mismatch_stays_within_its_spread_and_never_adds_up(rough: World) -> None:
    """After many resets each link's mass is still within 5 % of the table; the ball's is exact."""
    before = World(exact_scene(), build_arm("wam").model).model.body_mass.copy()
    ball = rough.model.body("ball").id
    for seed in range(30):
        rough.reset(THROW, seed)
        ratio = rough.model.body_mass[1:] / np.maximum(before[1:], 1e-12)
        real = before[1:] > 0.0
        assert np.abs(ratio[real] - 1.0).max() <= 0.05
        assert rough.model.body_mass[ball] == before[ball]


def test_points_arrive_one_tick_late_with_the_time_of_their_exposure(rough: World) -> None:
    """The first tick is blind; then each point speaks of the tick before, to its noise."""
    rough.reset(THROW, 1)
    zero = np.zeros(3)
    idle = Command(t=0.0, joints=np.array([zero] * 4), hand=0.0)
    assert rough.sense().points == ()
    errors = []
    for k in range(1, 200):
        rough.apply(idle)
        (point,) = rough.sense().points
        assert point.t == pytest.approx((k - 1) * TICK, abs=1e-12)
        errors.append(point.r_o - rough.trace().r_o[k - 1])
    assert np.std(errors) == pytest.approx(0.001, rel=0.1)


class Card(Imager):
    """Cameras that write down when they were asked."""

    def __init__(self) -> None:
        """See nothing."""

    def turn(self, gaze: Array | None, duration: float) -> None:
        """Stand still."""

    def render(
        self,
        t: float,
        r_o: Array | None,
        radius: float,
        *,
        dr_o: Array | None = None,
        capsules: Array | None = None,
    ) -> tuple[Frame, ...]:
        """Return one tiny frame whose number is the tick."""
        assert dr_o is not None
        assert capsules is not None
        assert capsules.shape[1] == 8
        assert r_o is not None
        assert radius == 0.04
        pixels = np.zeros((1, 1), np.uint8)
        return (Frame(t=t, camera=0, number=round(t / TICK), pixels=pixels),)


def test_frames_are_late_by_the_latency(arm: Arm) -> None:
    """With a latency of three ticks the fourth tick delivers the first frame."""
    scene = Scene(sensing=Sensing(latency=3))
    world = World(scene, arm.model, cameras=lambda _: Card())
    world.reset(THROW, 0)
    numbers = []
    for _ in range(6):
        senses = world.sense()
        assert senses.points == ()
        numbers.append([f.number for f in senses.frames])
        world.apply(hold(arm, senses, arm.q_ready))
    assert numbers == [[], [], [], [0], [1], [2]]


@pytest.mark.parametrize("pixels", [False, True])
@pytest.mark.parametrize("rate", [30.0, 160.0, 999.0, 1000.0])
def test_frames_and_points_come_as_often_as_the_frame_rate_says(
    arm: Arm, rate: float, pixels: bool
) -> None:
    """Each comes in a tick, also where the period is no whole number of ticks: 6 or 7 at 160 Hz."""
    scene = Scene(sensing=Sensing(latency=0, frame_rate=rate))
    world = World(scene, arm.model, cameras=(lambda _: Card()) if pixels else None)
    world.reset(THROW, 0)
    seen, ticks = [], 300
    for k in range(ticks):
        senses = world.sense()
        seen += [k] * len(senses.frames + senses.points)
        assert all(x.t == senses.t for x in senses.frames + senses.points)
        world.apply(hold(arm, senses, arm.q_ready))
    assert abs(len(seen) - rate * ticks * TICK) <= 1.0
    assert set(np.diff(seen)) <= {int(1e3 / rate), int(np.ceil(1e3 / rate))}


def test_encoders_count(arm: Arm) -> None:
    """With a resolution set, positions are whole counts and velocities their differences."""
    step = 1e-4
    world = World(Scene(sensing=Sensing(encoder_step=step)), arm.model)
    world.reset(THROW, 0)
    before, zero = world.sense().arm.q, np.zeros(3)
    world.apply(Command(t=0.0, joints=np.array([zero, zero, zero, [9.0, 0, 9.0]]), hand=0.0))
    state = world.sense().arm
    assert np.rint(state.q / step) * step == pytest.approx(state.q, abs=1e-15)
    assert state.dq == pytest.approx((state.q - before) / TICK, abs=1e-9)


def test_a_recorded_flight_is_followed_until_it_is_touched(arm: Arm) -> None:
    """The ball is on the path at every tick before the first touch, and free after it."""
    world = World(exact_scene(TABLE_TENNIS), arm.model)
    catch = arm.position(arm.q_ready)
    path = place_flight(builtin_flights()[0], catch, rng=None)
    world.reset(path, 0)
    run(world, arm, 700)
    first, trace = world.first_contact, world.trace()
    assert first is not None
    before = trace.t < first.t - 1e-9
    wanted = np.array([path.at(t)[0] for t in trace.t])
    assert trace.r_o[before] == pytest.approx(wanted[before], abs=1e-12)
    assert np.linalg.norm(trace.r_o[-1] - wanted[-1]) > 0.1
    assert first.dr_o == pytest.approx(path.at(first.t)[1], abs=1e-12)


def test_the_first_contact_is_the_first_touching_step(exact: World, arm: Arm) -> None:
    """At that step the ball meets a geom of the hand by less than a step's way, not before."""
    target = arm.position(arm.q_ready)
    dr = np.array([-4.0, 0.0, -4.0])
    g = np.array([0.0, 0.0, -9.81])
    exact.reset(Throw(r=target - 0.2 * dr + 0.5 * g * 0.04, dr=dr - 0.2 * g), 0)
    run(exact, arm, 220)
    first = exact.first_contact
    assert first is not None
    data = mujoco.MjData(exact.model)
    data.qpos[:] = exact.trace().qpos[round(first.t / TICK)]
    data.qpos[6:9] = first.r_o
    mujoco.mj_kinematics(exact.model, data)
    ball = exact.model.geom("ball").id
    hand = [g for g in range(exact.model.ngeom) if exact.model.geom_contype[g] == 2]
    gaps = [mujoco.mj_geomDistance(exact.model, data, ball, g, 1.0, None) for g in hand]
    assert -np.linalg.norm(first.dr_o - first.velocity) * 0.0005 - 1e-4 < min(gaps) < 1e-4
    assert first.position_error == pytest.approx(np.linalg.norm(first.r_o - first.position))
    assert exact.peak_force > 0.0


def test_forces_are_those_that_mujoco_reports(exact: World, arm: Arm) -> None:
    """The survey's largest force is the norm of mj_contactForce, and it sees who touches."""
    exact.reset(Throw(r=np.array([1.0, 0.5, -0.90]), dr=np.array([0.0, 0.0, -2.0])), 0)
    model, data = exact.model, exact.data
    while data.ncon == 0 and exact.t < 0.1:
        run(exact, arm, 1)
    mujoco.mj_forward(model, data)
    plant, six = plant_of(model, data, 0, arm.n), np.zeros(6)
    assert data.ncon == 1
    _, largest = survey(plant, True)
    mujoco.mj_contactForce(model, data, 0, six)
    assert largest == pytest.approx(np.linalg.norm(six[:3]))
    assert exact.truth().ball_on_floor
    assert plant.touching[model.geom("floor").id]
    assert plant.touching.sum() == 1


def test_the_load_on_a_hand_is_that_of_all_its_contacts(exact: World, arm: Arm) -> None:
    """What turns the ball round within a tick, on average: at times more than any one contact."""
    rng, g, dr = np.random.default_rng(1), np.array([0.0, 0.0, -9.81]), np.array([-4.0, 0.0, -4.0])
    mass, ball, more = exact.model.body("ball").mass[0], arm.n + 3, 0
    for _ in range(12):
        target = arm.position(arm.q_ready) + 0.02 * rng.standard_normal(3)
        exact.reset(Throw(r=target - 0.2 * dr + 0.5 * g * 0.04, dr=dr - 0.2 * g), 0)
        run(exact, arm, 180)
        mean = 0.0
        for _ in range(40):
            before = exact.data.qvel[ball : ball + 3].copy()
            run(exact, arm, 1)
            change = (exact.data.qvel[ball : ball + 3] - before) / TICK - g
            mean = max(mean, mass * float(np.linalg.norm(change)))
            assert exact.peak_load >= exact.peak_force - 1e-12
        assert exact.peak_load > 0.99 * mean - 0.1
        more += exact.peak_load > 1.02 * exact.peak_force
    assert more > 0


def test_the_world_sees_the_arm_touch_itself(exact: World, arm: Arm) -> None:
    """Driven into its stop, the elbow brings arm and hand together, and that is said."""
    exact.reset(PAST, 0)
    run(exact, arm, 700, q=np.array([0.0, np.pi / 4, 3.1]))
    assert exact.truth().self_contact


@pytest.mark.parametrize("tau", [np.nan, np.inf])
def test_broken_torques_are_noticed(exact: World, tau: float) -> None:
    """A command that is no number marks the trial as diverged, and the next one is clean."""
    exact.reset(PAST, 0)
    zero = np.zeros(3)
    exact.apply(Command(t=0.0, joints=np.array([zero, zero, zero, np.full(3, tau)]), hand=0.0))
    assert exact.diverged
    exact.reset(PAST, 0)
    assert not exact.diverged


def test_an_impossible_ball_is_noticed(exact: World) -> None:
    """A ball faster than any throw means that the physics broke down."""
    exact.reset(Throw(r=PAST.r, dr=np.array([-40.0, 0.0, 0.0])), 0)
    zero = np.zeros(3)
    exact.apply(Command(t=0.0, joints=np.array([zero] * 4), hand=0.0))
    assert exact.diverged
