"""The import rules of the package: which rooms may import a room, and which rooms may import a library.

A room is a folder of the core, a file of the core in no folder, or a folder of ``extras``. The core imports no extra,
not even inside functions; an extra imports the core and the extras that it declares. A new file in a folder, or a new
extra, needs no change here.
"""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import sgimd_torch
from sgimd_torch import rooms

PACKAGE = "sgimd_torch"
ROWS = [  # a room of the core imports only from rows above its own
    {"spaces", "files", "texts", "calls", "rooms"},
    {"memory", "environments"},
    {"parts", "demonstrations"},
    {"competence", "teachers", "evaluation", "goals", "searches"},
    {"inverses"},
    {"strategies"},
    {"learner"},
    {"algorithms", "record", "tasks"},
    {"session"},
    {"options"},
    {"runs"},
    {"forward_model", "board"},
    {"__main__"},
]
ROW = {room: row for row, rooms in enumerate(ROWS) for room in rooms}
EXTRAS = rooms.rooms()
LIBRARIES = {  # rooms or single files that may import a library, by library
    "numpy": {*ROW, "extras"},
    "scipy": {*ROW.keys() - {"spaces"}, "extras"},
    "lazy_loader": {"__init__"},
    "faiss": {"memory/neighbours"},
    "numba": {"memory/compiled", "memory/ordered", "memory/jit", "inverses/kernels"},
    "mujoco": {"environments/rod_physics", "extras/models", "extras/film", "extras/teach"},
    "mujoco_menagerie": {"extras/models/file"},
    "torch": {"forward_model"},
    "lightning": {"forward_model", "extras/logger"},
    "tensorboardX": {"board"},
    "matplotlib": {"extras/pictures", "extras/report", "extras/paper", "extras/film", "extras/demo"},
    "PIL": {"extras/film"},
    "imageio_ffmpeg": {"extras/film"},
    "viser": {"extras/teach"},
    "mink": {"extras/teach"},
    "trimesh": {"extras/teach"},
    "websockets": {"extras/teach"},
    "jinja2": {"extras/report"},
    "docstring_parser": {"options/signature"},
    "tqdm": {"runs/messages", "extras"},
    "distributed": {"extras/sweep"},
    "threadpoolctl": {"inverses/gaussian_process"},
    "cma": {"extras/rivals"},
    "sklearn": {"extras/rivals"},
    "ribs": {"extras/rivals"},
    "pyarrow": {"extras/recordings/lerobot"},
    "lerobot": {"extras/lerobot"},
    "gymnasium": {"extras/gymnasium"},
}
WORLDS = {"environments"}
PROTOCOL = "environments.protocol"  # the part of ``environments`` that other rooms may import
LEARNING = {
    *{"parts", "memory", "competence", "goals", "searches", "inverses", "strategies", "learner", "teachers"},
    "forward_model",
}
FREE = {"runs", "tasks", "__init__"}  # rooms that combine learning and environments


