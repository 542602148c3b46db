"""Objects whose methods are called, and a right value for each parameter.

Numbers are multiples of 1/64 where they can be, so that float16 and float32 hold them exactly.
"""

from collections.abc import Callable
from dataclasses import fields
from typing import final

import numpy as np

import mitt
from mitt.core.arm.arm import Arm
from mitt.core.ball.filter import BallFilter
from mitt.core.ball.flight import forecast
from mitt.core.catcher.catcher import Catcher, CatcherSettings
from mitt.core.catcher.family import Family
from mitt.core.catcher.generators import Direct, Unoptimised, refining
from mitt.core.eyes.camera import fixed_rig
from mitt.core.eyes.eyes import Eyes
from mitt.core.map.learn import Flight
from mitt.core.map.map_design import default_design
from mitt.core.map.mapping import DirectMap, unlearned
from mitt.core.signals import ArmState, Frame, Senses, Sighting
from mitt.io.load import build_arm
from mitt.lab.rivals.planned import make_quintic
from mitt.lab.world.scene import Scene
from mitt.lab.world.simulation import World
from mitt.lab.world.throws import Throw
from soak.values import Value

_R, _DR, _DDR = (np.array(x) for x in ((2.5, 0.125, 0.5), (-5.5, 0.0, 2.0), (0.25, 0.0, -9.75)))


def ball_of(**changed: Value) -> "mitt.BallState":
    """Return an estimate of a ball in flight."""
    values: dict[str, Value] = {
        "t": 0.25,
        "tracked": True,
        "r_o": _R,
        "dr_o": _DR,
        "ddr_o": _DDR,
        "drag": 0.03125,
        "covariance": 2.0**-16 * np.eye(6),
        "t_seen": 0.25,
        "t_first": 0.125,
        "led": False,
    }
    return mitt.BallState(**(values | changed))


