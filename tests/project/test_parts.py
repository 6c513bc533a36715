"""Contracts between parts: one file says what each kind of part gets and can do; no code looks up members by name."""

import ast
import inspect
from pathlib import Path

import pytest

import sgimd_torch
from sgimd_torch import parts
from sgimd_torch.calls import function_of
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.goals.uniform import UniformGoals
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.options.catalogue import WORDS
from sgimd_torch.parts import Goals
from sgimd_torch.searches.simplex import NelderMead
from sgimd_torch.strategies import GoalBabbling
from worlds import part, problem

PACKAGE = Path(sgimd_torch.__path__[0])
KINDS = {
    "goals": parts.Goals,
    "search": parts.Search,
    "explore": parts.Explore,
    "inverse": parts.Inverse,
    "judge": parts.Judge,
    "social": parts.Social,
}
LEARNING = (
    *("parts", "strategies", "algorithms", "learner", "session", "goals", "inverses", "searches", "teachers"),
    *("forward_model", "competence", "evaluation", "runs/build", "runs/run", "extras/asking", "extras/rivals"),
)
BY_NAME = {"getattr", "hasattr", "attrgetter"}
FIELDS = {  # files and definitions that may look up members by name, because they handle all fields of a class; why
    ("goals/regions", "Region"): "hands out its own arrays read-only",
    ("record/replay", "_check_lesson"): "compares two demonstrations field by field",
    ("forward_model/model", "ForwardModel"): "compares its sizes with those of a memory",
    ("forward_model/shared", "SharedModel"): "networks of one's own may say why they are computed one by one",
    ("forward_model/training", "OnlineTrainer"): "calls the hooks of Lightning by name",
}
SIGNATURES = {"signature", "Signature", "getfullargspec", "parameters_of", "__code__", "__defaults__", "__kwdefaults__"}
OPTIONS = {  # files and definitions that may read the parameters of a function; why
    ("options/signature", None): "the signature is the option",
    ("options/config", None): "options of the parts that a run has chosen",
    ("calls", None): "reads them for options, and refuses what a user's own function does not take",
    ("extras/changes/hook", "BeginWith"): "refuses an algorithm that does not learn from another robot",
}


def uses(names: set[str], package: Path) -> set[tuple[str, str | None]]:
    """Pairs (file, definition) that use one of these names; the definition is None for code outside definitions."""
    users = set()
    for path in sorted(package.rglob("*.py")):
        place = path.relative_to(package).with_suffix("").as_posix()
        for top in ast.parse(path.read_text(encoding="utf-8")).body:
            inside = {node.id for node in ast.walk(top) if isinstance(node, ast.Name)}
            inside |= {node.attr for node in ast.walk(top) if isinstance(node, ast.Attribute)}
            if names & inside:
                users.add((place, top.name if isinstance(top, ast.FunctionDef | ast.ClassDef) else None))
    return users


def test_no_part_is_asked_by_name_what_it_can_do():
    users = {(place, name) for place, name in uses(BY_NAME, PACKAGE) if place.startswith(LEARNING)}
    assert users - FIELDS.keys() == set()


def test_no_part_is_given_things_by_the_names_of_its_parameters():
    users = uses(SIGNATURES, PACKAGE)
    assert {(place, name) for place, name in users if not {(place, name), (place, None)} & OPTIONS.keys()} == set()


def test_a_use_by_name_is_found(tmp_path):
    (tmp_path / "searches.py").write_text(
        "import inspect\ndef wired(part):\n    return inspect.signature(part), getattr(part, 'many', None)\n"
        "class Wired:\n    many = hasattr(int, 'many')\n"
    )
    assert uses(BY_NAME, tmp_path) == {("searches", "wired"), ("searches", "Wired")}
    assert uses(SIGNATURES, tmp_path) == {("searches", "wired")}


@pytest.fixture
def given():
    """The problem of a small arm, with an inverse model and goal babbling."""
    made = problem(PlanarArm(3), inverse=NearestNeighbour)
    made.autonomous = GoalBabbling(made, goals=UniformGoals, search=NelderMead)
    return made


@pytest.mark.parametrize(("kind", "word"), [(kind, word) for kind in KINDS for word in WORDS[kind]])
def test_every_part_is_built_from_the_problem_and_keywords_with_defaults(kind, word, given):
    make = part(kind, word)
    first, *others = inspect.signature(function_of(make)).parameters.values()
    assert first.name == "problem"
    assert {parameter.kind for parameter in others} <= {inspect.Parameter.KEYWORD_ONLY}
    assert not [parameter.name for parameter in others if parameter.default is inspect.Parameter.empty]
    assert isinstance(KINDS[kind].of(make, given), KINDS[kind])


def test_an_inverse_model_is_added_by_whoever_has_read_the_base_classes_and_one_example():
    lines = {file: len((PACKAGE / file).read_text().splitlines()) for file in ("parts.py", "inverses/nearest.py")}
    assert {kind.__module__ for kind in (*KINDS.values(), parts.Teacher, parts.Problem)} == {parts.__name__}
    assert lines["parts.py"] <= 285
    assert sum(lines.values()) <= 350


class Halfway(Goals):
    """Goals without a method ``add``."""

    def sample(self, context):
        return context


class Unasked(UniformGoals):
    """Goals whose constructor takes no problem."""

    def __init__(self):
        pass


class Alien:
    """A class that does not derive from Goals."""

    def __init__(self, problem):
        pass


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (Halfway, "Halfway has no add, which every Goals must have"),
        ("uniform", "must be a class or a function, got 'uniform'; import its class, names are for the command line"),
        (UniformGoals(problem()), "must be a class or a function, got a finished UniformGoals"),
        (Unasked, "Goals Unasked cannot be called with the arguments of its kind: too many positional arguments"),
        (NelderMead, "NelderMead must make a Goals, made a NelderMead; derive a class from Goals of sgimd_torch.parts"),
        (Alien, "Alien must make a Goals, made a Alien"),
    ],
)
def test_what_is_no_constructor_of_its_kind_is_refused_when_it_is_built(make, message):
    with pytest.raises(ValueError, match=message):
        GoalBabbling(problem(inverse=NearestNeighbour), goals=make, search=NelderMead)


@pytest.mark.parametrize("kind", [*KINDS.values(), parts.Teacher])
def test_the_base_class_of_each_kind_demands_something(kind, given):
    with pytest.raises(ValueError, match=f"{kind.__name__} has no .*, which every {kind.__name__} must have"):
        kind.of(kind, given)
