"""``mitt guard`` as a ROS 2 node of rclpy sees it: how soon zeros come after mitt was killed.

    python benchmarks/guard_at_rclpy.py --rclpy VENV/bin/python --kills 20

VENV is an environment of its own with ``ros-jazzy-rclpy``, ``ros-jazzy-std-msgs`` and
``ros-jazzy-rmw-fastrtps-cpp``: ROS 2 on Fast DDS. A process commands joints each millisecond by
mitt's own publisher and is killed by SIGKILL; the node in the controller's place notes when it
hears the last command and the first zero.
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

TOPIC = "/guarded_arm/commands"
"""What the controller takes."""
INTO = "/mitt_guard/commands"
"""What mitt sends."""
CELL = f"""schema = "mitt.cell/1"
name = "guarded"
[arm]
file = "wam"
[robot]
watchdog = 0.01
[robot.options]
command = "{TOPIC}"
guard = "{INTO}"
unbraked = true
"""
NODE = """
import sys, time
import rclpy
from std_msgs.msg import Float64MultiArray
rclpy.init()
node = rclpy.create_node("controller")
moves = None
def hear(message):
    global moves
    now, new = time.monotonic(), any(message.data)
    if new:
        node.last = now
    if new != moves:
        print("moves" if new else f"zero {now - node.last if moves else 0.0}", flush=True)
    moves = new
node.create_subscription(Float64MultiArray, sys.argv[1], hear, 50)
rclpy.spin(node)
"""
COMMANDER = """
import sys, time
import numpy as np
from mitt.robot.cell import dds
from mitt.robot.cell import ros2_messages as messages
node = dds.Node()
out = node.publish(sys.argv[1], dds.MultiArray, "command")
while True:
    if out.listeners():
        out.send(messages.array_message(np.full(3, 0.5), time.time()))
    time.sleep(0.001)
"""


def main() -> None:
    """Kill a commander again and again; print how long the node was left with its last command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rclpy", required=True, help="python of an environment with rclpy")
    parser.add_argument("--kills", type=int, default=20)
    options = parser.parse_args()
    os.environ.setdefault("ROS_DOMAIN_ID", "97")
    left = list[float]()
    with tempfile.TemporaryDirectory() as folder:
        cell = Path(folder) / "cell.toml"
        cell.write_text(CELL)
        node = subprocess.Popen(  # noqa: S603 (our own programs)
            [options.rclpy, "-c", NODE, TOPIC], stdout=subprocess.PIPE, text=True
        )
        guard = subprocess.Popen(  # noqa: S603
            [sys.executable, "-m", "mitt", "guard", str(cell)]
        )
        try:
            assert node.stdout is not None
            while len(left) < options.kills:
                commander = subprocess.Popen(  # noqa: S603
                    [sys.executable, "-c", COMMANDER, INTO]
                )
                while (heard := node.stdout.readline()) != "moves\n":
                    if not heard:
                        raise SystemExit("the node of rclpy has ended")
                time.sleep(0.2)
                commander.send_signal(signal.SIGKILL)
                commander.wait()
                word, _, value = node.stdout.readline().partition(" ")
                if word == "zero":
                    left.append(1e3 * float(value))
        finally:
            guard.send_signal(signal.SIGINT)
            node.kill()
            guard.wait()
            node.wait()
    p50, p90 = np.percentile(left, [50, 90])
    said = {"kills": len(left), "p50_ms": p50, "p90_ms": p90, "max_ms": max(left)}
    print(json.dumps({name: round(float(x), 2) for name, x in said.items()}))


if __name__ == "__main__":
    main()
