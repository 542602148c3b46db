"""The driver ``ros2`` in a graph of two: what fits passes, what does not is refused in one line."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from ros2_cell import NAMES, cell_with

from mitt.core.errors import InputError
from mitt.core.signals import ArmState, Command
from mitt.io.cdr import Writer
from mitt.io.cell import arm_of, cell_of, read_cell
from mitt.robot.cell import ros2_messages as messages

try:
    from mitt.robot.cell import dds
    from mitt.robot.cell import dds as types
    from mitt.robot.cell.ros2 import Ros2Cell, Ros2Robot
except InputError:
    pytest.skip("no Cyclone DDS", allow_module_level=True)

Q = np.array([0.1, 0.2, 0.3])


@pytest.fixture(autouse=True)
def domain(monkeypatch: pytest.MonkeyPatch) -> None:
    """A domain for each process that runs these tests."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(100 + os.getpid() % 60))
    monkeypatch.setattr("mitt.robot.cell.ros2._LOOK", 0.0)
    monkeypatch.setattr("mitt.robot.cell.ros2._ALONE", 0.3)


def sent(send: Callable[..., None], *words: Any) -> bool:  # noqa: ANN401
    """Send something, and say so."""
    send(*words)
    return True


def soon(what: Callable[[], Any]) -> Any:  # noqa: ANN401
    """Return what a call returns as soon as that is something."""
    for _ in range(200):
        if found := what():
            return found
        time.sleep(0.02)
    raise AssertionError("nothing came")


@pytest.fixture
def both(request: pytest.FixtureRequest) -> Iterator[tuple[Ros2Robot, Ros2Cell]]:
    """A robot's driver and the cell at the other end, which have found each other."""
    cell = cell_with(request.node.name.replace("[", "_").replace("]", "_"))
    arm = arm_of(cell)
    robot, other = Ros2Robot(cell, arm), Ros2Cell(cell, arm)
    soon(robot.listened)
    soon(lambda: sent(other.state, 1.0, Q, Q) and robot.read(0.02))
    soon(lambda: sent(other.ball, 1.0, Q) and robot.points())
    yield robot, other
    robot.close()
    other.close()


def taken(robot: Ros2Robot, names: tuple[str, ...], q: np.ndarray) -> ArmState | None:
    """Return what a robot's driver makes of a message of its one publisher."""
    said = messages.read_joint_state(messages.joint_state(1.0, names, q, np.zeros(0)))
    return robot._joints.take(said, int(robot._joints._from[0]), time.monotonic())


def ready(robot: Ros2Robot, other: Ros2Cell) -> bool:
    """Say whether a robot may be commanded, at a cell that says what it has to."""
    other.state(time.time(), Q, Q)
    other.status(1.0, "")
    robot.read(0.0)
    return not (robot.conflict() or robot.trouble() or robot.waits())


def test_readings_and_commands_pass(both: tuple[Ros2Robot, Ros2Cell]) -> None:
    """With their stamps, to the bit; the hand has a message of its own."""
    robot, other = both
    other.state(1_700_000_000.125, Q, -Q)
    (reading,) = soon(lambda: robot.read(0.1))
    assert reading.t == 1_700_000_000.125
    assert np.array_equal([reading.q, reading.dq], [Q, -Q])
    told = np.arange(12.0).reshape(4, 3)
    robot.write(Command(t=0.0, joints=told, hand=0.7), reading.t)
    got = soon(other.command)
    assert (got.answers, got.hand) == (reading.t, 0.7)
    assert np.array_equal(got.joints, told)


def test_brakes_and_troubles_pass(both: tuple[Ros2Robot, Ros2Cell]) -> None:
    """Engaged, released; a protective stop is a trouble until it is over."""
    robot, other = both
    robot.engage_brakes()
    assert soon(other.brake) is True
    robot.release()
    time.sleep(0.1)
    assert other.brake() is False
    soon(lambda: not robot.trouble())
    other.status(2.0, "protective stop")
    assert soon(robot.trouble) == "protective stop"
    other.status(2.1, "")
    soon(lambda: not robot.trouble())


