"""What a caught ball does to the arm: momentum, room below the speed limits, brake, fingers."""

from dataclasses import replace

import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.arm.basket import Basket
from mitt.core.arm.catch import CaughtBall
from mitt.core.arm.hands import HandModel
from mitt.core.arm.limits import joint_level
from mitt.core.control.envelope import bounds_of
from mitt.core.signals import Array
from mitt.core.verdict.feasibility import Approach, Outcome, Verdict
from mitt.core.verdict.impact import examined, gap_at_catch, shares_after, speed_caps, speed_jump
from mitt.io.load import build_arm

#: Arithmetic of an impulse [kg m/s].
EXACT = 1e-9
#: What the rounds in which cap and impact agree leave [rad/s].
ROUNDED = 2e-3
#: Bandwidth of the tracking [rad/s].
BANDWIDTH = 80.0
Q = np.array([0.2, 1.2, 0.6])
V = np.array([-5.0, 0.4, -1.0])


@pytest.fixture(scope="module")
def motors() -> Arm:
    """The arm with its 48 V motors."""
    return build_arm("wam", limits="wam-48v")


def approach(q: np.ndarray, dq: np.ndarray, dr_o: np.ndarray) -> Approach:
    """Return a steady motion that ends in q, dq."""
    t = np.linspace(-0.48, 0.0, 25)
    rows = np.zeros((25, 3, len(q)))
    rows[:, 0], rows[:, 1] = q + t[:, None] * dq, dq
    return Approach(motion=rows, step=0.02, dr_o=dr_o)


def ball(mass: float) -> CaughtBall:
    """Return a ball of a known mass [kg]."""
    return CaughtBall(mass=mass, radius=0.04, doubt=0.0)


@pytest.mark.parametrize("mass", [0.02, 0.5, 2.0])
def test_momentum_is_kept_and_the_ball_sticks(motors: Arm, mass: float) -> None:
    """Along every direction that the arm can move, M times the jump is what the ball gives."""
    J, M = motors.jacobian(Q), motors.mass_matrix(Q)
    jump = speed_jump(motors, Q, V, mass)
    lost = mass * (V - J @ jump)  # the ball then moves as the hand does
    assert np.allclose(M @ jump, J.T @ lost, atol=EXACT)


def test_an_impact_is_that_of_two_bodies_with_a_constraint(motors: Arm) -> None:
    """The jump is that of a joint system of arm and ball whose velocities must agree (KKT)."""
    mass, J = 0.5, motors.jacobian(Q)
    M = motors.mass_matrix(Q)
    whole = np.zeros((6, 6))
    whole[:3, :3], whole[3:, 3:] = M, mass * np.eye(3)
    constraint = np.hstack([J, -np.eye(3)])
    before = np.concatenate([np.zeros(3), V])
    system = np.block([[whole, constraint.T], [constraint, np.zeros((3, 3))]])
    after = np.linalg.solve(system, np.concatenate([whole @ before, np.zeros(3)]))
    assert np.allclose(speed_jump(motors, Q, V, mass), after[:3], atol=EXACT)


def test_caps_leave_room_for_the_impact(motors: Arm) -> None:
    """A joint that the ball drives on stays below its limit with the jump on top of its cap."""
    fastest = bounds_of(motors)["dq_max"]
    dq = np.array([0.0, 0.5, 0.99 * motors.dq_max[2]])
    relative = np.array([-7.5, 0.3, 1.3])  # as of a ball of 9 m/s that a throw brought
    for mass in (0.07, 0.15, 0.25):
        caps = speed_caps(motors, approach(Q, dq, relative + motors.jacobian(Q) @ dq), ball(mass))
        slower = relative + motors.jacobian(Q) @ (dq - np.clip(dq, -caps, caps))
        jump = 1.2 * speed_jump(motors, Q, slower, mass)
        assert caps[2] + abs(jump[2]) <= motors.dq_max[2] + ROUNDED
        assert np.all(caps <= fastest)
        assert caps[2] < fastest[2] - 0.01


def test_a_joint_is_not_slowed_without_end(motors: Arm) -> None:
    """Where 0.7 of its speed leave no room the caps end and the impact itself is refused."""
    dq = np.array([0.0, 0.5, 0.99 * motors.dq_max[2]])
    way = approach(Q, dq, np.array([-7.5, 0.3, 1.3]) + motors.jacobian(Q) @ dq)
    caps = speed_caps(motors, way, ball(0.5))
    assert caps[2] == pytest.approx(0.7 * bounds_of(motors)["dq_max"][2])
    assert shares_after(motors, way, ball(0.5))["impact:j4"] > 1.0


def test_a_joint_that_would_run_out_of_room_to_brake_is_kept_slower(arm: Arm) -> None:
    """With half a kilogram at the hand it comes to rest within nine tenths of the way."""
    q, dq = np.array([0.0, 0.6, 1.63]), np.array([0.0, -2.0, 15.8])
    way = approach(q, dq, arm.jacobian(q) @ dq)
    caps = speed_caps(arm, way, ball(0.5))
    assert caps[2] < 0.95 * dq[2]
    assert shares_after(arm, way, ball(0.5))["brake:j4"] < 0.91
    assert speed_caps(arm, way, ball(0.03))[2] > dq[2]


