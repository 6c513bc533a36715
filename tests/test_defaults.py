"""The numbers that everything runs with unless somebody asks for others: those of the paper, and those of results/.

Whoever changes one changes every run that does not name it. So they stand here a second time, and what was measured
with them (results/, the README) has to be made anew.
"""

import ast
from collections import defaultdict
from pathlib import Path

import sgimd_torch
from sgimd_torch.options.config import RUN, Config

SGIM_D = {
    "environment": "fishing-rod",
    "environment.max_wind": 0.0,
    "environment.noise": 0.032,
    "environment.task_space": 1.0,
    "environment.threads": 1,
    "budget": 15,
    "give_up": -0.5,
    "global_range": (0.05, 0.95),
    "tolerance": None,
    "explore": "anywhere",
    "goals": "interest-map",
    "goals.cuts": 20,
    "goals.g_max": 30,
    "goals.max_aspect": 5.0,
    "goals.near": 0.05,
    "goals.progress": "gained",
    "goals.window": 24,
    "inverse": "process",
    "judge": "memory",
    "search": "nelder-mead",
    "search.complete": False,
    "search.fatol": 0.05,
    "search.noise": 0.05,
    "search.step": 0.1,
    "search.xatol": 0.1,
    "social": "imitate",
    "social.epsilon": 0.05,
    "social.repeats": 10,
    "teacher": "periodic",
    "teacher.choose": "least-explored",
    "teacher.choose.tiles": 10,
    "teacher.every": 30,
}
PRACTICE = {
    "budget": 1,
    "global_range": (0.02, 0.3),
    "explore": "returning",
    "explore.first": 30,
    "goals": "within-reach",
    "inverse": "among-effects",
    "search": "vary",
    "search.sd": 0.02,
    "social.repeats": 1,
    "teacher": "at-once",
}
ONCE = (
    "budget",
    "give_up",
    "global_range",
    "g_max",
    "max_aspect",
    "task_space",
)


def test_the_defaults_are_those_that_results_were_made_with():
    def values(algorithm):
        return {name: value for name, value in Config(algorithm).values.items() if name not in RUN}

    assert values("sgim-d") == SGIM_D
    left = {name: value for name, value in SGIM_D.items() if name.split(".")[0] not in ("goals", "search", "teacher")}
    assert values("practice-taught") == {**left, **PRACTICE}
    learnt = Config(algorithm="sgim-d", parts={"inverse": "model"})
    model = {"inverse.members": 3, "inverse.noise_heads": True, "inverse.rate": 1.0, "inverse.trust": 0.25}
    assert model.items() <= learnt.values.items()


def test_some_default_values_stand_once_in_the_tree():
    found = defaultdict(list)
    for path in Path(sgimd_torch.__path__[0]).rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.arguments):
                named = [*node.posonlyargs, *node.args][-len(node.defaults) :] if node.defaults else []
                pairs = [*zip(named, node.defaults, strict=True), *zip(node.kwonlyargs, node.kw_defaults, strict=True)]
                for argument, default in pairs:
                    if default is not None:
                        found[argument.arg].append(path.name)
    assert {name: found[name] for name in ONCE if len(found[name]) != 1} == {}
