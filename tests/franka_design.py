"""An arm file of a Panda that catches within all limits of its data sheet."""

from pathlib import Path
from sysconfig import get_paths

PANDA = "cmeel.prefix/share/example-robot-data/robots/panda_description/urdf/panda.urdf"
#: By `mitt design panda.urdf --tip panda_hand_tcp --limits franka-panda`, rounded.
DESIGN = """
schema = "mitt.arm/1"
[arm]
file = "{file}"
tip = "panda_hand_tcp"
joints = ["panda_joint1", "panda_joint2", "panda_joint3", "panda_joint4", "panda_joint6"]
ready = [-1.09871, -0.82363, 0.93243, -1.49714, 2.71801]
limits = "franka-panda"
[arm.held]
panda_joint5 = -0.58471
panda_joint7 = 1.44844
[hand]
name = "three-finger"
mount = "plate"
[map]
catch_joint = 0
q_catch = -0.76587
kappa = 1.96149
inward = 1.21946
free = [0, 2, 4]
coupling = [[-0.53859, -0.42736, 0.11661], [0.46633, -0.55867, 0.87200]]
[throws]
at = [0.39945, 0.59524, 0.82757]
around = [0.04, 0.24, 0.176]
"""


def panda_file(folder: Path) -> Path:
    """Write the arm file into a folder; return its path."""
    path = folder / "panda.toml"
    path.write_text(DESIGN.format(file=Path(get_paths()["purelib"]) / PANDA))
    return path