def test_joints_are_found_by_name(both: tuple[Ros2Robot, Ros2Cell]) -> None:
    """In any order, a held joint and the hand among them; others are refused, named."""
    robot, _ = both
    given = ("j4", "hand", "j1", "j3", "j2")
    found = taken(robot, given, np.array([4.0, 9.0, 1.0, 0.0, 2.0]))
    assert found is not None
    assert found.q.tolist() == [1.0, 2.0, 4.0]
    for bad, says in ((("j1", "j2", "j5"), "robot.joints"), ((*NAMES, "k"), "others")):
        with pytest.raises(InputError, match=says):
            taken(robot, bad, np.zeros(len(bad)))
    with pytest.raises(InputError, match="each once"):
        taken(robot, ("j1", "j1"), np.zeros(2))


def test_the_ball_comes_in_the_arms_frame() -> None:
    """Turned and moved as the cell says; a message of another frame is refused."""
    cell = cell_with("ball_frame")
    turned = cell.source.model_copy(
        update={
            "origin": (1.0, 0.0, 0.0),
            "rpy": (0.0, 0.0, np.pi / 2),
            "frame": "mocap",
            "latency": 0.25,
            "message": "pose",
        }
    )
    cell = cell.model_copy(update={"source": turned})
    arm = arm_of(cell)
    robot, other = Ros2Robot(cell, arm), Ros2Cell(cell, arm)
    seen = soon(lambda: sent(other.ball, 5.0, np.array([2.0, 0.0, 0.5])) and robot.points())[0]
    assert np.allclose(seen.r_o, [1.0, 2.0, 0.5])
    assert seen.t == 4.75
    other.ball(5.0, np.full(3, np.nan))
    assert not soon(robot.points)[-1].found
    other._frame = "world"
    with pytest.raises(InputError, match=r"source\.frame"):
        soon(lambda: sent(other.ball, 5.0, Q) and robot.points())


def test_two_publishers_on_one_topic_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Which of them is the robot cannot be known; one that was killed is waited for."""
    cell = cell_with("two")
    arm = arm_of(cell)
    robot, one, two = Ros2Robot(cell, arm), Ros2Cell(cell, arm), Ros2Cell(cell, arm)
    assert one is not two
    says = "two publishers of j1 on /two/joint_states: end one"

    def both_say() -> str:
        for k, x in enumerate((one, two)):
            x.state(1.0 + k, Q, np.full(3, np.nan) if k else Q)
        assert all(reading.t == 1.0 for reading in robot.read(0.02))
        return robot.conflict()

    soon(lambda: robot._state.speakers() == 2)
    assert soon(both_say) == says
    assert robot._ball is not None
    assert robot._ball.twice()
    monkeypatch.setattr("mitt.robot.cell.ros2._LEASE", 0.0)
    with pytest.raises(InputError, match="publishers on j1 on /two/joint_states: wanted one"):
        soon(both_say)


def test_a_second_commander_waits_and_releases_nothing() -> None:
    """It says who is there before it publishes a command, so that the first is not disturbed."""
    cell = cell_with("second")
    arm = arm_of(cell)
    first, other = Ros2Robot(cell, arm), Ros2Cell(cell, arm)
    assert first.waits() == "looking for others that command the arm"
    soon(lambda: ready(first, other))
    second = Ros2Robot(cell, arm)
    says = "another program commands the arm on /second/joint_trajectory: end it"
    soon(lambda: second.conflict() == says)
    second.release()
    time.sleep(0.5)
    assert second.conflict() == says
    assert second._command is None
    assert ready(first, other)
    assert other.brake() is None
    first.close()
    soon(lambda: ready(second, other))


def test_a_commander_that_comes_later_is_a_trouble(monkeypatch: pytest.MonkeyPatch) -> None:
    """In a catch too, so that the loop stops; at rest it ends the session after any lease."""
    cell = cell_with("later")
    arm = arm_of(cell)
    robot, other = Ros2Robot(cell, arm), Ros2Cell(cell, arm)
    soon(lambda: ready(robot, other))
    assert other.command() is None
    rival = dds.Node().publish("/later/joint_trajectory", types.JointTrajectory, "command")
    soon(lambda: robot.conflict().startswith("another program commands the arm"))
    monkeypatch.setattr("mitt.robot.cell.ros2._LEASE", 0.0)
    with pytest.raises(InputError, match="another one that commands the arm"):
        robot.conflict()
    assert rival.listeners() > 0


def test_a_robot_that_takes_no_commands_is_waited_for() -> None:
    """Where nobody subscribes to them nothing would move, and no brake would be released."""
    cell = cell_with("deaf")
    robot = Ros2Robot(cell, arm_of(cell))
    assert soon(lambda: robot.waits() if "looking" not in robot.waits() else "") == (
        "nobody takes commands on /deaf/joint_trajectory"
    )


_BOUND = """
import os, socket
from mitt.robot.cell import dds
node = dds.Node()
for name in os.listdir("/proc/self/fd"):
    try:
        one = socket.socket(fileno=os.dup(int(name)))
    except OSError:
        continue
    if one.type == socket.SOCK_DGRAM:
        print(one.getsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, 16).rstrip(b"\\0").decode())
