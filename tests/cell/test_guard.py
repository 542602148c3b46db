"""``mitt guard``: a controller that keeps its last command hears zeros when mitt is killed."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from ros2_cell import ARM, cell_with

from mitt.core.errors import InputError
from mitt.core.signals import Array
from mitt.io.cell import Cell
from mitt.robot.cell import ros2_messages as messages

try:
    from mitt.robot.cell import dds
    from mitt.robot.cell.ros2_guard import Guard
except InputError:
    pytest.skip("no Cyclone DDS", allow_module_level=True)

WATCHDOG = 0.01
LATE = 0.2
"""Bound of a busy machine for what takes the watchdog's time and some ms [s]."""

COMMANDER = """
import sys, time
import numpy as np
from mitt.robot.cell import dds
from mitt.robot.cell import ros2_messages as messages
node = dds.Node()
out = node.publish(sys.argv[1], dds.MultiArray, "command")
while True:
    if out.listeners():
        out.send(messages.array_message(np.full(int(sys.argv[2]), 0.5), time.time()))
    time.sleep(0.001)
"""


@pytest.fixture(autouse=True)
def domain(monkeypatch: pytest.MonkeyPatch) -> None:
    """A domain for each process that runs these tests."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(160 + os.getpid() % 60))
    monkeypatch.setattr("mitt.robot.cell.ros2_guard._LOOK", 0.0)


def guarded(tag: str) -> Cell:
    """Return a cell with a guard."""
    cell = cell_with(
        tag, command=f"/{tag}/arm/commands", guard=f"/{tag}/guarded/commands", brake=f"/{tag}/brake"
    )
    robot = cell.robot.model_copy(update={"watchdog": WATCHDOG})
    return cell.model_copy(update={"robot": robot})


class Link:
    """A guard between a program that commands and a controller."""

    def __init__(self, tag: str) -> None:
        """Join all three."""
        self.node, self.said = dds.Node(), list[str]()
        self.cell = guarded(tag)
        self.guard = Guard(self.cell, ARM, self.said.append)
        of = self.cell.robot.options
        self.controller = self.node.subscribe(str(of["command"]), dds.MultiArray, "command")
        self.brakes = self.node.subscribe(str(of["brake"]), dds.Bool, "command")
        self.topic = str(of["guard"])

    def turn(self, duration: float = 0.02) -> list[tuple[float, Array]]:
        """Let the guard run for a while; return when the controller heard what."""
        heard, end = list[tuple[float, Array]](), time.monotonic() + duration
        while time.monotonic() < end:
            self.guard.step()
            for raw in self.controller.take():
                heard.append((time.monotonic(), messages.read_array(raw)[1]))
        return heard

    def close(self) -> None:
        """Leave."""
        self.guard.close()
        self.node.close()


@pytest.fixture
def link(request: pytest.FixtureRequest) -> Iterator[Link]:
    """A guard and its two ends."""
    one = Link(f"{request.node.originalname}_{os.getpid()}")
    yield one
    one.close()


def test_a_commander_that_is_killed_leaves_zeros(link: Link) -> None:
    """What it sent arrives as it was; soon after the last of it the controller is told zero."""
    words = [sys.executable, "-c", COMMANDER, link.topic, str(ARM.n)]
    with subprocess.Popen(words) as commander:
        heard, end = list[tuple[float, Array]](), time.monotonic() + 20.0
        while len(heard) < 100 and time.monotonic() < end:
            heard += link.turn()
        commander.send_signal(signal.SIGKILL)
        after = link.turn(0.3)
    assert all(np.array_equal(x, np.full(ARM.n, 0.5)) for _, x in heard if np.any(x))
    last = max((t for t, x in (*heard, *after) if np.any(x)))
    zeros = [t for t, x in after if not np.any(x)]
    assert min(t for t in zeros if t > last) - last < LATE
    assert not np.any(after[-1][1])
    assert link.guard.silences >= 1
    assert "zeros on" in link.said[-1]
    assert messages.read_flag(link.brakes.take()[-1])


def test_what_is_no_command_is_not_passed_on(link: Link) -> None:
    """Arrays of another length, NaN, bytes of something else; a zero is no motion to end."""
    out = link.node.publish(link.topic, dds.MultiArray, "command")
    end = time.monotonic() + 10.0
    while not out.listeners() and time.monotonic() < end:
        link.turn()
    for x in (np.zeros(ARM.n + 1), np.full(ARM.n, np.nan)):
        out.send(messages.array_message(x))
    out.send(messages.array_message(np.zeros(ARM.n)))
    heard = link.turn(0.2)
    assert len(heard) == 1
    assert (link.guard.passed, link.guard.refused, link.guard.silences) == (1, 2, 0)


def test_the_way_is_whole_or_mitt_hears_it(link: Link) -> None:
    """Without a controller, or beside another that commands it, the guard takes no commands."""
    out = link.node.publish(link.topic, dds.MultiArray, "command")

    def until(wanted: int) -> None:
        end = time.monotonic() + 10.0
        while out.listeners() != wanted:
            assert time.monotonic() < end, link.said
            link.turn()

    until(1)
    other = link.node.publish(str(link.cell.robot.options["command"]), dds.MultiArray, "command")
    until(0)
    assert "another program" in link.said[-1]
    other.close()
    until(1)
    link.controller.close()
    link.controller = link.node.subscribe(f"{link.topic}_of_another", dds.MultiArray, "command")
    until(0)
    assert "nobody takes commands" in link.said[-1]


def test_a_guard_that_waits_leaves_the_processor_to_others(link: Link) -> None:
    """With a controller and without: it runs before everything else, and computes nothing."""
    link.turn(0.1)
    for _ in range(2):
        begun = time.thread_time()
        for _ in range(5):
            link.guard.step()
        assert time.thread_time() - begun < 0.1
        link.controller.close()
        link.controller = link.node.subscribe(f"{link.topic}_of_another", dds.MultiArray, "command")
        time.sleep(0.2)


def test_the_command_ends_with_a_signal_and_zeros(tmp_path: Path) -> None:
    """As a program of its own: SIGTERM while commands come leaves zeros."""
    tag = f"guard_program_{os.getpid()}"
    cell = guarded(tag)
    path, node = tmp_path / "cell.toml", dds.Node()
    options = "".join(f'{k} = "{v}"\n' for k, v in cell.robot.options.items())
    path.write_text(
        'schema = "mitt.cell/1"\nname = "guarded"\n[arm]\nfile = "wam"\n'
        f"[robot]\nwatchdog = {WATCHDOG}\n[robot.options]\n{options}"
    )
    controller = node.subscribe(f"/{tag}/arm/commands", dds.MultiArray, "command")
    out = node.publish(f"/{tag}/guarded/commands", dds.MultiArray, "command")
    words = [sys.executable, "-m", "mitt", "guard", str(path), "--json"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as program:
        heard, end = list[Array](), time.monotonic() + 30.0
        while len(heard) < 20 and time.monotonic() < end:
            out.send(messages.array_message(np.full(ARM.n, 0.5)))
            time.sleep(0.002)
            heard += [messages.read_array(raw)[1] for raw in controller.take()]
        program.send_signal(signal.SIGTERM)
        said = program.communicate(timeout=20.0)
    heard += [messages.read_array(raw)[1] for raw in controller.take()]
    node.close()
    assert program.returncode == 143, said
    assert np.any(heard[0])
    assert not np.any(heard[-1])
