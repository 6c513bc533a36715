"""The numbers that everything runs with unless somebody asks for others: those of the paper, and those of results/.

Whoever changes one changes every run that does not name it. So they stand here a second time, and what was measured
with them (results/, the README) has to be made anew.
"""

import ast
import json
from collections import defaultdict
from pathlib import Path

import pytest

import sgimd_torch
from sgimd_torch.options.config import RUN, Config

STORED = json.loads((Path(__file__).parent / "defaults.json").read_text())
ONCE = (
    "budget",
    "give_up",
    "global_range",
    "g_max",
    "max_aspect",
    "task_space",
)


@pytest.mark.parametrize("algorithm", STORED)
def test_the_defaults_are_those_that_results_were_made_with(algorithm):
    config = Config(algorithm)
    hooks = {name for part in config.chosen.values() if part.kind == "hook" for name in part.options}
    settings = {name: value for name, value in config.settings.items() if name not in {*RUN, "watch"} | hooks}
    assert settings == STORED[algorithm]


def test_the_defaults_of_the_forward_model_are_those_that_results_were_made_with():
    learnt = Config(algorithm="sgim-d", parts={"inverse": "model"})
    model = {"inverse.members": 3, "inverse.noise_heads": True, "inverse.rate": 1.0, "inverse.trust": 0.25}
    model |= {"inverse.widths": (64, 64), "inverse.activation": "silu", "inverse.batch": 128}
    model |= {"inverse.lr": 0.01, "inverse.beta": 0.5, "inverse.network": "perceptrons"}
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
