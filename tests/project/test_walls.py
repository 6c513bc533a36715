"""The import rules of the package: which rooms may import a room, and which rooms may import a library.

A room is a folder of the package, or a file in no folder. A new file in a folder needs no change here.
"""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import sgimd_torch

PACKAGE = "sgimd_torch"
ROWS = [  # a room imports only from rows above its own
    {"spaces", "files", "options", "units"},
    {"memory", "environments"},
    {"parts", "demonstrations"},
    {"competence", "teachers", "evaluation", "goals", "searches", "figures"},
    {"inverses", "board"},
    {"strategies"},
    {"learner"},
    {"changes"},
    {"algorithms", "record"},
    {"session", "asking", "rivals"},
    {"runs"},
    {"forward_model", "teach", "views"},
    {"__main__"},
]
ROW = {room: row for row, rooms in enumerate(ROWS) for room in rooms}
UPSTAIRS = dict.fromkeys(("options/build", "options/command_line"), "runs")  # files of another room than their folder
LIBRARIES = {  # rooms or single files that may import a library, by library
    "numpy": ROW.keys(),
    "scipy": ROW.keys() - {"spaces"},
    "lazy_loader": {"__init__"},
    "faiss": {"memory/neighbours"},
    "numba": {"memory/compiled", "memory/scan", "memory/jit", "inverses/kernels"},
    "mujoco": {
        "environments/rod_physics",
        "environments/models",
        "environments/mujoco_robot",
        "views/film",
        "teach",
    },
    "mujoco_menagerie": {"environments/models/file"},
    "torch": {"forward_model"},
    "lightning": {"forward_model"},
    "tensorboardX": {"board"},
    "matplotlib": {"figures", "board/pictures", "views"},
    "PIL": {"views/film"},
    "imageio_ffmpeg": {"views/film"},
    "viser": {"teach"},
    "mink": {"teach"},
    "trimesh": {"teach"},
    "websockets": {"teach"},
    "jinja2": {"views/report"},
    "docstring_parser": {"options/signature"},
    "tqdm": {"runs/signals", "views"},
    "distributed": {"runs/cluster"},
    "threadpoolctl": {"inverses/gaussian_process"},
    "cma": {"rivals"},
    "sklearn": {"rivals"},
    "ribs": {"rivals"},
    "pyarrow": {"demonstrations/lerobot"},
    "lerobot": {"environments/lerobot"},
    "gymnasium": {"environments/from_gymnasium", "environments/to_gymnasium"},
}
WORLDS = {"environments"}
PROTOCOL = "environments.protocol"  # the part of ``environments`` that other rooms may import
LEARNING = {
    *{"parts", "memory", "competence", "goals", "searches", "inverses", "strategies", "learner", "teachers"},
    *{"asking", "changes", "rivals", "forward_model"},
}
FREE = {"runs", "views", "teach", "__init__"}  # rooms that combine learning and environments


