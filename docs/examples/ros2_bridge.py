"""Publish what a daemon measures as ROS 2 topics. Needs hapticd and a sourced ROS 2 (rclpy, geometry_msgs)."""

import sys

import rclpy
from geometry_msgs.msg import PointStamped, WrenchStamped

import hapticd
from hapticd.client import Position


def stamp(header, timestamp):
    """The tick's own time, which is not that of its arrival."""
    header.frame_id = "hapticd"
    header.stamp.sec = int(timestamp)
    header.stamp.nanosec = round(timestamp % 1.0 * 1e9) % 1_000_000_000


def main():
    """Publish until ROS 2 ends."""
    rclpy.init()
    node = rclpy.create_node("hapticd")
    positions = node.create_publisher(PointStamped, "hapticd/position", 100)
    forces = node.create_publisher(WrenchStamped, "hapticd/force", 100)
    instance = sys.argv[1] if len(sys.argv) > 1 else "default"
    with hapticd.connect(instance, topics=[Position]) as daemon:
        while rclpy.ok():
            for tick in daemon.receive(0.1):
                if not isinstance(tick, Position):  # a gap
                    node.get_logger().warning(f"{tick.missing} ticks did not arrive")
                    continue
                point, force = PointStamped(), WrenchStamped()
                stamp(point.header, tick.timestamp)
                stamp(force.header, tick.timestamp)
                for axis, position_m, force_n in zip("xyz", tick.position_m, tick.force_n, strict=False):
                    setattr(point.point, axis, position_m)
                    setattr(force.wrench.force, axis, force_n)
                positions.publish(point)
                forces.publish(force)
    node.destroy_node()
    rclpy.try_shutdown()


if __name__ == "__main__":
    main()
