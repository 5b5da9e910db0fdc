"""Other seeds, frames, cameras and actions than an experiment has by itself."""

import contextlib
import json

import matplotlib.pyplot as plt
import numpy as np
import pytest
from results_at_random import RESULTS

from hmc.errors import InputError
from hmc.experiments import EXPERIMENTS, Cell, Experiment, Plan, find_experiment
from hmc.experiments.__main__ import main
from hmc.experiments.engine.experiment import Report
from hmc.experiments.engine.selection import changed_plan, grid_of, read_settings
from hmc.experiments.engine.style import house_style
from hmc.experiments.engine.sweep import report_on
from hmc.experiments.engine.writing import report_folder

NAMES = ("walk_man", "walk_woman", "box_man", "walker")


def toy_grid(plan):
    return [
        {"recording": f"{name}@12", "layers": n, "frames": 0, "repeat": k}
        for name in NAMES
        for n in (1, 2)
        for k in range(1 if plan.quick else 2)
    ]


TOY = Experiment("toy", "", "", toy_grid, lambda *given: {}, lambda cells, plan: None)


def test_without_changes_it_is_the_experiments_own_grid():
    for name in EXPERIMENTS:
        experiment = find_experiment(name)
        assert grid_of(experiment, Plan(quick=True)) == experiment.grid(Plan(quick=True))


def test_seeds_go_up_and_down():
    for seeds in (1, 2, 5):
        grid = grid_of(TOY, changed_plan(Plan(), seeds))
        assert len(grid) == len(NAMES) * 2 * seeds == len({json.dumps(cell) for cell in grid})
        assert {cell["repeat"] for cell in grid} == set(range(seeds))
    # What the experiment has by itself keeps its names, so that what is computed is found.
    assert all(cell in grid_of(TOY, changed_plan(Plan(), 5)) for cell in TOY.grid(Plan()))


def test_fewer_seeds_of_cells_with_seeds_in_turn_are_cells_of_the_grid():
    """A Latin square of clips and seeds: one seed of each is the square itself, and what more is asked for is beside it."""
    square = [{"recording": f"{name}@12", "repeat": place % 3} for place, name in enumerate(NAMES)]
    latin = Experiment("latin", "", "", lambda plan: [*square, {"recording": "drawn@1"}], lambda *given: {}, lambda cells, plan: None)
    assert grid_of(latin, changed_plan(Plan(), 1)) == latin.grid(Plan())
    twice = grid_of(latin, changed_plan(Plan(), 2))
    assert len(twice) == 2 * len(square) + 1 and all(cell in twice for cell in latin.grid(Plan()))


def test_parameters_are_the_same_for_all_cells_and_equal_cells_are_one():
    grid = grid_of(TOY, changed_plan(Plan(), settings=(None, ("frames", 60), ("layers", 4))))
    assert {(cell["frames"], cell["layers"]) for cell in grid} == {(60, 4)} and len(grid) == len(NAMES) * 2


def test_cells_that_are_stored_under_one_name_are_one():
    given = [{"layers": 1, "gone_s": (2.0, 3.5)}, {"layers": 2, "gone_s": [2.0, 3.5]}, {"layers": 3, "gone_s": np.array([2.0, 3.5])}]
    one = Experiment("one", "", "", lambda plan: given, lambda *given: {}, lambda cells, plan: None)
    assert len(grid_of(one, Plan())) == 3
    assert len(grid_of(one, changed_plan(Plan(), settings=(("layers", 4),)))) == 1


def test_cells_with_some_values_alone_are_a_part_of_the_grid():
    kept = grid_of(TOY, changed_plan(Plan(), kept=(("layers", 2), ("repeat", [0, 1]))))
    assert kept == [cell for cell in TOY.grid(Plan()) if cell["layers"] == 2]
    beside = Experiment(
        "beside", "", "", lambda plan: [{"layers": 1}, {"layers": 2}, {"method": "a"}], lambda *given: {}, lambda *given: None
    )
    assert grid_of(beside, changed_plan(Plan(), kept=(("layers", [2]),))) == [{"layers": 2}, {"method": "a"}]


def test_actions_are_whole_words():
    assert {cell["recording"] for cell in grid_of(TOY, changed_plan(Plan(), actions=("walk",)))} == {"walk_man@12", "walk_woman@12"}
    assert {cell["recording"] for cell in grid_of(TOY, changed_plan(Plan(), actions=("box", "walker")))} == {"box_man@12", "walker@12"}


def test_values_are_toml_or_words():
    assert read_settings(["layers=6", "rate = .5", "a=0.5", "way=strong", 'b="x y"', "gone=[1, 2.5]", "yes=true"]) == (
        ("layers", 6), ("rate", ".5"), ("a", 0.5), ("way", "strong"), ("b", "x y"), ("gone", [1, 2.5]), ("yes", True),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"settings": (("particle", 9),)}, "toy has no parameter 'particle'; its cells have recording, layers"),
        ({"kept": (("particle", 9),)}, "toy has no parameter 'particle'; its cells have recording, layers"),
        ({"kept": (("layers", [1, 3]),)}, "toy has no cell with layers = 3; there are 1, 2"),
        ({"actions": ("jog",)}, "no recording of the action 'jog'; there are walk_man"),
    ],
)
def test_what_an_experiment_does_not_have_is_told(changes, message):
    with pytest.raises(InputError, match=message):
        grid_of(TOY, changed_plan(Plan(), **changes))


def test_experiments_without_seeds_or_recordings_say_so():
    plan = find_experiment("fig-4.4")
    with pytest.raises(InputError, match="leave --seeds out"):
        grid_of(plan, changed_plan(Plan(), 3))
    with pytest.raises(InputError, match="leave --actions out"):
        grid_of(plan, changed_plan(Plan(), actions=("walk",)))


def test_from_the_command_line_and_beside_the_full_report(tmp_path, capsys):
    assert (
        main(["status", "fig-6.18", "--out", str(tmp_path), "--seeds", "2", "--frames", "30", "--actions", "walk", "--set", "density=1.0"])
        == 0
    )
    assert "0 of     4 cells" in capsys.readouterr().out  # one walk, two ways of annealing
    assert main(["status", "fig-6.18", "--out", str(tmp_path), "--set", "density"]) == 2
    assert "write a parameter and its value" in capsys.readouterr().err
    experiment = find_experiment("fig-6.18")
    folders = {report_folder(tmp_path, experiment, plan) for plan in (Plan(), Plan(quick=True), changed_plan(Plan(), 5))}
    assert len(folders) == 3


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::RuntimeWarning")  # means of nothing
@pytest.mark.parametrize("name", EXPERIMENTS)
def test_a_report_on_a_part_of_the_cells_is_there_or_says_in_a_line_why_not(name):
    """With one value alone of each parameter, of results that are drawn at random."""
    experiment, rng = find_experiment(name), np.random.default_rng(0)
    grid = grid_of(experiment, Plan(quick=True))
    draw = RESULTS[experiment.store_name]
    cells = [Cell(parameters, draw(rng, parameters, False)) for parameters in grid]
    for key in dict.fromkeys(key for parameters in grid for key in parameters):
        last = grid[-1].get(key)
        some = [one for one in cells if one.parameters.get(key) == last]
        with house_style(), np.errstate(all="ignore"), contextlib.suppress(InputError):
            assert isinstance(report_on(experiment, some, changed_plan(Plan(quick=True), kept=[(key, last)])), Report)
        plt.close("all")
