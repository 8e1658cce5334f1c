"""docs/bridges.md: what it shows runs; of ROS 2 the half towards the daemon."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
from pathlib import Path

from tests.daemon.running import Daemon
from tests.page_blocks import program, sections

ROOT = Path(__file__).parent.parent
SECTIONS = sections((ROOT / "docs" / "bridges.md").read_text())
CONFIG = (ROOT / "config" / "hapticd.toml").read_text()

RCLPY = """
import json, sys
sent = []
class Node:
    def create_publisher(self, kind, topic, depth):
        return Publisher(topic)
    def get_logger(self):
        return self
    def warning(self, text):
        raise SystemExit(text)
    def destroy_node(self):
        print(json.dumps(sent))
class Publisher:
    def __init__(self, topic):
        self.topic = topic
    def publish(self, message):
        sent.append([self.topic, message.told()])
def init(): pass
def create_node(name): return Node()
def ok(): return len(sent) < 200
def try_shutdown(): pass
"""

MESSAGES = """
class _Any:
    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        made = _Any()
        setattr(self, name, made)
        return made
    def told(self):
        return {name: one.told() if isinstance(one, _Any) else one for name, one in vars(self).items()}
class PointStamped(_Any): pass
class WrenchStamped(_Any): pass
"""


def environment(daemon: Daemon, *paths: Path) -> dict[str, str]:
    return {
        **os.environ,
        "HAPTICD_RUNTIME_DIR": str(daemon.directory / "run"),
        "MPLBACKEND": "agg",
        "PYTHONPATH": os.pathsep.join(map(str, [*paths, ROOT])),
    }


def test_the_cells_for_a_notebook_run(tmp_path: Path) -> None:
    source, given = program([block for block in SECTIONS["Jupyter"] if block.language == "python"])
    with Daemon(CONFIG).wait_ready() as daemon:
        done = subprocess.run(
            [sys.executable, "-c", source],
            input=given, cwd=tmp_path, env=environment(daemon), capture_output=True, text=True, check=False,
        )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_ros_bridge_gives_every_tick_to_its_publishers(tmp_path: Path) -> None:
    (tmp_path / "geometry_msgs").mkdir()
    (tmp_path / "rclpy.py").write_text(RCLPY)
    (tmp_path / "geometry_msgs" / "__init__.py").touch()
    (tmp_path / "geometry_msgs" / "msg.py").write_text(MESSAGES)
    with contextlib.ExitStack() as stack:
        daemon = stack.enter_context(Daemon(CONFIG)).wait_ready()
        done = subprocess.run(
            [sys.executable, ROOT / "docs" / "examples" / "ros2_bridge.py"],
            env=environment(daemon, tmp_path), capture_output=True, text=True, check=False,
        )  # fmt: skip
    assert done.returncode == 0, done.stderr
    sent = json.loads(done.stdout)
    points = [message for topic, message in sent if topic == "hapticd/position"]
    forces = [message for topic, message in sent if topic == "hapticd/force"]
    assert len(points) == len(forces) >= 100
    times_s = [one["header"]["stamp"]["sec"] + one["header"]["stamp"]["nanosec"] * 1e-9 for one in points]
    assert times_s == sorted(times_s)
    assert times_s[99] - times_s[0] > 0.098
    assert points[0]["header"]["frame_id"] == "hapticd"
    assert set(points[0]["point"]) == set(forces[0]["wrench"]["force"]) == {"x"}, "a device of one axis"
