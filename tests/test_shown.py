"""What is printed of a value: one line, whatever it holds."""

import logging
import subprocess
import sys
from collections.abc import Iterator
from enum import Enum

import numpy as np
import pytest

import mitt
from mitt.core.arm.arm import Arm
from mitt.core.arm.hands import HandModel
from mitt.core.catcher.catcher import Catcher
from mitt.core.eyes.camera import Head, fixed_rig
from mitt.core.eyes.eyes import Eyes
from mitt.core.fields import brief
from mitt.core.map.learn import Learned
from mitt.core.signals import ArmState, BallState, Frame, Moments, Senses, Sighting
from mitt.lab.world.scene import Scene, read_scene

MOST = 200
"""Characters of a line."""
TWO = """<mujoco model="two"><compiler angle="radian"/><custom>
 <numeric name="velocity_limit_a" data="40"/><numeric name="velocity_limit_b" data="12"/>
</custom><worldbody><body name="one"><joint name="a" axis="0 0 1" range="-2 2"
  actuatorfrcrange="-80 80"/><inertial pos="0 0 0.2" mass="2" diaginertia="0.02 0.02 0.01"/>
 <body name="two" pos="0 0 0.4"><joint name="b" axis="0 1 0" range="-1 2"
  actuatorfrcrange="-60 60"/><inertial pos="0 0 0.1" mass="1" diaginertia="0.01 0.01 0.005"/>
</body></body></worldbody></mujoco>"""
"""An arm that leaves something open: a speed that may be in degrees."""


def _values(arm: Arm, learned: Learned) -> Iterator[object]:
    """Yield a value of each public class, and of what they are made of."""
    f, zero = learned.map, np.zeros(3)
    seen = Sighting(t=0.0, found=True, r_o=zero, covariance=np.eye(3))
    senses = Senses(t=0.0, arm=ArmState(t=0.0, q=arm.q_ready, dq=zero), points=(seen,) * 9)
    ball = BallState(t=0.0, r_o=np.array([3.0, 0.0, 0.5]), dr_o=np.array([-6.0, 0.0, 2.0]))
    eyes = Eyes(fixed_rig())
    catcher = Catcher(arm, f, eyes)
    command = catcher.step(senses)
    yield from (arm, learned, f, seen, senses, senses.arm, ball, eyes, catcher, command)
    yield from (catcher.tick, catcher.state, catcher.result, f.reference(ball), f.design, f.basis)
    yield from (mitt.Direct(f), mitt.Direct(f).verdict(ball, arm.q_ready), mitt.BallFilter())
    yield from (
        mitt.CatcherSettings(),
        mitt.CatcherSettings(ball_mass=0.2),
        mitt.BallFilter().config,
    )
    yield from (read_scene("rough"), Scene(), Scene().ball, Scene().sensing)
    yield from (arm.limits, arm.model, *arm.model.links, arm.model.hand, HandModel().finger)
    rig = fixed_rig()
    yield from (
        rig,
        *rig.cameras,
        Head(T_world_base=np.eye(4)),
        Moments(t=0.0, camera=0, found=True),
    )
    yield Frame(t=0.0, camera=0, number=1, pixels=np.zeros((64, 64), np.uint8))
    yield mitt.plan_brake(arm, 0.0, np.zeros((3, 3)))


def test_everything_is_one_line(arm: Arm, learned: Learned) -> None:
    """Of at most 200 characters, by ``repr``, by ``str`` and within a list."""
    seen = set()
    for value in _values(arm, learned):
        seen.add(type(value).__name__)
        for text in (repr(value), str(value), repr([value])):
            assert len(text) <= MOST, text
            assert "\n" not in text
    public = {name for name in mitt.__all__ if isinstance(getattr(mitt, name), type)}
    made = {x for x in public if not issubclass(getattr(mitt, x), Enum | BaseException)}
    assert made - {"Generator"} <= seen


def test_what_was_left_out_is_left_out() -> None:
    """Settings show what differs from the usual, the rest in few words."""
    assert repr(mitt.CatcherSettings()) == "CatcherSettings()"
    assert repr(mitt.CatcherSettings(ball_mass=0.2, watch=0.1)) == (
        "CatcherSettings(watch=0.1, ball_mass=0.2)"
    )
    assert repr(Scene()) == "Scene()"
    assert "array(128, 128)" in brief(
        Frame(t=0.0, camera=0, number=1, pixels=np.zeros((128, 128), np.uint8))
    )
    assert repr(ArmState(t=0.5, q=np.array([1.0, 2.0]), dq=np.zeros(2))) == (
        "ArmState(t=0.5, q=[1, 2], dq=[0, 0])"
    )


def test_what_a_file_leaves_open_is_logged(
    tmp_path_factory: pytest.TempPathFactory, caplog: pytest.LogCaptureFixture
) -> None:
    """By the logger ``mitt``, one record a note, which a program can hear and silence."""
    path = tmp_path_factory.mktemp("arm") / "two.xml"
    path.write_text(TWO)
    with caplog.at_level(logging.WARNING, logger="mitt"):
        arm = mitt.load_arm(path, tip="two", joints=["a", "b"])
    assert arm.model.notes
    assert [x.getMessage() for x in caplog.records if x.name == "mitt"] == [
        f"{path}: {note}" for note in arm.model.notes
    ]


def test_the_library_is_silent_by_itself(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Without a handler nothing reaches the streams of a program."""
    path = tmp_path_factory.mktemp("arm") / "two.xml"
    path.write_text(TWO)
    code = (
        "import mitt\n"
        f"arm = mitt.load_arm({str(path)!r}, tip='two', joints=['a', 'b'])\n"
        "print(len(arm.model.notes))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(done.stdout) > 0
    assert done.stderr == ""
