"""A small dose of the fuzzing: envelope and readers; ``make soak`` gives large ones."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.catcher.catcher import Phase
from mitt.core.control.envelope import bounds_of
from mitt.core.map.learn import Learned
from mitt.core.signals import TICK
from soak import commands, files, judge, kills, swings, ticks
from soak.mutants import mutant


def test_no_adversarial_command_breaks_a_rule() -> None:
    """A million wishes, finite or not, from states inside and outside: no rule is broken."""
    count = commands.soak(1_000_000, seed=20020708)
    assert count.violations == count.non_finite == 0
    assert 0.02 < count.outside / count.commands < 0.5
    assert 0.2 < count.changed / count.commands < 0.95


@pytest.mark.parametrize(
    "motion",
    [
        (0.021, 0.0, 0.0),  # moves faster than its speed limit
        (0.0, 0.31, 0.0),  # changes its speed by more than its acceleration limit
        (0.0, 0.0, 301.0),  # says an acceleration beyond the limit
        (1.0001, 0.0, 0.0),  # leaves its range
    ],
)
def test_the_rule_sees_what_breaks_it(motion: tuple[float, float, float]) -> None:
    """The independent rule is able to fail: each limit, broken by a little, is noticed."""
    b = np.array([-1.0, 1.0, 20.0, 200.0, 300.0])
    start = 0.99 if motion[0] > 1.0 else 0.0
    assert commands.obeys(b, start, 0.0, start, 0.0, 0.0)
    assert not commands.obeys(b, start, 0.0, *motion)


@pytest.mark.parametrize(
    "motion",
    [
        (1e-7, 2e-4, 0.3),  # steps in acceleration by more than its jerk limit
        (0.0, 2e-4, 0.2),  # is no motion: the place does not go with the speed
        (1e-7, 0.0, 0.2),  # nor the speed with the acceleration
    ],
)
def test_the_rule_of_smooth_joints_sees_what_breaks_it(motion: tuple[float, float, float]) -> None:
    """At rest, with 200 rad/s^3: each broken by a little is noticed."""
    b, rest = np.array([-1.0, 1.0, 20.0, 200.0, 300.0]), (0.0, 0.0, 0.0)
    assert commands.obeys_smooth(b, 200.0, rest, (1e-7, 2e-4, 0.2))
    assert not commands.obeys_smooth(b, 200.0, rest, motion)


def test_the_rule_sees_a_joint_that_cannot_stop() -> None:
    """A speed from which the range does not suffice to stop breaks the rule."""
    b = np.array([-1.0, 1.0, 20.0, 200.0, 300.0])
    assert commands.obeys(b, 0.0, 19.9, 0.0198, 19.8, 0.0)
    assert not commands.obeys(b, 0.0, 19.9, 0.0198, 19.95, 0.0)


def test_no_garbage_gets_a_tick_to_break_a_rule(learned: Learned) -> None:
    """Clock, encoders, points and images are garbage in all phases: all commands keep the rule."""
    count = ticks.soak(12_000, seed=20020708, f=learned.map)
    assert count.faults == []
    assert count.ticks == 12_000
    assert all(count.phases[phase.value] > 100 for phase in Phase)
    assert {"nominal", "predict", "degraded", "abort"} <= set(count.states)
    assert count.recovered > 10


def test_command_and_arm_stay_clear_and_in_range(learned: Learned, arm: Arm) -> None:
    """Throws to the WAM, balls of 0.034 to 0.5 kg, random calls, exact plant and lab."""
    maps: swings.Maps = {("wam", "paper"): (arm, learned.map)}
    wam = tuple(x for x in swings.ROUND if x[:2] == ("wam", "paper"))
    made = list(swings.soak(16, seed=20020708, maps=maps, chosen=wam))
    assert swings.faults(made) == ([], [])
    assert sum(x.caught for x in made) >= 4


def test_a_throw_in_which_command_or_arm_came_too_near_is_told() -> None:
    """Each of the four bounds, broken by a little; command and arm apart."""
    fine = swings.Swing("wam", "exact", 0, "brake", True, 0.0101, 0.0101, 0.001, 0.001)
    assert swings.faults([fine]) == ([], [])
    for bad in (replace(fine, command=0.0099), replace(fine, command_end=-1e-4)):
        assert [len(x) for x in swings.faults([bad])] == [1, 0]
    for bad in (replace(fine, itself=0.0099), replace(fine, itself_end=-1e-4)):
        assert [len(x) for x in swings.faults([bad])] == [0, 1]


def test_the_rule_of_ticks_sees_what_breaks_it(arm: Arm) -> None:
    """More torque than a drive has, and a joint that speeds up outside its range, are noticed."""
    still = np.zeros(arm.n)
    assert not judge.too_strong(arm, arm.tau_max, still)
    assert judge.too_strong(arm, 1.001 * arm.tau_max, still)
    b, last = judge.rows_of(bounds_of(arm)), np.array([arm.q_max + 0.2, still])
    resting, faster = (np.array([last[0], x * np.ones(arm.n), still]) for x in (0.0, 0.01))
    assert judge.breaks(b, last, resting, True) == -1
    assert judge.breaks(b, last, resting, False) == 0
    assert judge.breaks(b, last, faster, True) == 0


@pytest.mark.parametrize("share", [1.0, 0.5, 0.0])
def test_a_joint_outside_may_brake_but_not_dawdle(arm: Arm, share: float) -> None:
    """Beyond its range, the way blocked: it brakes at its deceleration; less breaks the rule."""
    b, dq = judge.rows_of(bounds_of(arm)), 2.0 * np.ones(arm.n)
    last = np.array([arm.q_max + 0.2, dq])
    slower = dq - share * b[3] * TICK
    told = np.array([last[0] + 0.5 * TICK * (dq + slower), slower, -share * b[3]])
    assert judge.breaks(b, last, told, True) == (-1 if share == 1.0 else 0)
    assert judge.breaks(b, last, told, False) == 0
    jumped = told + np.array([[0.01], [0.0], [0.0]])
    assert judge.breaks(b, last, jumped, True) == 0


@pytest.mark.thorough
@pytest.mark.slow
def test_no_broken_file_gets_more_than_one_line(tmp_path: Path) -> None:
    """Mutants of a valid file for every reader: status 0 or 2, one line, no traceback."""

    def keep(name: str, data: bytes) -> None:
        (tmp_path / f"harmful-{name}").write_bytes(data)

    found = files.soak(240, seed=3, folder=tmp_path, keep=keep)
    assert found.faults == []
    assert 0.3 < found.refused / found.files < 1.0


def test_mutants_differ_and_repeat() -> None:
    """Mutants are not the valid file, and the same seed gives the same ones."""
    valid = b"x,y\n1.0,2.0\n3.0,4.0\n"
    one, two = ([mutant(valid, np.random.default_rng(5)) for _ in range(1)] for _ in range(2))
    assert one == two
    rng = np.random.default_rng(6)
    assert sum(mutant(valid, rng) != valid for _ in range(200)) > 190


@pytest.mark.thorough
@pytest.mark.slow
def test_a_process_killed_while_it_saves_leaves_whole_files(tmp_path: Path) -> None:
    """Killed at a random moment: result, page and map are the old ones or the new ones."""
    killed = kills.soak(2, seed=4, folder=tmp_path)
    assert killed.kills == 2
    assert killed.unreadable == []
