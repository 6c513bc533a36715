"""A robot arm in URDF: two links of 1 kg that joints about y turn by 1 rad each way, and a tool on a fixed joint."""

LINK = (
    '<link name="{}"><inertial><origin xyz=".1 0 0"/><mass value="1"/>'
    '<inertia ixx=".01" iyy=".01" izz=".01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
JOINT = (
    '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/><origin xyz="{} 0 0"/><axis xyz="0 1 0"/>'
    '<limit lower="-1" upper="1" effort="30" velocity="5"/></joint>'
)
URDF = (
    '<robot name="arm"><link name="base"/>'
    + LINK.format("upper")
    + JOINT.format("shoulder", "revolute", "base", "upper", 0)
    + LINK.format("fore")
    + JOINT.format("elbow", "revolute", "upper", "fore", 0.3)
    + '<link name="tool"/>'
    + JOINT.format("flange", "fixed", "fore", "tool", 0.2)
    + "</robot>"
)
