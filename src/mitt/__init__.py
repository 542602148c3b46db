"""mitt lets a robot arm catch what is thrown at it.

Names are imported when they are first used, so that ``import mitt`` stays quick.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from mitt.version import __version__

if TYPE_CHECKING:
    from mitt.catcher.catcher import Catcher as Catcher
    from mitt.errors import MittError as MittError
    from mitt.files.arms import load_arm as load_arm
    from mitt.generator.design import MapDesign as MapDesign
    from mitt.generator.mapping import DirectMap as DirectMap
    from mitt.signals import ArmState as ArmState
    from mitt.signals import BallState as BallState
    from mitt.signals import Command as Command
    from mitt.signals import JointReference as JointReference
    from mitt.trials.learning import learn as learn
    from mitt.trials.simulate import simulate as simulate

_HOMES = {
    "ArmState": "mitt.signals",
    "BallState": "mitt.signals",
    "Catcher": "mitt.catcher.catcher",
    "Command": "mitt.signals",
    "DirectMap": "mitt.generator.mapping",
    "JointReference": "mitt.signals",
    "MapDesign": "mitt.generator.design",
    "MittError": "mitt.errors",
    "learn": "mitt.trials.learning",
    "load_arm": "mitt.files.arms",
    "simulate": "mitt.trials.simulate",
}
__all__ = [  # noqa: PLE0604 (strings all the same)
    "__version__",
    *_HOMES,
]


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
