"""A ROS 2 node that lets a learned controller drive: ``python ros2_follow.py JOB_DIRECTORY``.

It reads the ball's bearing (std_msgs/Float32 on /bearing, in rad, positive to the left) and each
sonar (sensor_msgs/Range on /sonar_0, /sonar_1, …, in the order of the job's sonar ring). Every
0.1 s it publishes a geometry_msgs/Twist on /cmd_vel. Try it with the wheels off the ground first.
"""

import sys
from collections.abc import Mapping, Sequence


def twist(steering: float, speed_mps: float, track_width_m: float) -> tuple[float, float]:
    """Return forward speed (m/s) and turn (rad/s) for wheel speeds V₀(1 + Δv) and V₀(1 − Δv)."""
    return speed_mps, -2 * speed_mps * steering / track_width_m


def observe(
    bearing_rad: float, ranges_m: Sequence[float], groups: Mapping[str, Sequence[int]]
) -> dict[str, float]:
    """Return the controller's inputs: the bearing and the least reading of each sonar group."""
    nearest = {name: min(ranges_m[i] for i in members) for name, members in groups.items()}
    return {"bearing": bearing_rad, **nearest}


def main() -> None:
    """Run the node until it is stopped."""
    import rclpy
    from geometry_msgs.msg import Twist
    from sensor_msgs.msg import Range
    from std_msgs.msg import Float32

    from fnnq_torchrl import best_seed, load_checkpoint, load_policy
    from fnnq_torchrl.config.checking import to_config
    from fnnq_torchrl.training.replaying import greedy_actions

    checkpoint = load_checkpoint(f"{sys.argv[1]}/checkpoint.pt")
    world = to_config(checkpoint.config).env
    network = load_policy(sys.argv[1], best_seed(sys.argv[1])).value_network
    sonar, robot = world.sensors.sonar, world.robot
    ranges, bearing = [sonar.range_m[1]] * len(sonar.ring), [0.0]
    rclpy.init()
    node = rclpy.create_node("fnnq")
    node.create_subscription(Float32, "bearing", lambda m: bearing.__setitem__(0, m.data), 10)
    for i in range(len(ranges)):
        hear = lambda m, i=i: ranges.__setitem__(i, m.range)  # noqa: E731
        node.create_subscription(Range, f"sonar_{i}", hear, 10)
    wheels = node.create_publisher(Twist, "cmd_vel", 10)

    def drive() -> None:
        [steering] = greedy_actions(network, [observe(bearing[0], ranges, sonar.groups)])
        command = Twist()
        command.linear.x, command.angular.z = twist(steering, robot.speed_mps, robot.track_width_m)
        wheels.publish(command)

    node.create_timer(world.time_step_s, drive)
    rclpy.spin(node)


if __name__ == "__main__":
    main()
