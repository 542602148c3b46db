"""mitt lets a robot arm catch what is thrown at it.

Names are imported when they are first used, so that ``import mitt`` stays quick.
"""

import logging
from importlib import import_module
from typing import TYPE_CHECKING

from mitt.version import __version__

if TYPE_CHECKING:
    from mitt.ball.filter import BallFilter as BallFilter
    from mitt.catcher.catcher import Catcher as Catcher
    from mitt.catcher.generators import Direct as Direct
    from mitt.catcher.generators import Generator as Generator
    from mitt.catcher.settings import CatcherSettings as CatcherSettings
    from mitt.control.stop import plan_brake as plan_brake
    from mitt.errors import MittError as MittError
    from mitt.eyes.eyes import Eyes as Eyes
    from mitt.files.arm_file import load_arm as load_arm
    from mitt.files.maps import read_map as read_map
    from mitt.map.map_design import MapDesign as MapDesign
    from mitt.map.mapping import DirectMap as DirectMap
    from mitt.map.neighbourhood import learn as learn
    from mitt.signals import ArmState as ArmState
    from mitt.signals import BallState as BallState
    from mitt.signals import Command as Command
    from mitt.signals import Frame as Frame
    from mitt.signals import JointReference as JointReference
    from mitt.signals import Senses as Senses
    from mitt.signals import Sighting as Sighting
    from mitt.trials.runs import simulate as simulate
    from mitt.verdict.feasibility import Outcome as Outcome
    from mitt.verdict.feasibility import Verdict as Verdict
    from mitt.world.scene import Scene as Scene

_HOMES = {
    "ArmState": "mitt.signals",
    "BallFilter": "mitt.ball.filter",
    "BallState": "mitt.signals",
    "Catcher": "mitt.catcher.catcher",
    "CatcherSettings": "mitt.catcher.settings",
    "Command": "mitt.signals",
    "Direct": "mitt.catcher.generators",
    "DirectMap": "mitt.map.mapping",
    "Eyes": "mitt.eyes.eyes",
    "Frame": "mitt.signals",
    "Generator": "mitt.catcher.generators",
    "JointReference": "mitt.signals",
    "MapDesign": "mitt.map.map_design",
    "MittError": "mitt.errors",
    "Outcome": "mitt.verdict.feasibility",
    "Scene": "mitt.world.scene",
    "Senses": "mitt.signals",
    "Sighting": "mitt.signals",
    "Verdict": "mitt.verdict.feasibility",
    "learn": "mitt.map.neighbourhood",
    "load_arm": "mitt.files.arm_file",
    "plan_brake": "mitt.control.stop",
    "read_map": "mitt.files.maps",
    "simulate": "mitt.trials.runs",
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