@final
class Examples:
    """Objects whose methods are called, and a right value for each parameter."""

    def __init__(self, f: DirectMap | None = None) -> None:
        """Build them around a map, an unlearned one by default."""
        arm = build_arm("wam") if f is None else f.arm
        self.f = f = unlearned(arm, default_design(arm)) if f is None else f
        self.arm = arm
        n, links = arm.n, len(arm.model.links)
        q, grey = np.round(64.0 * arm.q_ready) / 64.0, np.zeros((128, 128), np.uint8)
        self.values: dict[str, Value] = {
            "q": q,
            "dq": 0.0 * q,
            "ddq": 0.0 * q,
            "q_o": q,
            "x": q,
            "tau": np.ones(links),
            "tau_drive": np.ones(links),
            "dq_drive": np.zeros(links),
            "share": np.ones(links),
            "motion": np.array([[q, 0.0 * q, 0.0 * q]]),
            "r_o": _R,
            "t": 0.25,
            "mass": 0.125,
            "path": np.array([[_R, _DR, _DDR]]),
            "alpha": f.alpha.copy(),
            "angle": 0.5,
            "at": np.array([0.0, 0.0, 0.125]),
            "inertia": np.zeros((3, 3)),
            "seed": 3,
            "ball": ball_of(),
            "state": ball_of(),
            "senses": self._senses(q),
            "sighting": Sighting(t=0.25, found=True, r_o=_R, covariance=2.0**-20 * np.eye(3)),
            "frames": (),
            "least": 0.0,
            "other": f,
            "views": [tuple(Frame(t=0.0, camera=k, number=0, pixels=grey) for k in range(2))],
            "arm": arm,
            "generator": Direct(f),
            "todo": 0,
            "since": 0.0,
            "gap": 2.0**-10,
            "known": True,
            "alone": False,
            "torques": 0.0 * q,
        }
        self.special: dict[str, dict[str, Value]] = {
            "DirectMap.virtual": {"ball": np.array([_R, _DR, _DDR])},
            "DirectMap.motion": {"ball": np.array([_R, _DR, _DDR])},
            "Arm.active": {"x": np.ones(links)},
            "Limits": {"dq": np.zeros(links)},
            "CatchBasis": {"q": q[:3], "dq": np.zeros(3), "ddq": np.zeros(3)},
            "World": {"ball": Throw(r=_R, dr=_DR), "command": self._command(n)},
        }

    def _senses(self, q: Value) -> Senses:
        """Return what reaches a catcher in a tick without images."""
        return Senses(t=0.25, arm=ArmState(t=0.25, q=q, dq=0.0 * q))

    def _command(self, n: int) -> "mitt.Command":
        """Return a command of no torque."""
        return mitt.Command(t=0.25, joints=np.zeros((4, n)), hand=0.0)

    def objects(self) -> dict[str, Value]:
        """Return the objects by what they are; those with a memory are copied for each call."""
        f, arm, eyes = self.f, self.arm, Eyes(fixed_rig())
        direct = Direct(f)
        settings = CatcherSettings()
        return {
            "arm": arm,
            "arm.model": arm.model,
            "arm.limits": arm.limits,
            "map": f,
            "map.basis": f.basis,
            "direct": direct,
            "refining": refining(f),
            "family": Family((direct,)),
            "unoptimised": Unoptimised(f),
            "rival": make_quintic(f),
            "filter": BallFilter(),
            "eyes": eyes,
            "catcher": Catcher(arm, direct, eyes, settings=settings),
        }

    def example(self, kind: str, method: str, name: str) -> Value:
        """Return a right value for a parameter of a class's method; KeyError without one."""
        special = self.special.get(kind, {}) | self.special.get(f"{kind}.{method}", {})
        return special[name] if name in special else self.values[name]

    def constructors(self) -> dict[str, tuple[Callable[..., Value], dict[str, Value]]]:
        """Return what makes a value, and right arguments for it."""
        f, q, ball = self.f, self.values["q"], ball_of()
        pixels, eye = np.zeros((128, 128), np.uint8), np.eye(3)
        design = {
            name: getattr(f.design, name)
            for name in ("catch_joint", "q_catch", "kappa", "inward", "order", "free")
        }
        return {
            "BallState": (mitt.BallState, {x.name: getattr(ball, x.name) for x in fields(ball)}),
            "ArmState": (ArmState, {"t": 0.25, "q": q, "dq": 0.0 * q}),
            "Sighting": (Sighting, {"t": 0.25, "found": True, "r_o": _R, "covariance": eye}),
            "Frame": (Frame, {"t": 0.25, "camera": 0, "number": 1, "pixels": pixels}),
            "Senses": (Senses, {"t": 0.25, "arm": ArmState(t=0.25, q=q, dq=q)}),
            "Throw": (Throw, {"r": _R, "dr": _DR}),
            "MapDesign": (mitt.MapDesign, design),
            "DirectMap": (DirectMap, {x.name: getattr(f, x.name) for x in fields(f)}),
            "Flight": (
                Flight,
                {
                    "t": np.zeros(1),
                    "ball": np.array([[_R, _DR, _DDR]]),
                    "seen": np.array([_R, _DR, _DDR]),
                },
            ),
            "forecast": (
                forecast,
                {"state": ball, "t": 0.375, "accel_density": 0.5, "drag_sigma": 0.0},
            ),
        }

    def refusals(self) -> dict[str, tuple[Callable[..., Value], dict[str, Value]]]:
        """Return functions that take long with right values: wrong ones are refused before."""
        f, arm = self.f, self.arm
        eyes, settings = Eyes(fixed_rig()), CatcherSettings()
        parts = {"arm": arm, "generator": Direct(f), "eyes": eyes, "settings": settings}
        return {
            "learn": (mitt.learn, {"arm": arm, "design": f.design, "seed": 1}),
            "simulate": (
                mitt.simulate,
                {"f": f, "throws": 1, "seed": 0, "scene": Scene(), "pixels": False},
            ),
            "build_arm": (build_arm, {"name_or_path": "wam"}),
            "Catcher": (Catcher, parts),
            "Arm": (Arm, {"model": arm.model, "limits": arm.limits}),
            "World": (World, {"scene": Scene(), "arm": arm.model}),
        }
