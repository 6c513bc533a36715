"""A tiny benchmark, a short run on it, and what that run records when nothing disturbs it."""

import os
import signal
import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from hypothesis.internal.conjecture import providers
from hypothesis.internal.constants_ast import Constants

from own import MODULE
from runs import arguments, content_of
from sgimd_torch.evaluation import Benchmark, save_benchmark
from sgimd_torch.runs.command import main
from sgimd_torch.runs.program import command

# Hypothesis draws constants that stand in modules which happen to be loaded; a result shall not depend on other tests.
providers._get_local_constants = Constants
# Nor shall it depend on a clock: other programs may take the processor.
settings.register_profile("any clock", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any clock")
# MuJoCo is imported without OpenGL, as a display may be missing; pictures in space are made in processes of their own.
os.environ.setdefault("MUJOCO_GL", "disable")
# Programs that a shell starts in the background ignore Ctrl-C; tests send it.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def benchmark(tmp_path_factory):
    path = tmp_path_factory.mktemp("benchmark") / "tiny.npz"
    save_benchmark(path, Benchmark("FishingRod", np.array([[0.0, 0.6], [0.3, 0.5], [-0.4, 0.4]]), 0.1))
    return path


@pytest.fixture(scope="session")
def go(benchmark):
    """Run in this process; later options win. Returns the exit code."""

    def go(out, *options):
        return command(main, [*arguments(out, benchmark), *map(str, options)])

    return go


@pytest.fixture(scope="session")
def undisturbed(tmp_path_factory, go):
    """Directory of the uninterrupted run."""
    out = tmp_path_factory.mktemp("undisturbed")
    assert go(out) == 0
    return out / "sgim-d" / "seed-003"


@pytest.fixture(scope="session")
def reference(undisturbed):
    """The content of the uninterrupted run."""
    return content_of(undisturbed)


@pytest.fixture
def module(tmp_path, monkeypatch):
    """Writes a module of a user's own into the working directory, which is ``tmp_path``; forgotten afterwards."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # bytecode of a file written twice a second may be older
    names = []

    def write(name, text):
        (tmp_path / f"{name}.py").write_text(text)
        sys.modules.pop(name, None)
        names.append(name)
        return tmp_path

    yield write
    sys.path[:] = [place for place in sys.path if place != str(tmp_path)]
    for name in names:
        sys.modules.pop(name, None)


@pytest.fixture
def own(module):
    """Environments of a user's own, the module ``sliders``; returns the working directory."""
    return module("sliders", MODULE)


@pytest.fixture
def undrawn(monkeypatch):
    """Figures are made, but saved as files of no bytes; most of the time of a page is spent on drawing."""
    from matplotlib.figure import Figure

    monkeypatch.setattr(Figure, "savefig", lambda *_, **__: None)