"""


def test_on_the_loopback_no_socket_hears_another_interface() -> None:
    """Cyclone binds them to all addresses; the kernel drops what comes from elsewhere."""
    done = subprocess.run(
        [sys.executable, "-c", _BOUND], capture_output=True, text=True, check=True
    )
    found = done.stdout.split()
    assert len(found) >= 2
    assert set(found) == {"lo"}


@pytest.mark.parametrize("takes", ["torque", "velocity", "position"])
def test_arrays_reach_the_simulated_cell(takes: str) -> None:
    """What the drives take, and the hand; what an array does not say is unknown there."""
    tag = f"there_{takes}"
    cell = cell_with(tag, command=f"/{tag}/commands")
    cell = cell.model_copy(update={"robot": cell.robot.model_copy(update={"takes": takes})})
    robot, other = Ros2Robot(cell, arm_of(cell)), Ros2Cell(cell, arm_of(cell))
    soon(lambda: ready(robot, other))
    rows = np.arange(12.0).reshape(4, 3)
    robot.write(Command(t=0.0, joints=rows, hand=0.5), 1.0)
    told, row = soon(other.command), {"torque": 3, "velocity": 1, "position": 0}[takes]
    assert np.array_equal(told.joints[row], rows[row])
    assert np.isnan(told.joints[[k for k in range(4) if k != row]]).all()
    assert told.hand == 0.5
    robot._commands().send(messages.array_message(np.zeros(2)))
    time.sleep(0.2)
    assert other.command() is None


@pytest.mark.parametrize(
    ("takes", "names", "angle", "says"),
    [
        ("torque", ("j1", "j2", "j4"), 0.0, ""),
        ("torque", ("j1", "j3", "j2", "j4"), 0.5, "j3 is at 0.50 rad"),
        ("position", ("j1", "j3", "j2", "j4"), 0.01, ""),
        ("position", ("j4", "j3", "j2", "j1"), -0.2, "j3 is at -0.20 rad"),
        ("position", ("j1", "j2", "j4"), 0.0, "joint states do not say where j3 is"),
        ("velocity", ("j1", "j2", "j4"), 0.0, ""),
    ],
)
def test_a_held_joint_has_to_be_where_the_arm_holds_it(
    takes: str, names: tuple[str, ...], angle: float, says: str
) -> None:
    """And where a controller moves it, that has to be known: it would jump."""
    cell = cell_with("held")
    robot_part = cell.robot.model_copy(update={"takes": takes})
    robot = Ros2Robot(cell.model_copy(update={"robot": robot_part}), arm_of(cell))
    taken(robot, names, np.array([angle if name == "j3" else 0.1 for name in names]))
    said = robot.conflict()
    assert said.startswith(says)
    assert bool(said) == bool(says)


class Heard:
    """Stands for a subscription: gives messages one after another."""

    def __init__(self, raw: list[bytes]) -> None:
        """Take them."""
        self._raw = raw

    def take(self, most: int) -> list[bytes]:
        """Return so many."""
        taken, self._raw = self._raw[:most], self._raw[most:]
        return taken


def test_diagnostics_of_others_neither_stop_nor_delay_the_arm(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """However long, many or broken they are; the robot's own entry is found among them."""
    cell = cell_with("noisy")
    robot = Ros2Robot(cell, arm_of(cell))
    good = messages.diagnostics(1.0, "robot", 2, "stop")
    long = messages.diagnostics(1.0, "robot", 2, "x" * 5000)
    crowd = Writer().header(1.0, "").uint32(2000)
    for _ in range(1999):
        crowd.byte(0).string("others").string("m").string("").uint32(0)
    crowd.byte(2).string("robot").string("in a crowd").string("").uint32(0)
    broken = [long, good[:30], good[:20] + b"robot\0", b"", b"\0", messages.string_message("robot")]
    robot._diagnostics = Heard([*broken, crowd.done(), *broken, good])  # type: ignore[assignment]
    steps, walk = 0, messages.search_diagnostics

    def counted(raw: bytes, name: str) -> Iterator[tuple[int, str] | None]:
        nonlocal steps
        for step in walk(raw, name):
            steps += 1
            yield step

    monkeypatch.setattr(messages, "search_diagnostics", counted)
    said = list[str]()
    for _ in range(200):
        before, found = steps, robot.trouble()
        assert steps - before <= 32
        said += [found] if found not in said else []
    assert said == ["", "in a crowd", "stop"]


