"""Both ends of each link of a ROS 2 cell: who is not there, and who else is, is said."""

import os
import time
from collections.abc import Callable, Iterator
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ros2_cell import ARM, NAMES, cell_with, topics

from mitt.core.errors import InputError
from mitt.core.signals import TICK, ArmState
from mitt.io.cell import read_cell
from mitt.robot.cell import ros2_messages as messages
from mitt.robot.cell.ros2_messages import JointReading

try:
    from mitt.robot.cell import dds
    from mitt.robot.cell.ros2 import Joints, Ros2Robot
except InputError:
    pytest.skip("no Cyclone DDS", allow_module_level=True)


class Graph:
    """A driver, and the ends that it looks for, each of which may be left out."""

    def __init__(self, tag: str, *, without: str = "") -> None:
        """Join, without one of the ends."""
        named, self.node = topics(tag), dds.Node()
        node, self.ends = self.node, dict[str, Any]()
        self.robot = Ros2Robot(cell_with(tag), ARM)
        made: dict[str, Callable[[], Any]] = {
            "state": lambda: node.publish(named["state"], dds.JointState, "sensor"),
            "command": lambda: node.subscribe(named["command"], dds.JointTrajectory, "command"),
            "brake": lambda: node.subscribe(named["brake"], dds.Bool, "command"),
            "hand": lambda: node.subscribe(named["hand_command"], dds.MultiArray, "command"),
            "status": lambda: node.publish(named["diagnostics"], dds.Diagnostics, "command"),
            "ball": lambda: node.publish(f"/{tag}/ball", dds.PointStamped, "sensor"),
        }
        for name, make in made.items():
            if name != without:
                self.ends[name] = make()

    def said(self) -> str:
        """Let the ends say what they do now, and return what the driver makes of it."""
        if "state" in self.ends:
            q = np.zeros(3)
            self.ends["state"].send(messages.joint_state(time.time(), NAMES, q, q))
        if "status" in self.ends:
            self.ends["status"].send(messages.diagnostics(1.0, "robot", 0, "ready"))
        self.robot.read(0.01)
        return self.robot.conflict() or self.robot.trouble() or self.robot.waits()

    def until(self, wanted: Callable[[str], bool]) -> str:
        """Go on until something is said; return it."""
        end = time.monotonic() + 10.0
        while not wanted(said := self.said()):
            assert time.monotonic() < end, said
            time.sleep(0.01)
        return said


@pytest.fixture(autouse=True)
def domain(monkeypatch: pytest.MonkeyPatch) -> None:
    """A domain for each process that runs these tests; looks without a pause."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(100 + os.getpid() % 60))
    monkeypatch.setattr("mitt.robot.cell.ros2._LOOK", 0.0)
    monkeypatch.setattr("mitt.robot.cell.ros2._ALONE", 0.3)


@pytest.fixture
def graph(request: pytest.FixtureRequest) -> Iterator[Callable[[str], Graph]]:
    """Makes graphs, which are left at the end."""
    made = list[Graph]()

    def make(without: str) -> Graph:
        made.append(Graph(f"{request.node.originalname}_{without}", without=without))
        return made[-1]

    yield make
    for one in made:
        one.robot.close()
        one.node.close()


SAYS = {
    "state": "nobody publishes",
    "command": "nobody takes commands on",
    "brake": "/brake: start",
    "hand": "/hand/commands: start the hand's controller",
    "status": "no entry robot on",
    "ball": "/ball: start what sees the ball",
}


@pytest.mark.parametrize("end", SAYS)
def test_nothing_moves_before_each_end_is_there(graph: Callable[[str], Graph], end: str) -> None:
    """The line names the topic."""
    one = graph(end)
    assert SAYS[end] in one.until(lambda said: SAYS[end] in said)
    for _ in range(30):
        assert one.said() != ""
        time.sleep(0.01)


@pytest.mark.parametrize("end", [x for x in SAYS if x != "status"])
def test_an_end_that_goes_is_said(graph: Callable[[str], Graph], end: str) -> None:
    """While the arm moves too; so is that nobody heard what the brakes were told."""
    one = graph("")
    one.until(lambda said: said == "")
    assert one.robot.engage_brakes() == ""
    one.ends.pop(end).close()
    one.until(lambda said: SAYS[end] in said)
    if end == "brake":
        assert one.robot.engage_brakes().startswith("nobody takes")


def test_a_status_that_is_out_of_date_is_said(
    graph: Callable[[str], Graph], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its publisher may still be there."""
    monkeypatch.setattr("mitt.robot.cell.ros2._STALE_STATUS", 0.5)
    one = graph("")
    one.until(lambda said: said == "")
    one.ends.pop("status")
    one.until(lambda said: "no entry robot on" in said)


