"""Model files that nobody here made: a package with an arm that is right, one that is too weak, one that is refused."""

import pytest

import model_files
from model_files import REFUSED, RIGHT, WARNED, File, main
from sgimd_torch.runs.program import command
from table import read_table

ARM = """<mujoco><option gravity="0 0 0" integrator="implicitfast"/><worldbody><body><joint name="turn" range="-90 90"/>
    <geom type="capsule" fromto="0 0 0 .2 0 0" size=".01"/><site name="tip" pos=".2 0 0"/></body></worldbody>
  <actuator><position joint="turn" kp="{}" kv="1"/></actuator></mujoco>"""


@pytest.fixture
def package(tmp_path, monkeypatch):
    (tmp_path / "toys").mkdir()
    (tmp_path / "toys-1.2.dist-info").mkdir()
    (tmp_path / "toys-1.2.dist-info" / "METADATA").write_text("Name: toys\nVersion: 1.2\n")
    for name, text in (("strong.xml", ARM.format(9)), ("weak.xml", ARM.format(1)), ("broken.xml", "<mujoco>")):
        (tmp_path / "toys" / name).write_text(text)
    files = [File(f"toys/{name}.xml", "site:tip:xy") for name in ("strong", "weak", "broken")]
    for name, value in (("FILES", files), ("MOVEMENTS", 15), ("SEEDS", range(2))):
        monkeypatch.setattr(model_files, name, value)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
def test_each_file_gets_a_row_once_and_one_that_is_right_is_learnt(package, monkeypatch):
    call = [str(package), "--results", "results"]
    assert main(call) == 0
    table = read_table(package / "results", model_files.TABLE).set_index("file")
    assert table.told.to_dict() == {"toys/strong.xml": RIGHT, "toys/weak.xml": WARNED, "toys/broken.xml": REFUSED}
    assert {*table.version} == {"1.2"}
    assert table.words["toys/weak.xml"].startswith("settled, joints miss their commands: turn by ")
    row = table.loc["toys/strong.xml"]
    assert row.ratio == pytest.approx(row.practice / row.random)
    assert row.low < row.ratio < row.high
    monkeypatch.setattr(model_files, "told", None)  # nothing is left to ask
    monkeypatch.setattr(model_files, "lives", None)
    assert main(call) == 0


def test_a_file_that_no_folder_has_is_named(package, capsys):
    assert command(main, [str(package / "toys"), "--results", "results"]) == 2
    assert "no folder has toys/strong.xml; does it lie in site-packages" in capsys.readouterr().err
