"""An arm on the table, by LeRobot."""

WORDS = "environment  arm  lerobot=LeRobotArm"
PUBLIC = "arm  LeRobotArm"
NEEDS = ("models", "recordings")
CODE = ("robot", "seen_by")
