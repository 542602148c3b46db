"""A cell over ROS 2 whose topics are its own, so that tests do not hear each other."""

from typing import Any

from mitt.io.cell import Cell, arm_of, read_cell

NAMES = ("j1", "j2", "j4")
ARM = arm_of(read_cell("wam-sim"))


def topics(tag: str) -> dict[str, str]:
    """Return the options of a cell whose topics begin with a tag."""
    return {
        "state": f"/{tag}/joint_states",
        "command": f"/{tag}/joint_trajectory",
        "hand": "hand",
        "hand_command": f"/{tag}/hand/commands",
        "brake": f"/{tag}/brake",
        "status": "robot",
        "diagnostics": f"/{tag}/diagnostics",
    }


def cell_with(tag: str, **options: Any) -> Cell:  # noqa: ANN401
    """Return the shipped cell with these topics."""
    cell = read_cell("wam-sim")
    robot = cell.robot.model_copy(update={"options": topics(tag) | options})
    source = cell.source.model_copy(update={"topic": f"/{tag}/ball"})
    return cell.model_copy(update={"robot": robot, "source": source})
