"""Shell completion as the shell does it: bash loads the script and is asked what fits at the end of a line."""

import shutil
import subprocess
import sys

import pytest

from sgimd_torch.__main__ import COMMANDS, _call
from sgimd_torch.catalogue import CATALOGUE
from sgimd_torch.runs.process import command
from sgimd_torch.views.completion import SHELLS, script

# What bash does when Tab is pressed at the end of a line: it calls the function that `complete` names for the command.
PRESS_TAB = """
source "$1"
shift
COMP_WORDS=("$@") COMP_CWORD=$(($# - 1)) COMP_LINE="$*" COMP_POINT=${#COMP_LINE}
for word in $(complete -p sgimd); do
    if [ "$before" = -F ]; then "$word" sgimd "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD - 1]}"; fi
    before=$word
done
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.fixture(scope="module")
def tab(tmp_path_factory):
    """What bash offers after these words; the last one is unfinished, and may be empty."""
    folder = tmp_path_factory.mktemp("completion")
    (folder / "sgimd.bash").write_text(script(COMMANDS, "bash"))
    (folder / "study").mkdir()

    def tab(*words):
        bash = [shutil.which("bash"), "--norc", "-c", PRESS_TAB, "bash", "sgimd.bash", "sgimd", *words]
        # Without a PATH: if completion started any program, Python too, it would fail.
        done = subprocess.run(bash, cwd=folder, env={"PATH": "/nowhere"}, capture_output=True, text=True, check=True)
        assert not done.stderr
        return {word.strip() for word in done.stdout.split("\n") if word.strip()}

    return tab


def test_every_command_is_offered(tab):
    assert tab("") == {*COMMANDS}
    assert tab("te") == {"teach"}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_options(tab, name):
    assert "--help" in tab(name, "--")


@pytest.mark.parametrize("name", ["run", "sweep", "suite", "teach"])
def test_options_of_a_run_and_their_choices_are_offered_wherever_they_can_be_given(tab, name):
    assert tab(name, "--go") == {"--goals"}
    assert tab(name, "--goals", "") == {*CATALOGUE["goals"]}
    assert tab(name, "--algorithm", "sgim-") == {"sgim-d", "sgim-im", "sgim-acts", "sgim-eer"}
    assert tab(name, "--seed", "3", "--board", "t") == {"true"}


def test_options_of_a_command_and_their_choices_are_offered(tab):
    assert tab("sweep", "--engine", "") == {"local", "ray"}
    assert tab("suite", "--tasks", "qu") == {"quick"}
    assert tab("check", "planar-a") == {name for name in CATALOGUE["environment"] if name.startswith("planar-a")}
    assert tab("demonstrations", "") >= {"check", "import"}
    assert "--degrees" in tab("demonstrations", "import", "--")
    assert "fishing-rod" in tab("demonstrations", "check", "--task", "")


def test_folders_of_runs_are_offered(tab):
    assert tab("table", "st") == {"study"}
    assert tab("run", "--out", "st") == {"study"}


@pytest.mark.parametrize("shell", SHELLS)
def test_every_shell_gets_a_script_with_commands_and_choices(capsys, shell):
    assert command(_call, ["--completion", shell]) == 0
    printed = capsys.readouterr().out
    assert all(word in printed for word in (*COMMANDS, "interest-map", "give-up"))


@pytest.mark.parametrize("words", [[], ["ksh"], ["bash", "zsh"]])
def test_another_shell_is_refused_by_name(capsys, words):
    assert command(_call, ["--completion", *words]) == 2
    assert f"got '{' '.join(words)}'" in capsys.readouterr().err


def test_a_command_whose_extra_is_missing_is_completed_by_name(monkeypatch):
    monkeypatch.delitem(sys.modules, "sgimd_torch.views.report.command", raising=False)
    monkeypatch.setitem(sys.modules, "jinja2", None)
    for name in [name for name in sys.modules if name.startswith("sgimd_torch.views.report")]:
        monkeypatch.delitem(sys.modules, name)
    printed = script(COMMANDS, "bash")
    assert "report" in printed
    assert "--baseline" in printed  # of sgimd table
    assert "_shtab_sgimd_report_option_strings=(-h" not in printed
