"""Each setting of a cell that a line names as its remedy is one that ends that line."""

import ast
import os
import re
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from socket import if_nameindex
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from ros2_cell import ARM, NAMES, cell_with

from mitt.core.errors import InputError
from mitt.io.cell import Cell, read_cell
from mitt.robot.cell import ros2_messages as messages
from mitt.robot.cell.frames import FrameWriter
from mitt.robot.cell.prepare import prepare, scene_of_cell
from mitt.robot.cell.robot import RobotLink
from mitt.robot.cell.ros2_messages import JointReading, Orders
from mitt.robot.cell.trackers import check_tracker
from mitt.robot.drivers import ur

try:
    from mitt.robot.cell import dds
    from mitt.robot.cell.ros2 import Joints, Ros2Robot, ros2_options
    from mitt.robot.cell.ros2_guard import check_guard
except InputError:
    pytest.skip("no Cyclone DDS", allow_module_level=True)

LIVE = Path(messages.__file__).parents[1]
#: Where what is there publishes: another process of tests has its own.
PLACE = f"/there_{os.getpid()}"
#: How a message names a setting of a cell's file.
SETTING = re.compile(r"\b(?<!mitt\.)(?:robot|source|task|motion)\.(?:options\.)?[a-z][a-z_]*\b")


def texts(module: ast.Module) -> Iterator[str]:
    """Return the texts of a module that are no docstrings."""
    said = {
        node.body[0].value
        for node in ast.walk(module)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        and isinstance(node.body[0], ast.Expr)
    }
    whole = {
        part for node in ast.walk(module) if isinstance(node, ast.JoinedStr) for part in node.values
    }
    for node in ast.walk(module):
        if isinstance(node, ast.JoinedStr):
            yield "".join(x.value if isinstance(x, ast.Constant) else "{}" for x in node.values)  # type: ignore[misc]
        elif isinstance(node, ast.Constant) and node not in said and node not in whole:
            yield str(node.value)


def named() -> set[str]:
    """Return the settings that messages of the cell name."""
    return {
        name
        for file in LIVE.rglob("*.py")
        for text in texts(ast.parse(file.read_text()))
        for name in SETTING.findall(text)
    }


def line_of(call: Callable[[], object]) -> str:
    """Return what a call says, or raises; nothing where all is well."""
    try:
        said = call()
    except InputError as error:
        return str(error)
    return said if isinstance(said, str) else ""


def joints_said(cell: Cell, *told: Sequence[str], angle: float = 0.0) -> str:
    """Return what is wrong with joints that are told of in messages, each of so many names."""
    joints, orders = (
        Joints(cell, ARM, ros2_options(cell)["others"]),
        Orders(cell, ARM, ros2_options(cell)),
    )

    def taken() -> str:
        for who, names in enumerate(told):
            q = np.full(len(names), angle)
            joints.take(JointReading(1.0, tuple(names), q, q), who, 1.0)
        return joints.missing(1.2) or joints.misplaced(orders.held)

    return line_of(taken)


def robot_of(cell: Cell, **given: Any) -> Cell:  # noqa: ANN401
    """Return a cell with other settings of its robot."""
    return cell.model_copy(update={"robot": cell.robot.model_copy(update=given)})


def ur_said(*, rate: float = 500.0, **options: object) -> str:
    """Return what is wrong with a cell for the driver of a UR, whose library is there."""
    joints = list(ur.NAMES[: ARM.n])
    cell = robot_of(cell_with("x"), joints=joints, rate=rate, options=options)
    with patch.object(ur, "check_package"):
        return line_of(lambda: ur.check_ur(cell, ARM))


def plain_cell(**options: object) -> Cell:
    """Return a cell whose controller takes arrays."""
    return cell_with("x", command="/x/arm/commands", **options)


def guard_said(cell: Cell) -> str:
    """Return what is wrong with a cell for mitt guard."""
    return line_of(lambda: [check_guard(cell, ARM)])


def source_of(cell: Cell, **given: Any) -> Cell:  # noqa: ANN401
    """Return a cell with other settings of its source."""
    return cell.model_copy(update={"source": cell.source.model_copy(update=given)})


