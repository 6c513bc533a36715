"""Robots from model files, MJCF or URDF, simulated by MuJoCo."""

WORDS = "environment  mujoco_robot  mujoco=MujocoRobot"
PUBLIC = "mujoco_robot  MujocoRobot"
