"""Values of nested dataclasses from TOML tables: taken where name and kind are right, told where they are not."""

import tomllib

import pytest

from hmc.errors import InputError
from hmc.io.files import to_toml
from hmc.io.nested_settings import SettingsTable, changed, read_settings_table
from hmc.pose.registry import METHODS, pose_method


def apf(values, **more):
    return pose_method("apf", settings=[SettingsTable("my.toml", values)], **more).settings


@pytest.mark.parametrize(("name", "preset"), [(entry.name, preset) for entry in METHODS.values() for preset in entry.presets])
def test_what_run_toml_holds_gives_the_same_settings(name, preset):
    text = to_toml({"preset": pose_method(name, preset).settings})
    again = pose_method(name, preset, settings=[SettingsTable("run.toml", tomllib.loads(text)["preset"], True)])
    assert to_toml({"preset": again.settings}) == text


def test_values_are_taken():
    preset = apf({"annealed": {"layers": 3, "spread": "survival"}, "search": {"draws": 100}, "drift_scale": 1, "sparing": False})
    assert preset.annealed.layers == 3 and preset.annealed.particles == 120 and preset.annealed.spread == "survival"
    assert preset.search.draws == 100 and preset.drift_scale == 1.0 and isinstance(preset.drift_scale, float) and preset.sparing is None
    method = pose_method("smd", settings=[SettingsTable("a", {"house": {"search": False}}), SettingsTable("b", {"house": {"search": {}}})])
    assert method.settings["house"].search is not None
    assert pose_method("keypoints", settings=[SettingsTable("a", {"refine": {"iterations": 2}})]).settings.refine.iterations == 2


def test_what_may_be_none_and_is_not_there_is_none_in_a_complete_table():
    table = tomllib.loads(to_toml({"preset": pose_method("apf").settings}))["preset"]
    del table["search"]
    assert pose_method("apf", settings=[SettingsTable("run.toml", table, True)]).settings.search is None


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"layers": 3}, "no setting `layers`; did you mean `annealed.layers`?"),
        ({"annealed": {"partcles": 4}}, "no setting `annealed.partcles`; did you mean `annealed.particles`?"),
        ({"annealed": {"layers": "x"}}, "`annealed.layers` must be a whole number; got 'x'"),
        ({"annealed": {"layers": True}}, "`annealed.layers` must be a whole number; got True"),
        ({"search": {"draws": 2147483648}}, "`search.draws` must be a whole number of at most 1000000; got 2147483648"),
        ({"annealed": {"layers": 400_000}}, "`layers` must be at least 1 and at most 1000; got 400000"),
        ({"annealed": {"particles": 1_000_000}}, "`particles` must be at least 1 and at most 100000 in every layer; got 1000000"),
        ({"search": {"draws": 1.5}}, "`search.draws` must be a whole number; got 1.5"),
        ({"drift_scale": "big"}, "`drift_scale` must be a number; got 'big'"),
        ({"likelihood": "glob"}, "`likelihood` must be one of 'symmetric', 'factorised', 'global'; got 'glob'"),
        ({"refine": 3}, "`refine` must be a table, [refine]; got 3"),
        ({"annealed": False}, "`annealed` must be a table, [annealed]; got False"),
        ({"name": 3}, "`name` must be a text; got 3"),
        ({"structural": {"by_limb": 1}}, "`structural.by_limb` must be true or false; got 1"),
        ({"hierarchies": [1]}, "`hierarchies` must be as the preset has it: it cannot be given in a file; got [1]"),
        ({"symmetric": {"cap_m": 0.001}}, "`search.far_m` must not exceed `symmetric.cap_m`"),
    ],
)
def test_what_is_wrong_is_said(values, said):
    with pytest.raises(InputError) as caught:
        apf(values)
    assert str(caught.value).startswith("my.toml: ") and said in str(caught.value) and "\n" not in str(caught.value)


def test_all_faults_are_told_at_once():
    with pytest.raises(InputError, match=r"2 faults: .*layers.*; .*draws"):
        apf({"annealed": {"layers": "x"}, "search": {"draws": "y"}})


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_settings_table(tmp_path / "none.toml")
    (tmp_path / "bad.toml").write_text("a = ")
    with pytest.raises(InputError, match="not a TOML file"):
        read_settings_table(tmp_path / "bad.toml")
    for nothing in ("", "# draws = 7\n"):
        (tmp_path / "empty.toml").write_text(nothing)
        with pytest.raises(InputError, match=r"empty\.toml: has no settings in it; leave it out"):
            read_settings_table(tmp_path / "empty.toml")
    (tmp_path / "good.toml").write_text("[search]\ndraws = 7\n")
    assert changed(pose_method("apf").settings, [read_settings_table(tmp_path / "good.toml")]).search.draws == 7


def test_strangers_methods_have_settings_of_their_own(monkeypatch):
    from dataclasses import replace

    monkeypatch.setitem(METHODS, "mine", replace(METHODS["apf"], name="mine"))
    with pytest.raises(InputError, match="method mine is not of the package"):
        pose_method("mine", settings=[SettingsTable("my.toml", {})])