def tracker_said(name: str, **options: object) -> str:
    """Return what is wrong with a cell for a tracker, whose library is there."""
    cell = source_of(cell_with("x"), tracker=name, options=options)
    with patch("mitt.core.errors.find_spec"):
        return line_of(lambda: check_tracker(cell, ARM))


def joined(cell: Cell) -> str:
    """Return what a driver says that waits where only what is in ``PLACE`` is there."""
    node, robot, q = dds.Node(), Ros2Robot(cell, ARM), np.zeros(3)
    state = node.publish(ros2_options(cell)["state"], dds.JointState, "sensor")
    kept = [
        node.subscribe(ros2_options(cell)["command"], dds.JointTrajectory, "command"),
        node.subscribe(f"{PLACE}/brake", dds.Bool, "command"),
        node.subscribe(f"{PLACE}/hand/commands", dds.MultiArray, "command"),
        node.publish(f"{PLACE}/ball", dds.PointStamped, "sensor"),
    ]
    status, said = node.publish(f"{PLACE}/diagnostics", dds.Diagnostics, "command"), "at first"
    begun = time.monotonic()
    while said and time.monotonic() < begun + 10.0:
        state.send(messages.joint_state(1.0, NAMES, q, q))
        status.send(messages.diagnostics(1.0, "arm", 0, "ready"))
        time.sleep(0.01)
        robot.read(0.02)
        robot.trouble()
        said = robot.conflict() or robot.waits()
        lasts = time.monotonic() > begun + 1.5  # all have found each other
        if lasts and set(SETTING.findall(said)) - {"robot.options.interface"}:
            break
    assert kept
    robot.close()
    node.close()
    return said


THERE = {
    "brake": f"{PLACE}/brake",
    "hand_command": f"{PLACE}/hand/commands",
    "diagnostics": f"{PLACE}/diagnostics",
    "status": "arm",
}


def there(tag: str, topic: str = f"{PLACE}/ball", **given: str) -> Cell:
    """Return a cell all of whose ends are there, but for what is given."""
    return source_of(cell_with(tag, **(THERE | given)), topic=topic)


def with_memory(name: str) -> str:
    """Return what is wrong with the name of a shared memory."""

    def made() -> None:
        FrameWriter(name, 1, 4, 4).close()

    return line_of(made)


class Brakeless:
    """A robot without brakes."""

    brakes = False
    read = points = write = engage_brakes = release = print
    waits = conflict = trouble = news = close = print


BALL = messages.point(1.0, "mocap", np.ones(3))


def frame_said(cell: Cell) -> str:
    """Return what is wrong with the frame of a position."""
    robot = Ros2Robot(cell, ARM)
    assert robot._ball is not None
    robot._ball._heard.take = lambda: [BALL]  # type: ignore[method-assign, misc, assignment]
    return line_of(robot.points)


