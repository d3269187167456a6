"""A ROS 2 node that lets a learned controller drive: ``python ros2_follow.py JOB_DIRECTORY``.

It reads the ball's bearing (std_msgs/Float32 on /bearing, in rad, positive to the left) and each
sonar (sensor_msgs/Range on /sonar_0, /sonar_1, …, in the order of the job's sonar ring). Every
0.1 s it publishes a geometry_msgs/Twist on /cmd_vel. Try it with the wheels off the ground first.
"""

import sys
from typing import Any


def twist(steering: float, speed_mps: float, track_width_m: float) -> tuple[float, float]:
    """Return forward speed (m/s) and turn (rad/s) for wheel speeds V₀(1 + Δv) and V₀(1 − Δv)."""
    return speed_mps, -2 * speed_mps * steering / track_width_m


def observe(bearing_rad: float, ranges_m: list[float], sonar: Any) -> dict[str, float]:
    """Return the controller's inputs: the bearing and the least reading of each sonar group."""
    groups, span_m = (sonar.groups, sonar.range_m) if sonar else ({}, [])
    # Without an echo, a driver reports infinity or NaN, and the simulator the greatest reading.
    seen = [max(span_m[0], min(span_m[1], range_m)) for range_m in ranges_m]
    return {"bearing": bearing_rad, **{name: min(seen[i] for i in groups[name]) for name in groups}}


def main() -> None:
    """Run the node until it is stopped."""
    import rclpy
    from geometry_msgs.msg import Twist
    from sensor_msgs.msg import Range
    from std_msgs.msg import Float32

    from fnnq_torchrl import best_seed, load_checkpoint, load_policy
    from fnnq_torchrl.config.checking import to_config
    from fnnq_torchrl.training.replaying import greedy_actions

    world = to_config(load_checkpoint(f"{sys.argv[1]}/checkpoint.pt").config).env
    network = load_policy(sys.argv[1], best_seed(sys.argv[1])).value_network
    robot = getattr(world, "robot", world)  # task=follow has no robot: and no sensors:
    sonar = world.sensors.sonar if hasattr(world, "sensors") else None
    ranges, bearing = [sonar.range_m[1] for _ in sonar.ring] if sonar else [], [0.0]
    rclpy.init()
    node = rclpy.create_node("fnnq")
    node.create_subscription(Float32, "bearing", lambda m: bearing.__setitem__(0, m.data), 10)
    for i in range(len(ranges)):
        hear = lambda m, i=i: ranges.__setitem__(i, m.range)  # noqa: E731
        node.create_subscription(Range, f"sonar_{i}", hear, 10)
    wheels = node.create_publisher(Twist, "cmd_vel", 10)

    def drive() -> None:
        [steering] = greedy_actions(network, [observe(bearing[0], ranges, sonar)])
        command = Twist()
        command.linear.x, command.angular.z = twist(steering, robot.speed_mps, robot.track_width_m)
        wheels.publish(command)

    node.create_timer(world.time_step_s, drive)
    rclpy.spin(node)


if __name__ == "__main__":
    main()
