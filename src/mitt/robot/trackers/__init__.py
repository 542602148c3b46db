"""What sees the ball beside a robot: one module a tracker, found by its name.

The module ``NAME`` is what ``source.tracker = "NAME"`` stands for. It has ``NAME_tracker``, a
function from a :class:`mitt.io.cell.Cell` to a :class:`mitt.robot.cell.trackers.Tracker`, and
``check_NAME``, from cell and arm to lines that say what the tracker has to be; it connects to
nothing.
"""