def imports(source: str):
    """Dotted names of all imports in a source text, such as "spaces" and "spaces.Box", also inside functions."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            home = ".".join(filter(None, [PACKAGE if node.level else "", node.module]))
            yield from (f"{home}.{alias.name}" for alias in node.names)


def room_of(place: str) -> str:
    """Room of a file, such as "goals" of "goals/regions"."""
    return UPSTAIRS.get(place, place.partition("/")[0])


def breach(place: str, name: str) -> str | None:
    """Message if a file at ``place``, such as "goals/regions", may not import a dotted name; None if it may."""
    room, (top, *rest) = room_of(place), name.split(".")
    if top != PACKAGE:
        allowed = LIBRARIES.get(top, ())
        may = any(place == owner or place.startswith(f"{owner}/") for owner in allowed)
        return (
            None if may or top in sys.stdlib_module_names else f"{place} imports {name}, allowed in {sorted(allowed)}"
        )
    target = room_of("/".join(rest[:2])) if rest and rest[0] in ROW else "__init__"
    if target == "__init__":
        return None if rest[:1] == ["__version__"] or not rest else f"{place} imports {name} from the package"
    if target != room and ROW[target] >= ROW[room]:
        return f"{place} (row {ROW[room]}) imports {name} (row {ROW[target]})"
    if (room in LEARNING and target in WORLDS and not name.startswith(f"{PACKAGE}.{PROTOCOL}")) or (
        room in WORLDS and target in LEARNING
    ):
        return f"{place} imports {name}: learning and environments share only spaces and the protocol"
    if target in WORLDS and room not in WORLDS | FREE and not name.startswith(f"{PACKAGE}.{PROTOCOL}"):
        return f"{place} imports {name}: of environments, only the protocol may be imported here"
    return None


def breaches(package: Path) -> list[str]:
    messages = []
    for path in sorted(package.rglob("*.py")):
        place = path.relative_to(package).with_suffix("").as_posix()
        room = room_of(place)
        if room not in ROW and place != "__init__":
            messages.append(f"{place} has no row yet: give it one in {Path(__file__).name}")
            continue
        messages += filter(None, (breach(place, name) for name in imports(path.read_text(encoding="utf-8"))))
    return messages


def arrows(package: Path) -> dict[str, set[str]]:
    """For each file, by its dotted name, the files of the package that it imports when it is loaded."""
    files = {
        path.relative_to(package.parent).with_suffix("").as_posix().replace("/", "."): path
        for path in package.rglob("*.py")
    }
    names = {name.removesuffix(".__init__"): name for name in files}
    graph = {}
    for name, path in files.items():
        wanted = set()
        for dotted in imports(path.read_text(encoding="utf-8")):
            while dotted and dotted not in names:
                dotted = dotted.rpartition(".")[0]
            wanted |= {names[dotted]} if dotted else set()
        graph[name] = wanted - {name, f"{PACKAGE}.__init__"}
    return graph


def circle(graph: dict[str, set[str]]) -> list[str]:
    """Files that import each other in a circle; [] if there is no circle."""
    done, path = set(), []

    def visit(name):
        if name in path:
            return path[path.index(name) :]
        if name in done:
            return []
        path.append(name)
        for imported in sorted(graph[name]):
            if loop := visit(imported):
                return loop
        path.pop()
        done.add(name)
        return []

    return next(filter(None, map(visit, sorted(graph))), [])


def test_every_file_keeps_to_its_row_and_its_libraries():
    assert breaches(Path(sgimd_torch.__path__[0])) == []


def test_no_files_import_each_other_in_a_circle():
    assert circle(arrows(Path(sgimd_torch.__path__[0]))) == []


def test_a_circle_is_found():
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == ["b", "c"]
    assert circle({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []


def test_there_are_few_rooms_and_no_folder_is_crowded():
    package = Path(sgimd_torch.__path__[0])
    rooms = {path for path in package.iterdir() if path.is_dir() and list(path.glob("*.py"))} | {*package.glob("*.py")}
    assert len(rooms - {package / "__init__.py", package / "__main__.py"}) <= 28
    for folder in [path for path in package.rglob("*") if path.is_dir()] + [package]:
        assert len(list(folder.glob("*.py"))) <= 16, folder


FORBIDDEN = [
    ("spaces", "from sgimd_torch.memory import Memory"),  # in a row below
    ("memory", "from sgimd_torch import learner"),
    ("learner", "from sgimd_torch import Memory"),  # from the package
    ("strategies", "def late():\n    import sgimd_torch.session"),  # inside a function
    ("strategies", "from sgimd_torch.environments.planar_arm import PlanarArm"),
    ("environments/fishing_rod", "from sgimd_torch.memory import Memory"),
    ("session", "from sgimd_torch.environments.fishing_rod import FishingRod"),
    ("inverses/local", "import faiss"),
    ("spaces", "import scipy.optimize"),
    ("board/listener", "from torch.utils.tensorboard import SummaryWriter"),
    ("session", "from experiments import variants"),
    ("runs/run", "from sgimd_torch.views.table import main"),
    ("utils", "import math"),  # not in the table
]
ALLOWED = [
    ("learner", "import math, numpy as np\nfrom sgimd_torch.spaces import Move"),
    ("goals/interest_map", "from sgimd_torch.goals.regions import Region"),  # in one room
    ("session", "from sgimd_torch.environments.protocol import Environment"),
    ("environments/rod_physics", "import mujoco\nfrom sgimd_torch.spaces import Array"),
    ("runs/tasks", "from sgimd_torch.environments.fishing_rod import FishingRod"),
    ("runs/run", "from sgimd_torch import __version__"),
    ("views/demo", "import matplotlib"),
]


@pytest.mark.parametrize(("place", "statement"), FORBIDDEN + ALLOWED)
def test_forbidden_imports_are_reported_and_allowed_ones_are_not(tmp_path, place, statement):
    path = (tmp_path / place).with_suffix(".py")
    path.parent.mkdir(exist_ok=True)
    path.write_text(statement)
    assert len(breaches(tmp_path)) == ((place, statement) in FORBIDDEN)


def loaded_by(program: str) -> set[str]:
    """Names of the modules that are loaded at the end of a program, which it prints in its last line."""
    words = [sys.executable, "-c", f"{program}; import sys; print(*sys.modules)"]
    printed = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    return set(printed.splitlines()[-1].split())


HEAVY = {
    *{"numba", "torch", "lightning", "pytorch_lightning", "matplotlib", "tensorboardX", "sklearn", "cma", "ribs"},
    *{"jinja2", "gymnasium", "viser"},
}


def test_importing_the_package_loads_no_heavy_library():
    loaded = loaded_by("import sgimd_torch; sgimd_torch.sgim_d, sgimd_torch.run")
    assert "sgimd_torch.algorithms" in loaded
    assert not (HEAVY | {"mujoco"}) & loaded


def test_learning_loads_numba_only_when_the_memory_is_searched():
    program = (
        "import sgimd_torch as s; arm = s.PlanarArm(3); learner = s.{}(arm, 0); [*s.run(learner, arm, 0, movements=3)]"
    )
    assert "numba" not in loaded_by(program.format("random_exploration"))
    assert "numba" in loaded_by(program.format("sagg_riac"))


@pytest.mark.parametrize("words", [["--help"], ["run", "--help"], ["--version"]])
def test_help_loads_nothing_that_takes_time(words):
    program = f"import sys; sys.argv[1:] = {words}; from sgimd_torch.__main__ import main; main()"
    assert not (HEAVY | {"mujoco", "numpy", "scipy", "faiss"}) & loaded_by(program)
