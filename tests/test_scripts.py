"""The scripts that make the shipped data: requests that make no sense are refused before any work."""

import sys

import pytest

import check_physics
import make_benchmark
import make_demonstrations


@pytest.mark.parametrize(
    ("script", "options"),
    [
        *(
            (make_benchmark, f"--{name} {count}")
            for name in ("movements", "runs", "tiles", "processes")
            for count in (0, -5)
        ),
        (make_benchmark, "--seed -1"),
        (make_benchmark, "--runs 1.5"),
        (make_benchmark, "--out nowhere/benchmark.npz"),
        (make_demonstrations, "--n 0"),
        (make_demonstrations, "--n -3"),
        (make_demonstrations, "--n 11 --candidates 10"),
        (make_demonstrations, "--n 10 --candidates 10"),  # not all of them land inside T
        (make_demonstrations, "--candidates 0"),
        (make_demonstrations, "--seed -1"),
        (make_demonstrations, "--out nowhere/demonstrations.npz"),
        (check_physics, "--movements 9"),
    ],
)
def test_what_makes_no_sense_is_refused_and_nothing_is_written(tmp_path, monkeypatch, capsys, script, options):
    monkeypatch.chdir(tmp_path)
    out = [] if script is check_physics else ["--out", "out.npz"]
    monkeypatch.setattr(sys, "argv", ["script", *out, *options.split()])
    with pytest.raises(SystemExit) as end:
        script.main()
    assert end.value.code == 2
    assert "error: " in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