#: By setting: what it is said for, and the same with the remedy taken.
REMEDIES: dict[str, tuple[Callable[[], str], Callable[[], str]]] = {
    "robot.joints": (
        lambda: joints_said(cell_with("x"), ("a", "b", "c")),
        lambda: joints_said(robot_of(cell_with("x"), joints=["a", "b", "c"]), ("a", "b", "c")),
    ),
    "robot.options.others": (
        lambda: joints_said(cell_with("x"), (*NAMES, "finger")),
        lambda: joints_said(cell_with("x", others="finger"), (*NAMES, "finger")),
    ),
    "robot.options.controller": (
        lambda: joints_said(robot_of(cell_with("x"), takes="position"), NAMES),
        lambda: joints_said(
            robot_of(cell_with("x", controller="j1, j2, j4"), takes="position"), NAMES
        ),
    ),
    "robot.options.brake": (
        lambda: joined(there("r1", brake=f"{PLACE}/nobody")),
        lambda: joined(there("r2")),
    ),
    "robot.options.hand_command": (
        lambda: joined(there("r3", hand_command=f"{PLACE}/nobody/commands")),
        lambda: joined(there("r4")),
    ),
    "robot.options.hand": (
        lambda: joined(there("r5", hand_command=f"{PLACE}/nobody/commands")),
        lambda: joined(there("r6", hand_command=f"{PLACE}/nobody/commands", hand="")),
    ),
    "robot.options.status": (
        lambda: joined(there("r7", status="robot")),
        lambda: joined(there("r8", status="")),
    ),
    "source.topic": (
        lambda: joined(there("r9", topic=f"{PLACE}/nobody")),
        lambda: joined(there("r10")),
    ),
    "source.frame": (
        lambda: frame_said(cell_with("x")),
        lambda: frame_said(source_of(cell_with("x"), frame="mocap")),
    ),
    "source.memory": (lambda: with_memory("no/name"), lambda: with_memory("mitt-remedy")),
    "robot.options.interface": (
        lambda: line_of(lambda: dds.Node("eth77")),
        lambda: line_of(lambda: dds.Node(if_nameindex()[0][1]).close()),
    ),
    "source.options.kind": (
        lambda: tracker_said("motioncapture"),
        lambda: tracker_said("motioncapture", kind="vicon"),
    ),
    "source.options.rigid_body": (
        lambda: tracker_said("natnet", rigid_body=-1.0),
        lambda: tracker_said("natnet", rigid_body=1.0),
    ),
    "source.options.tick_rate": (
        lambda: tracker_said("natnet", tick_rate=1.0),
        lambda: tracker_said("natnet", tick_rate=1e9),
    ),
    "source.options.port": (
        lambda: tracker_said("qtm", port=-1.0),
        lambda: tracker_said("qtm", port=22225.0),
    ),
    "source.options.interface": (
        lambda: tracker_said("ros2", interface="eth77"),
        lambda: tracker_said("ros2", interface=if_nameindex()[0][1]),
    ),
    "robot.options.address": (ur_said, lambda: ur_said(address="192.0.2.1")),
    "robot.options.hand_output": (
        lambda: ur_said(address="192.0.2.1", hand_output=9.0),
        lambda: ur_said(address="192.0.2.1", hand_output=3.0),
    ),
    "robot.rate": (
        lambda: ur_said(address="192.0.2.1", rate=1000.0),
        lambda: ur_said(address="192.0.2.1"),
    ),
    "robot.options.guard": (
        lambda: guard_said(plain_cell()),
        lambda: guard_said(plain_cell(guard="/x/guarded/commands")),
    ),
    "robot.options.command": (
        lambda: guard_said(cell_with("x", guard="/x/guarded/commands")),
        lambda: guard_said(plain_cell(guard="/x/guarded/commands")),
    ),
    "robot.options.unbraked": (
        lambda: line_of(lambda: RobotLink(Brakeless())),  # type: ignore[arg-type]
        lambda: line_of(lambda: RobotLink(Brakeless(), unbraked=True)),  # type: ignore[arg-type]
    ),
}
#: Settings that a line names as what is wrong, or as what it speaks of.
NO_REMEDY = {
    "robot.watchdog",
    "robot.driver",
    "robot.options",
    "source.tracker",
    "source.options",
    "source.options.multicast",
    "task.put",
    "task.belt",
}


def test_each_setting_that_a_line_names_is_tried() -> None:
    """A new one wants its case here."""
    assert named() - NO_REMEDY == {*REMEDIES, "robot.takes"}


@pytest.mark.parametrize("setting", REMEDIES)
def test_a_remedy_that_is_taken_ends_the_line(
    setting: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And the line names it before that."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "99")
    monkeypatch.setattr("mitt.robot.cell.ros2._LOOK", 0.0)
    monkeypatch.setattr("mitt.robot.cell.ros2._ALONE", 0.3)
    wrong, right = REMEDIES[setting]
    assert setting in wrong()
    assert right() == ""


def test_what_a_robot_takes_is_said_in_the_cell(tmp_path: Path) -> None:
    """Not in a scene."""
    scene = tmp_path / "scene.toml"
    scene.write_text('base = "lab"\n[actuation]\ntakes = "position"\n')
    assert "robot.takes" in line_of(lambda: scene_of_cell(read_cell("wam-sim"), str(scene)))
    cell = robot_of(read_cell("wam-sim"), takes="position")
    assert scene_of_cell(prepare(cell).cell, None).actuation.takes == "torque"
