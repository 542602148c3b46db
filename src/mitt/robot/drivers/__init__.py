"""Drivers of makers' robots: one module a driver, found by its name.

The module ``NAME`` is what ``robot.driver = "NAME"`` stands for. It has ``NAME_driver``, a function
from a :class:`mitt.io.cell.Cell` and its arm to a :class:`mitt.robot.cell.robot.Robot`, and
``check_NAME``, from the same to lines that say what the robot has to be; it connects to nothing.
"""