def test_a_ball_that_slows_a_joint_down_needs_no_room(motors: Arm) -> None:
    """Where the impact is against the motion, the joint keeps its whole speed."""
    dq = np.array([0.0, 0.5, -0.99 * motors.dq_max[2]])
    relative = np.array([-7.5, 0.3, 1.3])
    dr_o = relative + motors.jacobian(Q) @ dq
    caps = speed_caps(motors, approach(Q, dq, dr_o), ball(0.2))
    assert caps[2] == bounds_of(motors)["dq_max"][2]


def test_heavier_balls_ask_for_more(motors: Arm) -> None:
    """The pull on the fingers rises with the mass; 70 g pass all limits, 2.5 kg do not."""
    way = approach(Q, np.array([0.0, 0.5, 3.5]), V)
    shares = [shares_after(motors, way, ball(mass)) for mass in (0.07, 0.5, 1.0, 2.5)]
    pulls = [share["grip"] for share in shares]
    assert pulls == sorted(pulls)
    assert pulls[1] < 1.0 < pulls[3]
    assert max(shares[0].values()) < 1.0 < max(shares[-1].values())


def test_a_refusal_names_what_binds_and_a_pass_keeps_the_verdict(motors: Arm) -> None:
    """2 kg at 5 m/s are refused, by force or else; 70 g pass; refusals stay as they are."""
    way = approach(Q, np.array([0.0, 0.5, 3.5]), V)
    given = Verdict(
        outcome=Outcome.FEASIBLE,
        binding_limit="range:j4",
        share=0.9,
        t_catch=0.5,
        sigma=0.001,
        approach=way,
    )
    refused = examined(motors, given, ball(2.0), bandwidth=BANDWIDTH)
    assert refused.outcome is Outcome.UNREACHABLE
    assert refused.binding_limit.split(":")[0] in ("impact", "brake", "grip", "force")
    assert refused.margin < 0.0
    assert examined(motors, given, ball(0.07), bandwidth=BANDWIDTH).outcome is Outcome.FEASIBLE
    blind = replace(given, approach=None)
    assert examined(motors, blind, ball(2.0), bandwidth=BANDWIDTH) is blind
    by_choice = replace(given, outcome=Outcome.UNREACHABLE)  # a generator's own, below every limit
    assert examined(motors, by_choice, ball(0.07), bandwidth=BANDWIDTH) is by_choice


def test_a_refusal_for_torque_is_run_on_the_model(motors: Arm) -> None:
    """A verdict that refused for a share of 50 is feasible where the arm is in time; not else."""
    slow = approach(Q, np.array([0.0, 0.1, 0.2]), np.array([-5.0, 0.0, 0.0]))
    refused = Verdict(
        outcome=Outcome.UNREACHABLE,
        binding_limit="torque:j4",
        share=50.0,
        t_catch=0.5,
        sigma=0.001,
        approach=slow,
    )
    assert examined(motors, refused, ball(0.07), bandwidth=BANDWIDTH).outcome is Outcome.FEASIBLE
    fast = approach(Q, np.array([5.0, 0.0, 0.0]), np.array([-5.0, 0.0, 0.0]))
    late = examined(motors, replace(refused, approach=fast), ball(0.07), bandwidth=BANDWIDTH)
    assert late.outcome is Outcome.UNREACHABLE
    assert late.share > 1.0


def test_fingers_hold_more_with_friction() -> None:
    """Without friction they pull by their slant alone; a hand that slips holds less."""
    hand = HandModel()
    forces = [hand.holding_force(0.04, friction) for friction in (0.0, 0.3, 1.0)]
    assert 0.0 < forces[0] < forces[1] < forces[2]
    strong = replace(hand, drive=replace(hand.drive, tau_max=2.0 * hand.drive.tau_max))
    assert strong.holding_force(0.04, 1.0) == pytest.approx(2.0 * forces[2])


def test_a_ball_from_behind_the_palm_is_refused(motors: Arm) -> None:
    """From in front none is; from the side nearly; at less than 1 m/s it may come from anywhere."""
    still, normal = np.zeros(3), motors.orientation(Q)[:, 2]
    side = np.cross(normal, [0.0, 0.0, 1.0]) / np.linalg.norm(np.cross(normal, [0.0, 0.0, 1.0]))

    def palm(angle: float, speed: float) -> float:
        """Return the share for a ball at so many degrees off the normal."""
        a = np.deg2rad(angle)
        v = -speed * (np.cos(a) * normal + np.sin(a) * side)
        return shares_after(motors, approach(Q, still, v), ball(0.07))["palm"]

    shares = [palm(angle, 3.0) for angle in (0.0, 30.0, 60.0, 90.0, 100.0, 120.0)]
    assert shares == sorted(shares)
    assert shares[0] == pytest.approx(0.0, abs=EXACT)
    assert shares[3] < 1.0 < shares[5]
    assert shares[4] == pytest.approx(1.0, abs=EXACT)
    assert palm(120.0, 0.5) == pytest.approx(0.5 * shares[5])
    assert palm(120.0, 0.5) < 1.0


