"""A robot's own node for the driver `ros2`: an action server in rclpy that performs acts, and the transform to the field.

Build `chefshat_msgs` in the robot's workspace, start `zenoh-bridge-ros2dds -l tcp/0.0.0.0:7447`, then this node:

    python ros2_robot.py --ros-args -p seat:=1 -p distance:=0.3 -p table:=0.7

and `chefshat-robot robot --driver ros2:connect=tcp/ROBOT:7447 --code JOIN-CODE` anywhere. `distance` is from the edge of the field
to `base_link`, which faces its middle, and `table` the height of the table above it, in m. Where a robot stands differently, give
`-p publish:=false` and publish your own transform from `base_link` to `chefshat_field`. In place of the logs, let your robot move.
"""

import math
from typing import Any

import rclpy
from chefshat_msgs.action import PlayTurn
from chefshat_msgs.msg import Act
from geometry_msgs.msg import Point, PointStamped, TransformStamped
from rclpy.action import ActionServer, CancelResponse
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from tf2_geometry_msgs import do_transform_point
from tf2_ros import Buffer, StaticTransformBroadcaster, TransformListener

from chefshat_robot.drivers.standpoint import Standpoint
from chefshat_robot.table import TableState

FIELD = "chefshat_field"


class Robot(Node):
    """Performs the acts of a turn, one after another."""

    def __init__(self) -> None:
        super().__init__("chefshat_robot")
        self._base: str = self.declare_parameter("base", "base_link").value
        self._frames = Buffer()
        self._listener = TransformListener(self._frames, self)
        self._broadcaster = StaticTransformBroadcaster(self)
        if self.declare_parameter("publish", True).value:
            self._broadcaster.sendTransform(self._field())
        self._server = ActionServer(
            self, PlayTurn, "/chefshat/play_turn", self._play, cancel_callback=lambda goal: CancelResponse.ACCEPT
        )

    def _field(self) -> TransformStamped:
        """The field in the frame of the base."""
        seat: int = self.declare_parameter("seat", 0).value
        distance: float = self.declare_parameter("distance", 0.3).value
        table: float = self.declare_parameter("table", 0.7).value
        standpoint = Standpoint.at(TableState(seat=seat, names=("",) * 4), 1000 * distance, 1000 * table)
        x, y, z, yaw = standpoint.field_frame()
        transform = TransformStamped()
        transform.header.stamp = self.get_clock().now().to_msg()
        transform.header.frame_id, transform.child_frame_id = self._base, FIELD
        transform.transform.translation.x, transform.transform.translation.y, transform.transform.translation.z = x, y, z
        transform.transform.rotation.z, transform.transform.rotation.w = math.sin(yaw / 2), math.cos(yaw / 2)
        return transform

    def _play(self, goal: Any) -> PlayTurn.Result:  # noqa: ANN401 (rclpy has no types)
        """Performs the acts of a goal."""
        result = PlayTurn.Result()
        for number, act in enumerate(goal.request.acts):
            if goal.is_cancel_requested:
                goal.canceled()
                result.reason = "cancelled"
                return result
            goal.publish_feedback(PlayTurn.Feedback(act=number))
            result.reason = self._act(act)
            if result.reason:
                goal.abort()
                return result
            result.performed = number + 1
        result.done = True
        goal.succeed()
        return result

    def _act(self, act: Act) -> str:
        """Acts. Returns why it failed; empty if it did not."""
        log = self.get_logger()
        if act.kind == Act.SAY:
            log.info(f"says: {act.text}")
        elif act.kind == Act.PICK:
            for move in act.moves:
                end = self._before(move.end.position)
                log.info(f"carries the {move.piece} to {end.x:.3f} m before it and {end.y:.3f} m to its left")
        elif act.kind in (Act.POINT, Act.GAZE):
            target = self._before(act.target)
            log.info(f"turns to {target.x:.3f}, {target.y:.3f}, {target.z:.3f} m")
        elif act.kind == Act.EXPRESS:
            log.info(f"shows {act.label}")
        else:
            return f"this robot knows no act {act.kind}"
        return ""

    def _before(self, point: Point) -> Point:
        """A point of the field in the frame of the base."""
        transform = self._frames.lookup_transform(self._base, FIELD, rclpy.time.Time())
        return do_transform_point(PointStamped(point=point), transform).point


if __name__ == "__main__":
    rclpy.init()
    executor = MultiThreadedExecutor()
    executor.add_node(Robot())
    executor.spin()
