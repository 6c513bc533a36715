"""Model files that nobody made for this library: what is told before the first movement, and what is learnt.

    pip install --target robots --no-deps dm_control robosuite pybullet gymnasium gymnasium-robotics metaworld
    experiments/model_files.py robots                   the rows that the page ANY_ROBOT lacks
    experiments/model_files.py wheels/* --results mine  packages in folders of their own, rows in mine/

Nothing is downloaded, and no file is changed: one command for each, with the options in ``FILES``. A file is "refused"
with an error, "warned" if `sgimd check` says what makes learning hopeless, else "right"; then practice and random
movements learn it. The words that have to be told are in ``FILES``, too, by reading the file.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import distributions
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from scipy import stats

from sgimd_torch.environments.protocol import FromFiles
from sgimd_torch.extras.sweep.command import cores
from sgimd_torch.extras.sweep.parallel import Machine, sweep
from sgimd_torch.extras.table.statistics import LEVEL
from sgimd_torch.files import make_folder
from sgimd_torch.options.config import Config
from sgimd_torch.runs.messages import say
from sgimd_torch.runs.plan import task_of
from sgimd_torch.runs.program import command
from sgimd_torch.runs.read import read_run
from table import TABLES, Row, merge, read_table

TABLE: Final = "model_files.csv"
LEARNERS: Final = ("practice", "random")
SEEDS: Final = range(1000, 1003)
MOVEMENTS: Final = 500
WARNINGS: Final = ("holding still, ", "miss their commands", "end far apart", "movements move ", "diverges")
RIGHT: Final = "right"
WARNED: Final = "warned"
REFUSED: Final = "refused"
DISTRIBUTIONS: Final = {"pybullet_data": "pybullet"}  # packages that are called otherwise than what installs them


class File(NamedTuple):
    """A model file, the place of its outcome, "right" or words of what has to be told, and further options."""

    path: str
    outcome: str
    expected: str = RIGHT
    options: str = ""


FILES: Final = (
    File("dm_control/third_party/kinova/jaco_arm.xml", "site:wristsite"),
    File("robosuite/models/assets/robots/panda/robot.xml", "body:right_hand"),
    File("gymnasium/envs/mujoco/assets/reacher.xml", "body:fingertip:xy"),
    File("pybullet_data/kuka_iiwa/model.urdf", "body:lbr_iiwa_link_7"),
    File("robosuite/models/assets/robots/ur5e/robot.xml", "body:right_hand", "miss their commands"),
    File("dm_control/suite/reacher.xml", "body:finger:xy"),
    File("dm_control/suite/finger.xml", "geom:fingertip:xz"),
    File("dm_control/suite/finger.xml", "joint:hinge"),
    File("dm_control/suite/point_mass.xml", "body:pointmass:xy"),
    File("dm_control/suite/fish.xml", "body:torso"),
    File("dm_control/suite/cartpole.xml", "joint:hinge_1"),
    File("gymnasium/envs/mujoco/assets/pusher.xml", "body:tips_arm"),
    File("gymnasium/envs/mujoco/assets/swimmer.xml", "body:torso:xy"),
    File("gymnasium/envs/mujoco/assets/ant.xml", "body:torso:xy"),
    File("gymnasium_robotics/envs/assets/point/point.xml", "body:particle:xy", RIGHT, "--environment.servos=file"),
    File("pybullet_data/pendulum5.urdf", "body:link4:yz"),
    File("pybullet_data/a1/a1.urdf", "body:FR_lower"),
    File("pybullet_data/mjcf/ant.xml", "body:front_left_foot:xy"),
    File("pybullet_data/cartpole.urdf", "body:pole:x"),
    File("dm_control/third_party/kinova/jaco_hand.xml", "body:b_finger_tip_1"),
    File("robosuite/models/assets/grippers/panda_gripper.xml", "body:finger_joint1_tip:y"),
    File("robosuite/models/assets/robots/iiwa/robot.xml", "body:right_hand"),
    File("robosuite/models/assets/robots/kinova3/robot.xml", "body:right_hand"),
    File("robosuite/models/assets/robots/sawyer/robot.xml", "body:right_hand"),
    File("robosuite/models/assets/robots/xarm7/robot.xml", "body:right_hand"),
    File("robosuite/models/assets/robots/spot_arm/robot.xml", "body:right_hand"),
    File("robosuite/models/assets/robots/spot/robot.xml", "site:center"),  # the file has no gravity
    File("metaworld/assets/sawyer_xyz/sawyer_reach_v3.xml", "site:endEffector", RIGHT, "--environment.servos=made"),
    File("gymnasium_robotics/envs/assets/fetch/reach.xml", "site:robot0:grip"),
    File("dm_control/suite/manipulator.xml", "site:pinch:xz"),
    File("pybullet_data/franka_panda/panda.urdf", "body:panda_hand"),
    File("robosuite/models/assets/bullet_data/panda_description/urdf/panda_arm.urdf", "body:panda_link7"),
    File("robosuite/models/assets/bullet_data/sawyer_description/urdf/sawyer_arm.urdf", "body:right_l6"),
    File("dm_control/suite/acrobot.xml", "site:tip:xz", "miss their commands"),
    File("dm_control/suite/pendulum.xml", "geom:mass:xz", "miss their commands"),
    File("dm_control/suite/cheetah.xml", "body:torso:xz", "miss their commands"),
    File("dm_control/suite/walker.xml", "body:torso:xz", "miss their commands"),
    File("dm_control/suite/humanoid_CMU.xml", "body:rhand", "holding still"),
    File("gymnasium/envs/mujoco/assets/hopper.xml", "body:torso:xz", "holding still"),
    File("gymnasium/envs/mujoco/assets/half_cheetah.xml", "body:torso:xz", "miss their commands"),
    File("gymnasium/envs/mujoco/assets/humanoid.xml", "body:right_lower_arm", "holding still"),
    File("gymnasium/envs/mujoco/assets/inverted_double_pendulum.xml", "site:tip:xz", "holding still"),
    File("gymnasium_robotics/envs/assets/hand/reach.xml", "site:robot0:S_fftip", "miss their commands"),
    File("gymnasium_robotics/envs/assets/hand/manipulate_block.xml", "body:object", "holding still"),
    File("gymnasium_robotics/envs/assets/adroit_hand/adroit_door.xml", "joint:door_hinge"),  # scaled commands
    File("gymnasium_robotics/envs/assets/adroit_hand/adroit_relocate.xml", "site:S_grasp", "holding still"),
    File("robosuite/models/assets/robots/baxter/robot.xml", "body:right_hand", "miss their commands"),
    File("robosuite/models/assets/robots/gr1/robot.xml", "site:right_center", "holding still"),
    File(
        "robosuite/models/assets/grippers/inspire_left_hand.xml", "site:site_l_index_distal:xz", "miss their commands"
    ),
    File("robosuite/models/assets/grippers/jaco_three_finger_gripper.xml", "body:thumb_distal", "miss their commands"),
    File("pybullet_data/quadruped/minitaur.urdf", "body:lower_leg_front_rightL_link", "miss their commands"),
    File("pybullet_data/humanoid/humanoid.urdf", "body:right_wrist", "holding still"),
    File("pybullet_data/mjcf/thrower.xml", "body:object:xy", "holding still"),
    File(
        "dm_control/suite/ball_in_cup.xml", "body:ball:xz", "slides without a range stay where they are: cup_x, cup_z"
    ),
    File("dm_control/suite/lqr.xml", "body:world", "no actuator moves a joint"),
    File("gymnasium/envs/mujoco/assets/pusher.xml", "body:object:xy", "put the object nearer"),
    File("gymnasium_robotics/envs/assets/fetch/push.xml", "body:object0:xy", "put the object nearer"),
    File("pybullet_data/mjcf/striker.xml", "body:object:xy", "put the object nearer"),
    File(
        "metaworld/assets/sawyer_xyz/sawyer_push_v3.xml",
        "body:obj:xy",
        "put the object nearer",
        "--environment.servos=made",
    ),
    File("metaworld/assets/sawyer_xyz/sawyer_reach_v3.xml", "site:endEffector", "a mocap body holds hand"),
    File("metaworld/assets/sawyer_xyz/sawyer_door_pull.xml", "joint:doorjoint", "free hand from its mocap body"),
    File("robosuite/models/assets/robots/panda/robot.xml", "site:right_center", "is it on the base?"),
    File("robosuite/models/assets/robots/iiwa/robot.xml", "site:right_center", "on the axis"),
    File("pybullet_data/differential/diff_ring.urdf", "body:diff_sideA", "on the axis"),
    File("robosuite/models/assets/grippers/robotiq_gripper_85.xml", "site:grip_site", "repeated name"),
    File("pybullet_data/xarm/xarm6_robot.urdf", "body:link6", "balanceinertia"),
    File("pybullet_data/mini_cheetah/mini_cheetah.urdf", "body:toe_fr", "balanceinertia"),
    File("pybullet_data/laikago/laikago_toes.urdf", "body:toeRL", "boundinertia"),
    File("pybullet_data/husky/husky.urdf", "body:base_link", "a template of xacro"),
    File("pybullet_data/mjcf/hopper.xml", "body:foot", "global coordinates no longer supported"),
    File("pybullet_data/kuka_iiwa/model.sdf", "body:lbr_iiwa_link_7", "is an SDF file"),
)


def found(file: File, folders: Sequence[Path]) -> tuple[Path, str]:
    """The path of a file, and the version of its package.

    Raises:
        FileNotFoundError: no folder has the file.
    """
    package = file.path.partition("/")[0]
    for folder in folders:
        if (path := folder / file.path).is_file():
            installed = distributions(name=DISTRIBUTIONS.get(package, package), path=[str(folder)])
            return path, next((each.version for each in installed), "")
    raise FileNotFoundError(f"no folder has {file.path}; does it lie in site-packages or in an unzipped wheel?")


def told(file: File, path: Path) -> tuple[str, str]:
    """What `sgimd check` tells of a file: "right", "warned" or "refused", and the warnings or the error."""
    model = [f"--environment.model={path}", f"--environment.outcome={file.outcome}", *file.options.split()]
    checked = subprocess.run(
        [sys.executable, "-m", "sgimd_torch", "check", "mujoco", *model], capture_output=True, text=True, check=False
    )
    if checked.returncode:
        return REFUSED, " ".join(checked.stderr.rpartition("error: ")[2].split())
    warnings = [line.strip() for line in checked.stdout.splitlines() if any(words in line for words in WARNINGS)]
    return (WARNED if warnings else RIGHT), " | ".join(warnings)


def lives(file: File, path: Path, out: Path) -> list[Config]:
    """Runs of both learners; what the robot finds by movements, such as T, is found once."""
    settings: dict[str, Any] = {
        "environment": "mujoco",
        "environment.model": str(path),
        "environment.outcome": file.outcome,
        **dict(word.removeprefix("--").split("=", 1) for word in file.options.split()),
        "movements": MOVEMENTS,
        "evaluate_at": (MOVEMENTS,),
        "floor_at": (),
        "repeats": 0,
        "out": out / file.path.replace("/", " ") / file.outcome,
    }
    config = Config.from_settings(settings)
    robot = task_of(config).environment
    assert isinstance(robot, FromFiles)
    config = config.with_found(robot.found_options)
    return [replace(config, algorithm=name, seed=seed) for seed in SEEDS for name in LEARNERS]


def errors(configs: Sequence[Config]) -> dict[str, float]:
    """The geometric mean of each learner's errors, and their ratio with its interval by Welch's test of logarithms."""
    logs = [
        [np.log(read_run(config.directory).at(MOVEMENTS)) for config in configs if config.algorithm == name]
        for name in LEARNERS
    ]
    ours, theirs = map(np.mean, logs)
    between = stats.ttest_ind(*logs, equal_var=False).confidence_interval(LEVEL)
    found = zip((*LEARNERS, "ratio", "low", "high"), (ours, theirs, ours - theirs, *between), strict=True)
    return {name: float(np.exp(value)) for name, value in found}


def main(argv: Sequence[str] | None = None) -> int:
    """Make the rows that the table lacks; returns the exit code, 1 if a run failed."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--results", type=Path, default=Path("results"), help="folder of the table (default: results)")
    options.add_argument("folders", nargs="+", type=Path, metavar="FOLDER", help="folder with installed packages")
    options.add_argument("--out", type=Path, default=Path("runs/model-files"), help="folder of the runs")
    chosen = options.parse_args(argv)
    make_folder(chosen.out)
    failures = list[str]()
    for n, file in enumerate(FILES, 1):
        table = read_table(chosen.results, TABLE)
        known = table[(table.file == file.path) & (table.outcome == file.outcome) & (table.options == file.options)]
        row: Row = next(iter(known.to_dict("records")), {})
        if row and (row["told"] != RIGHT or row["ratio"] > 0):
            continue
        path, version = found(file, chosen.folders)
        if not row:
            verdict, words = told(file, path)
            row = dict.fromkeys(TABLES[TABLE][1], np.nan) | {"file": file.path, "outcome": file.outcome}
            row |= {"options": file.options, "version": version, "told": verdict, "words": words}
            merge(chosen.results, TABLE, [row])
        say(f"{n} of {len(FILES)}: {file.path} {file.outcome} {row['told']} {row['words']}")
        if row["told"] == RIGHT:
            configs = lives(file, path, chosen.out)
            if failed := sweep(configs, Machine(cores())):
                failures += failed
            else:
                merge(chosen.results, TABLE, [row | errors(configs)])
    say(*failures)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(command(main))