def imports(source: str):
    """Dotted names of all imports in a source text, such as "spaces" and "spaces.Box", also inside functions."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            home = ".".join(filter(None, [PACKAGE if node.level else "", node.module]))
            yield from (f"{home}.{alias.name}" for alias in node.names)


def room_of(place: str) -> str:
    """Room of a file, such as "goals" of "goals/regions", or "extras/film" of "extras/film/reel"."""
    return "/".join(place.split("/")[: 2 if place.startswith("extras/") else 1])


def breach(place: str, name: str) -> str | None:
    """Message if a file at ``place``, such as "goals/regions", may not import a dotted name; None if it may."""
    room, (top, *rest) = room_of(place), name.split(".")
    if top != PACKAGE:
        allowed = LIBRARIES.get(top, ())
        may = any(place == owner or place.startswith(f"{owner}/") for owner in allowed)
        return (
            None if may or top in sys.stdlib_module_names else f"{place} imports {name}, allowed in {sorted(allowed)}"
        )
    target = room_of("/".join(rest)) if rest and rest[0] in {*ROW, "extras"} else "__init__"
    if target == "__init__":
        return None if rest[:1] == ["__version__"] or not rest else f"{place} imports {name} from the package"
    if target.startswith("extras"):
        allowed = {room, *(f"extras/{need}" for need in getattr(EXTRAS.get(room.partition("/")[2]), "NEEDS", ()))}
        return None if room.startswith("extras/") and target in allowed else f"{place} imports the room {target}"
    if room.startswith("extras/"):
        return None
    if target != room and ROW[target] >= ROW.get(room, len(ROWS)):
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
        if (
            room not in ROW
            and place != "__init__"
            and room.partition("/")[2] not in EXTRAS
            and room != "extras/__init__"
        ):
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
        for dotted in imports(
            re.sub(r"^if TYPE_CHECKING:.*\n(    .*\n)+", "", path.read_text(encoding="utf-8"), flags=re.M)
        ):
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


def test_the_core_names_no_extra():
    core = [path for path in Path(sgimd_torch.__path__[0]).rglob("*.py") if "extras" not in path.parts]
    naming = re.compile("|".join(rf"extras[./]{room}\\b" for room in EXTRAS))
    assert [path.name for path in core if naming.search(path.read_text(encoding="utf-8"))] == []


def test_every_declared_extra_is_needed():
    folder = Path(sgimd_torch.__path__[0]) / "extras"
    for room, module in EXTRAS.items():
        text = "".join(path.read_text(encoding="utf-8") for path in (folder / room).rglob("*.py"))
        assert [need for need in getattr(module, "NEEDS", ()) if f"{PACKAGE}.extras.{need}" not in text] == [], room


def test_no_files_import_each_other_in_a_circle():
    assert circle(arrows(Path(sgimd_torch.__path__[0]))) == []


def test_a_circle_is_found():
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"b"}}) == ["b", "c"]
    assert circle({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []


def test_no_file_imports_what_windows_lacks():
    lacking = re.compile(r"^\s*(import|from) (fcntl|termios|pwd|grp|resource|pty)\b", re.MULTILINE)
    files = [*Path(sgimd_torch.__file__).parent.rglob("*.py")]
    assert not [path for path in files if lacking.search(path.read_text(encoding="utf-8"))]
    assert lacking.search("x = 1\n    import fcntl\n")


def test_there_are_few_rooms_and_no_folder_is_crowded():
    package = Path(sgimd_torch.__path__[0])
    folders = {path for path in package.iterdir() if path.is_dir() and list(path.glob("*.py"))}
    assert len(folders | {*package.glob("*.py")}) <= 28
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
    ("runs/run", "from sgimd_torch.extras.table.command import main"),
    ("runs/run", "def late():\n    from sgimd_torch.extras.table.command import main"),
    ("extras/table/command", "from sgimd_torch.extras.film.reel import Shot"),  # not declared
    ("utils", "import math"),  # not in the table
]
ALLOWED = [
    ("learner", "import math, numpy as np\nfrom sgimd_torch.spaces import Move"),
    ("goals/interest_map", "from sgimd_torch.goals.regions import Region"),  # in one room
    ("session", "from sgimd_torch.environments.protocol import Environment"),
    ("environments/rod_physics", "import mujoco\nfrom sgimd_torch.spaces import Array"),
    ("tasks/rod", "from sgimd_torch.environments.fishing_rod import FishingRod"),
    ("extras/demo/command", "import numpy\nfrom sgimd_torch.extras.table.results import print_table"),
    ("runs/run", "from sgimd_torch import __version__"),
    ("extras/demo/command", "import matplotlib"),
]


@pytest.mark.parametrize(("place", "statement"), FORBIDDEN + ALLOWED)
def test_forbidden_imports_are_reported_and_allowed_ones_are_not(tmp_path, place, statement):
    path = (tmp_path / place).with_suffix(".py")
    path.parent.mkdir(exist_ok=True, parents=True)
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
