"""A simulated cell in real time: a tick each millisecond by the steady clock."""

from collections.abc import Callable
from typing import Any, final

from mitt.cell.prepare import PreparedCell, map_of
from mitt.cell.session import rehearse
from mitt.cell.simulated import Port, SimulatedCell
from mitt.link.clock import hurried, monotonic, pinned, sleep_until, time_of_day, uncollected
from mitt.signals import TICK
from mitt.trials.result import spread_of
from mitt.trials.source import Source
from mitt.world.scene import Scene

#: Lateness from which time is not made up for at once [s], and how much faster it is then [s/s].
_SLIP, _FASTER = 0.003, 0.25
CORE = 0
"""Core of the simulated cell among those allowed: the first; ``mitt run`` takes the last."""
#: Longest that the cell goes on after its last throw until its brakes are engaged [s].
_AFTER = 10.0

__all__ = ["CORE", "Server", "serve"]


@final
class Server:
    """A simulated cell that is served in real time."""

    def __init__(
        self, prepared: PreparedCell, scene: Scene, source: Source, tell: Callable[[str], None],
        port: Callable[[], Port],
    ) -> None:  # fmt: skip
        """Take the cell; ``port`` joins the network when the loop begins."""
        self._prepared, self._scene, self._source = prepared, scene, source
        self._tell, self._port = tell, port
        self._cell: SimulatedCell | None = None
        self.late = self.slipped = 0

    def run(self) -> None:
        """Serve until all throws are made and judged, and the robot is at rest."""
        prepared = self._prepared
        rehearse(prepared, map_of(prepared))
        with uncollected():
            port = self._port()
            self._cell = cell = SimulatedCell(
                prepared.cell, prepared.arm, self._scene, self._source, port,
                rig=prepared.rig, lenses=prepared.lenses, clock=monotonic, started=time_of_day(),
            )  # fmt: skip
            try:
                with hurried() as granted, pinned(CORE):
                    self._tell(f"{prepared.cell.name} is there; {granted}")
                    self._go_on(cell)
            finally:
                port.close()

    def _go_on(self, cell: SimulatedCell) -> None:
        """Make tick after tick, each at its time; after a stall a quarter faster until in time."""
        due, end, behind = monotonic(), float("inf"), 0.0
        while monotonic() < end:
            cell.tick()
            made_up = min(behind, _FASTER * TICK)
            due, behind = due + TICK - made_up, behind - made_up
            late = sleep_until(due)
            if late > _SLIP:
                self.slipped += 1
                due, behind = due + late, behind + late
            self.late += late > TICK
            cell.act()
            if cell.done:
                end = min(end, monotonic() + _AFTER) if cell.released else monotonic()

    def summary(self) -> dict[str, Any]:
        """Return what was thrown and what became of it."""
        cell = self._cell
        if cell is None:
            return {"throws": 0}
        said = cell.statuses
        return {
            "throws": len(said),
            **{name: said.count(name) for name in ("caught", "dropped", "missed", "aborted")},
            "force_n": spread_of(cell.forces),
            "limit_violations": cell.violations,
            "command_age_us": cell.ages.percentiles_us(),
            "late_ticks": self.late,
            "slipped_ticks": self.slipped,
        }


def serve(
    prepared: PreparedCell, scene: Scene, source: Source, tell: Callable[[str], None]
) -> Server:
    """Return a simulated cell that is to be served over ROS 2."""
    from mitt.link.ros2 import Ros2Cell  # noqa: PLC0415 (needs the extra ros2)

    return Server(prepared, scene, source, tell, lambda: Ros2Cell(prepared.cell, prepared.arm))