def test_what_others_tell_brakes_and_hand_is_seen(graph: Callable[[str], Graph]) -> None:
    """Brakes that another engaged are a stop, until a person releases them."""
    one = graph("")
    one.until(lambda said: said == "")
    tag = "test_what_others_tell_brakes_and_hand_is_seen_"
    brake = one.node.publish(f"/{tag}/brake", dds.Bool, "command")
    hand = one.node.publish(f"/{tag}/hand/commands", dds.MultiArray, "command")
    while brake.listeners() < 2 or hand.listeners() < 2:
        time.sleep(0.01)
    brake.send(messages.bool_message(True))
    says = f"another program engaged the brakes on /{tag}/brake"
    one.until(lambda said: said == says)
    assert one.robot.trouble() == says
    one.robot.release()
    assert one.robot.trouble() == ""
    brake.send(messages.bool_message(False))
    one.until(lambda said: "another program released the brakes" in said)
    one.until(lambda said: said == "")
    hand.send(messages.array_message(np.ones(1)))
    one.until(lambda said: "another program commands the hand" in said)


def told(joints: Joints, t: float, names: tuple[str, ...], q: list[float], who: int) -> Any:  # noqa: ANN401
    """Let a publisher say where joints are, moving at 1 rad/s, at a time that is also now."""
    return joints.take(JointReading(t, names, np.array(q), np.ones(len(q))), who, t)


@given(
    st.lists(st.integers(0, 2), min_size=3, max_size=3),
    st.randoms(use_true_random=False),
    st.lists(st.floats(0.0, 0.9 * TICK), min_size=3, max_size=3),
)
def test_parts_of_joint_states_are_one_reading(
    whose: list[int], rng: Random, apart: list[float]
) -> None:
    """However the joints are shared among publishers, whoever speaks first, a gripper among them.

    Each reading has every joint where it is at the reading's stamp.
    """
    joints, found = Joints(read_cell("wam-sim"), ARM), list[ArmState]()
    for k in range(20):
        parts = [
            (i, tuple(n for n, w in zip(NAMES, whose, strict=True) if w == i))
            for i in sorted(set(whose))
        ]
        rng.shuffle(parts)
        for i, names in [*parts, (7, ("finger_joint",))]:
            t = 1.0 + k * TICK + (0.0 if i == 7 else apart[i])
            got = told(joints, t, names, [t] * len(names), i)
            found += [] if got is None else [got]
    assert len(found) >= 19
    for reading in found:
        assert reading.q == pytest.approx([reading.t] * 3, abs=1e-9)
    assert np.all(np.diff([x.t for x in found]) > 0.0)
    assert joints.missing(1.02) == joints.twice(1.02) == ""


def test_what_no_message_tells_of_is_named() -> None:
    """Half of the arm, another's names, and parts that are not of one instant."""
    joints = Joints(read_cell("wam-sim"), ARM)
    assert told(joints, 1.0, ("j1", "j2"), [0.0, 0.0], 1) is None
    assert "do not tell of j4, but of j1, j2: say" in joints.missing(1.1)
    joints = Joints(read_cell("wam-sim"), ARM)
    assert told(joints, 1.0, ("a", "b"), [0.0, 0.0], 1) is None
    assert "do not tell of j1, j2, j4, but of a, b: say" in joints.missing(1.1)
    joints = Joints(read_cell("wam-sim"), ARM)
    for k in range(10):
        assert told(joints, 1.0 + k * TICK, ("j1", "j2"), [0.0, 0.0], 1) is None
        assert told(joints, 0.9 + k * TICK, ("j4",), [0.0], 2) is None
    assert "stamped 100 ms apart" in joints.missing(1.01)


def test_a_joint_belongs_to_one_publisher_until_that_is_gone() -> None:
    """What a second one says of it reaches nothing; a driver that was started anew is taken."""
    joints = Joints(read_cell("wam-sim"), ARM)
    assert told(joints, 1.0, NAMES, [0.0, 0.0, 0.0], 1) is not None
    assert told(joints, 1.001, ("j2",), [np.nan], 2) is None
    assert joints.twice(1.001) == "j2"
    assert told(joints, 1.001, NAMES, [0.0, 0.0, 0.0], 1).q.tolist() == [0.0, 0.0, 0.0]
    assert joints.twice(2.0) == ""
    assert told(joints, 2.0, NAMES, [1.0, 1.0, 1.0], 3).q.tolist() == [1.0, 1.0, 1.0]
