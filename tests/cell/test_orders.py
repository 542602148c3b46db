"""Commands are such as the controllers of ros2_control take; no joint gets another's number."""

from collections.abc import Sequence
from itertools import permutations
from typing import Any

import numpy as np
import pytest

from mitt.core.arm.arm import Arm
from mitt.core.errors import InputError
from mitt.core.signals import Array, Command
from mitt.io.cdr import Reader
from mitt.io.cell import Cell, arm_of, read_cell
from mitt.robot.cell import ros2_messages as messages
from mitt.robot.cell.ros2_messages import Orders, joints_of

ALL = ("j1", "j2", "j3", "j4")
TAKES = ("position", "velocity", "torque")


@pytest.fixture(scope="module")
def wam() -> Arm:
    """The arm of the shipped cell: j3 is held."""
    return arm_of(read_cell("wam-sim"))


def cell_that(takes: str, joints: list[str] | None = None) -> Cell:
    """Return the shipped cell with other drives."""
    cell = read_cell("wam-sim")
    robot = cell.robot.model_copy(update={"takes": takes, "joints": joints})
    return cell.model_copy(update={"robot": robot})


def orders(takes: str, arm: Arm, joints: list[str] | None = None, **options: str) -> Orders:
    """Return commands of a cell with some options."""
    of = {
        "command": "/c/joint_trajectory",
        "controller": "",
        "hand": "",
        "hand_command": "/h/commands",
    } | options
    return Orders(cell_that(takes, joints), arm, of)


def command(rows: Array, hand: float = 0.0) -> Command:
    """Return a command."""
    return Command(t=0.0, joints=rows, hand=hand)


def refused(raw: bytes, controller: Sequence[str], *, nonzero: bool) -> str:
    """Say why a joint_trajectory_controller of positions refuses a command; nothing if it takes it.

    Its rules for a topic: all its joints and no others, rows of the joints' number or empty, no
    efforts, an end that is at rest and not in the past; where the stamp is 0 it begins now.
    """
    r = Reader(raw)
    stamp, _ = r.header()
    names, count = r.strings(), r.count()
    rows = [r.sequence() for _ in range(4)]
    reach = r.uint32() + 1e-9 * r.uint32()
    if sorted(names) != sorted(controller):
        return f"joints {names}"
    if count != 1 or any(len(row) not in (0, len(names)) for row in rows) or not len(rows[0]):
        return "rows"
    if len(rows[3]):
        return "efforts"
    if np.any(rows[1] != 0.0) and not nonzero:
        return "not at rest at the end"
    return "in the past" if stamp != 0.0 or not reach > 0.0 else ""


@pytest.mark.parametrize("takes", ["position", "velocity"])
def test_a_trajectory_is_one_that_the_standard_controller_takes(takes: str, wam: Arm) -> None:
    """Whatever is commanded; of velocities with the setting that is said to be needed."""
    of = orders(takes, wam, hand="finger")
    rng = np.random.default_rng(1)
    for _ in range(50):
        told = command(rng.normal(size=(4, 3)), hand=float(rng.random()))
        raw = of.of_joints(told, 1.7e9 + rng.random())
        assert refused(raw, ALL, nonzero=takes == "velocity") == ""
    said = " ".join(of.wanted())
    assert "joints [j1, j2, j3, j4]" in said
    assert f"command_interfaces [{takes}]" in said
    assert ("allow_nonzero_velocity_at_trajectory_end" in said) == (takes == "velocity")
    assert "joint finger" in said


@pytest.mark.parametrize("takes", TAKES)
@pytest.mark.parametrize("plain", [True, False])
def test_each_joint_gets_its_own_number(takes: str, wam: Arm, *, plain: bool) -> None:
    """In whatever order its controller has them, and whatever the robot calls them."""
    given = ["shoulder", "lift", "elbow"]
    topic = "/c/commands" if plain else "/c/joint_trajectory"
    able = (
        ("shoulder", "lift", "elbow") if takes == "torque" else ("shoulder", "lift", "j3", "elbow")
    )
    rows = 1.0 + np.arange(12.0).reshape(4, 3)
    row = {"position": 0, "velocity": 1, "torque": 3}[takes]
    wanted = dict(zip(given, rows[row], strict=True)) | {"j3": 0.0}
    for order in permutations(able):
        of = orders(takes, wam, given, command=topic, controller=", ".join(order))
        raw = of.of_joints(command(rows), 2.5)
        if plain:
            (answers, told), names = messages.read_array(raw), order
        else:
            answers, names, point = messages.read_trajectory(raw)
            told = point[row]
        assert answers == 2.5
        assert names == order
        assert dict(zip(names, told, strict=True)) == {x: wanted[x] for x in order}
        back = of.read(raw, 0.3)
        assert back is not None
        assert np.array_equal(back.joints[row], rows[row])


def test_held_joints_are_told_where_they_are_held(wam: Arm) -> None:
    """All joints of the arm are the controller's, if nothing else is said; torques none of them."""
    assert joints_of(cell_that("position"), wam) == ALL
    for takes in TAKES:
        assert orders(takes, wam).names == (("j1", "j2", "j4") if takes == "torque" else ALL)
    for takes, said in (
        ("torque", "j1,j2,j3,j4"),
        ("position", "j1,j2"),
        ("position", "j1,j2,j4,x"),
        ("velocity", "j1,j1,j2,j4"),
    ):
        with pytest.raises(InputError, match=r"robot\.options\.controller"):
            orders(takes, wam, controller=said)


@pytest.mark.parametrize("takes", TAKES)
@pytest.mark.parametrize("plain", [True, False])
def test_what_has_other_joints_is_refused(takes: str, wam: Arm, *, plain: bool) -> None:
    """One fewer, one more, another name, no number: never taken for something else."""
    of = orders(takes, wam, command="/c/commands" if plain else "/c/joint_trajectory")
    n = len(of.names)

    def made(names: tuple[str, ...], row: Array) -> bytes:
        return (
            messages.array_message(row)
            if plain
            else messages.trajectory(1.0, names, np.tile(row, (4, 1)))
        )

    assert of.read(made(of.names, np.ones(n)), 0.0) is not None
    for bad in (
        made(of.names[:-1], np.ones(n - 1)),
        made((*of.names, "hand"), np.ones(n + 1)),
        made(of.names, np.full(n, np.nan)),
        b"",
        b"\0\1\0\0",
    ):
        assert of.read(bad, 0.0) is None
    if not plain:
        assert of.read(made((*of.names[:-1], "other"), np.ones(n)), 0.0) is None


def test_the_hand_has_a_message_of_its_own(wam: Arm) -> None:
    """When its angle is another, and now and then again: a controller may come later."""
    for topic in ("/h/commands", "/h/joint_trajectory"):
        of = orders("position", wam, hand="finger", hand_command=topic)
        angles = [0.0] * 5 + [0.5] * 50
        sent: list[Any] = [of.of_hand(command(np.zeros((4, 3)), x), 1.0) for x in angles]
        found = [k for k, raw in enumerate(sent) if raw is not None]
        assert found[:2] == [0, 5]
        assert max(np.diff(found)) <= 20
        assert [of.read_hand(sent[k]) for k in found] == [angles[k] for k in found]
    assert orders("position", wam).of_hand(command(np.zeros((4, 3)), 0.5), 1.0) is None
