"""An arm that is no LeRobot arm: --environment.robot driver:make. The six calls, here of an arm that is only numbers.

In a ROS 2 node, rclpy.spin runs in a thread of its own. What it would do in each call is written beside it.
"""

JOINTS = ("shoulder", "elbow", "wrist")  # names of the joints in the model file


class Driver:
    def __init__(self) -> None:
        self.action_features = {f"{joint}.pos": float for joint in JOINTS}  # 1. what it takes, and reads
        self.is_connected = False  # 2. whether connect() was called
        self.positions = dict.fromkeys(self.action_features, 0.0)

    def connect(self) -> None:
        """3. Switch torque on. ROS 2: activate the controller by its service; wait for the first joint state."""
        self.is_connected = True

    def get_observation(self) -> dict[str, float]:
        """4. Positions now, in the unit of --environment.units. ROS 2: the last message of /joint_states; if that is
        older than .1 s, raise ConnectionError."""
        return dict(self.positions)

    def send_action(self, positions: dict[str, float]) -> None:
        """5. Go there; do not wait for it. ROS 2: publish a JointTrajectory of one point, one tick ahead."""
        self.positions.update(positions)

    def disconnect(self) -> None:
        """6. Switch torque off, whatever happened; an error here says that torque may be on. ROS 2: call the service
        that deactivates the controller."""
        self.is_connected = False


def make() -> Driver:
    return Driver()
