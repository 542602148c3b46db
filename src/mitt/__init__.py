"""mitt lets a robot arm catch what is thrown at it.

Names are imported when they are first used, so that ``import mitt`` stays quick.
"""

import logging
from importlib import import_module
from typing import TYPE_CHECKING

from mitt.version import __version__

if TYPE_CHECKING:
    from mitt.core.ball.filter import BallFilter as BallFilter
    from mitt.core.catcher.catcher import Catcher as Catcher
    from mitt.core.catcher.generators import Direct as Direct
    from mitt.core.catcher.generators import Generator as Generator
    from mitt.core.catcher.settings import CatcherSettings as CatcherSettings
    from mitt.core.control.stop import plan_brake as plan_brake
    from mitt.core.errors import MittError as MittError
    from mitt.core.eyes.eyes import Eyes as Eyes
    from mitt.core.map.map_design import MapDesign as MapDesign
    from mitt.core.map.mapping import DirectMap as DirectMap
    from mitt.core.map.neighbourhood import learn as learn
    from mitt.core.signals import ArmState as ArmState
    from mitt.core.signals import BallState as BallState
    from mitt.core.signals import Command as Command
    from mitt.core.signals import Frame as Frame
    from mitt.core.signals import JointReference as JointReference
    from mitt.core.signals import Senses as Senses
    from mitt.core.signals import Sighting as Sighting
    from mitt.core.verdict.feasibility import Outcome as Outcome
    from mitt.core.verdict.feasibility import Verdict as Verdict
    from mitt.io.arm_file import load_arm as load_arm
    from mitt.io.maps import read_map as read_map
    from mitt.lab.trials.runs import simulate as simulate
    from mitt.lab.world.scene import Scene as Scene

_HOMES = {
    "ArmState": "mitt.core.signals",
    "BallFilter": "mitt.core.ball.filter",
    "BallState": "mitt.core.signals",
    "Catcher": "mitt.core.catcher.catcher",
    "CatcherSettings": "mitt.core.catcher.settings",
    "Command": "mitt.core.signals",
    "Direct": "mitt.core.catcher.generators",
    "DirectMap": "mitt.core.map.mapping",
    "Eyes": "mitt.core.eyes.eyes",
    "Frame": "mitt.core.signals",
    "Generator": "mitt.core.catcher.generators",
    "JointReference": "mitt.core.signals",
    "MapDesign": "mitt.core.map.map_design",
    "MittError": "mitt.core.errors",
    "Outcome": "mitt.core.verdict.feasibility",
    "Scene": "mitt.lab.world.scene",
    "Senses": "mitt.core.signals",
    "Sighting": "mitt.core.signals",
    "Verdict": "mitt.core.verdict.feasibility",
    "learn": "mitt.core.map.neighbourhood",
    "load_arm": "mitt.io.arm_file",
    "plan_brake": "mitt.core.control.stop",
    "read_map": "mitt.io.maps",
    "simulate": "mitt.lab.trials.runs",
}
__all__ = [  # noqa: PLE0604 (strings all the same)
    "__version__",
    *_HOMES,
]


# What mitt has to say goes to the logger "mitt", silent until a program gives it a handler.
logging.getLogger("mitt").addHandler(logging.NullHandler())


def __getattr__(name: str) -> object:
    """Import a public name from its module when it is first used (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module 'mitt' has no attribute {name!r}")
    value: object = vars(import_module(_HOMES[name]))[name]
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public names."""
    return sorted(__all__)
