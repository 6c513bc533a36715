"""The import rules of the package: who may import whom, and which file alone may touch which library."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import sgimd_torch

PACKAGE = "sgimd_torch"
ROWS = [  # a module imports only from the rows before its own
    {"spaces", "archives", "ensemble"},
    {"memory", "motor_primitives", "environment", "search", "demonstrations", "regions", "casting", "cma_es"},
    {"competence", "inverse_model", "interest", "teachers", "forward_model", "fishing_rod"},
    {"strategies", "curves", "progress_grid", "alp_gmm", "anchored", "model_diagnostics"},
    {"learner", "model_inverse", "gradient_search"},
    {"session", "evaluation", "algorithms", "board", "plots", "film", "quality_diversity"},
    {"plots_of_movements", "plots_of_results", "plots_of_model"},
    {"__init__"},
]
ROW = {module: row for row, modules in enumerate(ROWS) for module in modules}
LIBRARIES = {  # library: the only modules that may import it
    "numpy": ROW.keys(),
    "scipy": ROW.keys() - {"spaces"},
    "faiss": {"memory"},
    "mujoco": {"casting", "film"},
    "torch": {"ensemble", "forward_model", "anchored", "model_inverse", "gradient_search"},
    "lightning": {"ensemble", "forward_model"},
    "safetensors": {"forward_model"},
    "tensorboard": {"board"},
    "matplotlib": {"plots", "plots_of_movements", "plots_of_results", "plots_of_model"},
    "PIL": {"film"},
    "imageio_ffmpeg": {"film"},
    "cma": {"cma_es"},
    "sklearn": {"alp_gmm"},
    "ribs": {"quality_diversity"},
}
ENVIRONMENTS = {"environment", "casting", "fishing_rod", "film"}
PROTOCOL = (["Environment"], ["execute_many"])  # what works with every environment
LEARNING = {
    *{
        "memory",
        "search",
        "regions",
        "competence",
        "inverse_model",
        "interest",
        "teachers",
        "forward_model",
        "ensemble",
    },
    *{"strategies", "learner", "progress_grid", "alp_gmm", "cma_es", "anchored", "model_inverse", "gradient_search"},
}


def imports(source: str):
    """Dotted names of what a module imports, names taken from a module included, wherever the import stands."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            home = ".".join(filter(None, [PACKAGE if node.level else "", node.module]))
            yield from (f"{home}.{alias.name}" for alias in node.names)


def breach(module: str, name: str) -> str | None:
    """What is wrong with a module importing a dotted name, or None."""
    top, *rest = name.split(".")
    if top != PACKAGE:
        allowed = top in sys.stdlib_module_names or module in LIBRARIES.get(top, ())
        return None if allowed else f"{module} imports {name}, which belongs to {sorted(LIBRARIES.get(top, ()))}"
    target = rest[0] if rest and rest[0] in ROW else "__init__"
    if ROW[target] >= ROW[module]:
        return f"{module} (row {ROW[module]}) imports {name} (row {ROW[target]})"
    if (module in LEARNING and target in ENVIRONMENTS) or (module in ENVIRONMENTS and target in LEARNING):
        return f"{module} imports {name}: learning and environments meet in spaces only"
    if target in ENVIRONMENTS and module not in ENVIRONMENTS | {"__init__"} and rest[1:] not in PROTOCOL:
        return f"{module} imports {name}: of an environment only the protocol may be known here"
    return None


def breaches(package: Path) -> list[str]:
    found = []
    for path in sorted(package.rglob("*.py")):
        if path.stem not in ROW or path.parent != package:
            found.append(f"{path.relative_to(package)} has no row yet: give it one in {Path(__file__).name}")
            continue
        found += filter(None, (breach(path.stem, name) for name in imports(path.read_text(encoding="utf-8"))))
    return found


def test_every_module_keeps_to_its_row_and_its_libraries():
    assert breaches(Path(sgimd_torch.__path__[0])) == []


@pytest.mark.parametrize(
    ("module", "statement"),
    [
        ("spaces", "from sgimd_torch.memory import Memory"),  # upwards
        ("interest", "from .competence import Competence"),  # sideways
        ("memory", "from . import learner"),
        ("learner", "from sgimd_torch import Memory"),  # through the front door
        ("strategies", "def late():\n    import sgimd_torch.session"),  # hidden in a function
        ("strategies", "from sgimd_torch.environment import Environment"),
        ("fishing_rod", "from sgimd_torch.memory import Memory"),
        ("session", "from sgimd_torch.fishing_rod import FishingRod"),
        ("session", "from sgimd_torch.environment import PlanarArm"),
        ("inverse_model", "import faiss"),
        ("spaces", "import scipy.optimize"),
        ("board", "from torch.utils.tensorboard import SummaryWriter"),
        ("learner", "import tqdm"),  # not a dependency of the package
        ("session", "from experiments import config"),
        ("utils", "import math"),  # not in the table
    ],
)
def test_a_forbidden_import_is_reported(tmp_path, module, statement):
    (tmp_path / f"{module}.py").write_text(statement)
    assert len(breaches(tmp_path)) == 1


@pytest.mark.parametrize(
    ("module", "statement"),
    [
        ("learner", "import math, numpy as np\nfrom sgimd_torch.spaces import Move"),
        ("session", "from sgimd_torch.environment import Environment"),
        ("evaluation", "from sgimd_torch.environment import Environment, execute_many"),
        ("casting", "import mujoco\nfrom .spaces import Array"),
        ("fishing_rod", "from .motor_primitives import GaussianPrimitive"),
        ("__init__", "from sgimd_torch.fishing_rod import FishingRod"),
    ],
)
def test_an_allowed_import_is_not_reported(tmp_path, module, statement):
    (tmp_path / f"{module}.py").write_text(statement)
    assert breaches(tmp_path) == []


def test_importing_the_package_loads_no_heavy_library():
    program = "import sgimd_torch, sys; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.split()
    assert "sgimd_torch" in loaded
    heavy = {"torch", "lightning", "pytorch_lightning", "matplotlib", "tensorboard", "sklearn", "cma", "ribs"}
    assert not heavy & set(loaded)