def test_a_basket_that_comes_to_rest_facing_down_spills(motors: Arm) -> None:
    """Its share is beyond any; one that faces up, with the arm at rest, keeps the ball."""
    baskets = [build_arm("wam", limits="wam-80v", hand=Basket(tilt=x)) for x in (0.0, -np.pi / 2)]
    q, still = np.array([0.0, 0.9, 1.4]), np.zeros(3)
    down, up = (shares_after(a, approach(q, still, still), ball(0.07)) for a in baskets)
    assert baskets[0].orientation(q)[2, 2] < 0.0 < baskets[1].orientation(q)[2, 2]
    assert down["spill"] > 1.0
    assert up["spill"] == pytest.approx(0.0, abs=1e-3)
    assert "grip" not in up
    assert "spill" not in shares_after(motors, approach(q, still, still), ball(0.07))


#: A motion within all limits is followed as closely as this [m].
CLOSE = 1e-3


@pytest.fixture(scope="module")
def strong() -> Arm:
    """The arm with its 80 V motors."""
    return build_arm("wam", limits="wam-80v")


def swing(arm: Arm, way: Array, duration: float) -> Approach:
    """Return a motion from rest in the ready pose, 10 x^3 - 15 x^4 + 6 x^5 of twice a way [rad].

    It ends half-way, where it is fastest.
    """
    x = np.linspace(0.0, 0.5, 25)[:, None]
    t = 2.0 * duration
    rows = [
        arm.q_ready + 2.0 * way * (10 * x**3 - 15 * x**4 + 6 * x**5),
        2.0 * way / t * (30 * x**2 - 60 * x**3 + 30 * x**4),
        2.0 * way / t**2 * (60 * x - 180 * x**2 + 120 * x**3),
    ]
    return Approach(motion=np.stack(rows, axis=1), step=duration / 24, dr_o=np.zeros(3))


def test_a_motion_within_the_limits_is_followed(strong: Arm) -> None:
    """The hand is at its place, but for what is between the instants."""
    approach = swing(strong, np.array([0.2, 0.2, 0.8]), 0.4)
    assert gap_at_catch(strong, approach, strong.dq_max, BANDWIDTH) < CLOSE


def test_a_little_too_fast_is_a_little_late(strong: Arm) -> None:
    """3 % beyond the no-load speed asks for a multiple of the torque left, but costs little way."""
    approach = swing(strong, np.array([0.0, 0.0, 1.0]), 0.2)
    fastest = float(np.abs(approach.motion[:, 1, 2]).max())
    few = swing(strong, np.array([0.0, 0.0, 1.03 * strong.dq_max[2] / fastest]), 0.2)
    much = swing(strong, np.array([0.0, 0.0, 2.0 * strong.dq_max[2] / fastest]), 0.2)
    assert gap_at_catch(strong, few, strong.dq_max, BANDWIDTH) < 0.03
    assert gap_at_catch(strong, much, strong.dq_max, BANDWIDTH) > 0.1


def test_torque_beyond_all_limits_leaves_the_hand_behind(strong: Arm) -> None:
    """0.6 rad of joint 1 in 60 ms are beyond any motor."""
    approach = swing(strong, np.array([0.3, 0.0, 0.0]), 0.06)
    assert gap_at_catch(strong, approach, strong.dq_max, BANDWIDTH) > 0.05


def test_what_a_weak_arm_cannot_follow_it_misses() -> None:
    """With limits of speed alone out of the way, torque makes the hand late: eq. (14) is obeyed."""
    strong = build_arm("wam", limits="paper")
    tau = np.array([8.0, 60.0, 60.0, 9.0])
    weak = Arm(strong.model, joint_level("weak", tau=tau, speed=np.full(4, 50.0)))
    approach = swing(strong, np.array([0.5, 0.0, 1.0]), 0.25)
    gaps = [gap_at_catch(arm, approach, np.full(3, 50.0), BANDWIDTH) for arm in (strong, weak)]
    assert gaps[0] < CLOSE < 0.05 < gaps[1]


def test_caps_make_a_fast_motion_late(strong: Arm) -> None:
    """A joint kept at half of its speed cannot be where a faster one would be."""
    approach = swing(strong, np.array([0.0, 0.0, 1.0]), 0.25)
    fast = bounds_of(strong)["dq_max"]
    gaps = [gap_at_catch(strong, approach, share * fast, BANDWIDTH) for share in (1.0, 0.5)]
    assert gaps[0] < CLOSE < 0.02 < gaps[1]
