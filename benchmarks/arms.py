"""Arms that benchmarks ask for by name: the WAM, and two of the package example-robot-data.

Joints, held angles, ready poses and catch angles of the two are choices of this project: found by
hand on default throws, so that the arm catches some of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from sysconfig import get_paths

from mitt.core.arm.arm import Arm
from mitt.core.arm.hands import HandModel
from mitt.core.map.map_design import MapDesign
from mitt.io.load import build_arm

_ROBOTS = Path(get_paths()["purelib"]) / "cmeel.prefix/share/example-robot-data/robots"
#: Limit sets of the WAM, which are names of arms here.
WAM = ("paper", "wam-48v", "wam-80v")


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """An arm from a file, and the design of its map.

    Attributes:
        file: Below the package's robots, or a path.
        tip: Frame of the catch point.
        joints: Active joints.
        held: Angle of each joint that is held [rad].
        ready: Ready pose of the active joints [rad].
        q_catch: Angle of the catch joint at the catch [rad].
        inward: As of ``MapDesign``.
    """

    file: str
    tip: str
    joints: Sequence[str]
    held: dict[str, float] = field(default_factory=dict)
    ready: Sequence[float]
    q_catch: float
    inward: float


SETUPS = {
    "panda": Setup(
        file="panda_description/urdf/panda.urdf",
        tip="panda_hand_tcp",
        joints=("panda_joint1", "panda_joint2", "panda_joint4"),
        held={"panda_joint6": 3.1416},
        ready=(0.0, 0.785, -0.3),
        q_catch=-0.6,
        inward=-5.0,
    ),
    "so101": Setup(
        file="so_arm_description/urdf/so101.urdf",
        tip="gripper_frame_link",
        joints=("shoulder_pan", "shoulder_lift", "elbow_flex"),
        ready=(0.0, 0.0, 0.0),
        q_catch=0.8,
        inward=0.0,
    ),
}


def arm_of(setup: Setup) -> tuple[Arm, MapDesign]:
    """Load an arm and mount the hand."""
    arm = build_arm(
        _ROBOTS / setup.file,
        tip=setup.tip,
        joints=setup.joints,
        held=setup.held,
        ready=setup.ready,
        hand=HandModel(),
    )
    return arm, MapDesign(q_catch=setup.q_catch, inward=setup.inward)


def named(name: str) -> tuple[Arm, MapDesign | None]:
    """Return an arm by name, and the design of its map; None for that of its limit set."""
    return (build_arm("wam", limits=name), None) if name in WAM else arm_of(SETUPS[name])