def test_without_a_name_for_its_state_no_diagnostics_are_heard() -> None:
    """So nobody's can be taken for the robot's."""
    cell = cell_with("unnamed", status="")
    robot = Ros2Robot(cell, arm_of(cell))
    other = dds.Node().publish("/unnamed/diagnostics", types.Diagnostics, "command")
    time.sleep(0.3)
    assert other.listeners() == 0
    assert robot.trouble() == ""


def test_where_nobody_publishes_the_interface_is_named() -> None:
    """Within a second; what else to try is said too."""
    cell = cell_with("silent")
    robot = Ros2Robot(cell, arm_of(cell))
    end = time.monotonic() + 1.0
    while "nobody publishes" not in robot.waits():
        assert time.monotonic() < end
        time.sleep(0.05)
    said = robot.waits()
    assert "/silent/joint_states on the interface lo" in said
    assert "robot.options.interface" in said
    assert "mitt sim" in said


@pytest.mark.parametrize("takes", ["torque", "velocity", "position"])
def test_arrays_carry_what_the_drives_take(takes: str) -> None:
    """On a topic that ends in /commands."""
    cell = cell_with(f"array_{takes}", command=f"/array_{takes}/commands")
    cell = cell.model_copy(update={"robot": cell.robot.model_copy(update={"takes": takes})})
    robot = Ros2Robot(cell, arm_of(cell))
    heard = dds.Node().subscribe(f"/array_{takes}/commands", types.MultiArray, "command")
    soon(robot.listened)
    robot.write(Command(t=0.0, joints=np.arange(12.0).reshape(4, 3), hand=0.5), 1.0)
    answers, got = messages.read_array(soon(heard.take)[0])
    assert answers == 1.0
    # j3 is held: at its angle, still; nobody says by which torque.
    wanted = {
        "torque": [9.0, 10.0, 11.0],
        "velocity": [3.0, 4.0, 0.0, 5.0],
        "position": [0.0, 1.0, 0.0, 2.0],
    }[takes]
    assert got.tolist() == wanted


def test_bad_options_are_refused() -> None:
    """Unknown ones, those of another type, topics and domains that cannot be."""
    arm = arm_of(read_cell("wam-sim"))
    for options, says in (
        ({"stat": "/x"}, "robot.options.stat"),
        ({"state": 3.0}, "robot.options.state"),
        ({"state": "joint_states"}, "begins with /"),
        ({"interface": "lo'/>"}, "interface"),
    ):
        with pytest.raises(InputError, match=says):
            Ros2Robot(cell_with("bad", **options), arm)


def test_a_domain_that_is_no_number_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """As ROS 2 allows them."""
    for said in ("abc", "-1", "233"):
        monkeypatch.setenv("ROS_DOMAIN_ID", said)
        with pytest.raises(InputError, match="ROS_DOMAIN_ID"):
            dds.domain_id()


def test_cells_of_other_drivers_need_no_dds() -> None:
    """A cell file may name any driver; what it is comes later."""
    raw = {"schema": "mitt.cell/1", "name": "x", "robot": {"driver": "mine"}}
    assert cell_of(raw, place="x").robot.driver == "mine"
