"""Person or not: features of blobs, classifiers, the tree as plain numbers, and what the life cycle of tracks makes of them."""

from dataclasses import asdict, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.metrics import precision_recall_fscore_support
from sklearn.tree import DecisionTreeClassifier

from hmc.camera.model import project
from hmc.errors import InputError
from hmc.experiments import person_data
from hmc.experiments.person_data import render_brought_in, training_recipes
from hmc.io.files import to_toml
from hmc.io.recording import background_frames, iterate_frames, open_recording
from hmc.io.results import TrackTable, write_tracks
from hmc.synthetic.recipe import FurnitureRecipe, load_recipe, shipped_recipes
from hmc.tracking import train_person_tree
from hmc.tracking.blobs import blob_features, observe
from hmc.tracking.classifiers import CLASSIFIERS, detection_scores, fit_classifier, fit_tree, frame_groups, plain_tree
from hmc.tracking.feature_table import FeatureTable, feature_table, join_tables
from hmc.tracking.features import FEATURES, assign_components, feature_matrix
from hmc.tracking.likeness import looks_like_person
from hmc.tracking.person_tree import PersonTree, default_tree, person_share, predict_person, read_tree, write_tree
from hmc.tracking.rules.death import TrackVerdict, judge_track
from hmc.tracking.settings import LifecycleSettings
from hmc.tracking.state import Track
from hmc.voxels.grid import VoxelGrid

ROOM = np.array([[-3.0, -3.0, 0.0], [3.0, 3.0, 2.5]])
#: Top over 1 m and weight over 30 kg.
SMALL_TREE = PersonTree((2, -1, 0, -1, -1), (1.0, 0.0, 30.0, 0.0, 0.0), (1, -1, 3, -1, -1), (2, -1, 4, -1, -1), (0.4, 0.0, 0.8, 0.1, 1.0))


def people_and_things(rng, n=300):
    """Features of made-up people and smaller things, and which are which."""
    is_person = rng.random(n) < 0.4
    mean = np.where(is_person[:, None], [80, 0.9, 1.7, 1.6, 0.8, 0.5], [20, 0.5, 0.8, 0.6, 0.6, 0.3])
    return np.abs(mean * rng.normal(1, 0.15, (n, len(FEATURES)))), is_person


def box_room(*boxes, size=0.1):
    """Voxels of a room of 6 x 6 x 2.5 m filled with boxes, each ((x0, y0, z0), (x1, y1, z1)) in metres."""
    grid = VoxelGrid(ROOM[0], size, tuple(np.round(np.ptp(ROOM, axis=0) / size).astype(int)))
    occupied = np.zeros(grid.shape, bool)
    for low, high in boxes:
        first, last = (np.round((np.array(corner) - ROOM[0]) / size).astype(int) for corner in (low, high))
        occupied[tuple(map(slice, first, last))] = True
    return observe(grid, occupied)


def test_features_are_those_of_table_4_1():
    observation = box_room(((0, 0, 0), (0.4, 0.6, 1.7)))
    assert feature_matrix(observation.blobs)[0] == pytest.approx([0.4 * 0.6 * 1.7 * 1100, 0.85, 1.7, 1.7, 0.6, 0.4])
    assert feature_matrix(blob_features(np.zeros((0, 3)), np.zeros(0, int), 0, 0.1)).shape == (0, len(FEATURES))


def test_positions_get_the_component_that_fills_most_of_their_region():
    observation = box_room(
        ((-0.2, -0.2, 0), (0.2, 0.2, 1.8)),
        ((0.3, -0.3, 0), (0.5, 0.3, 0.5)),
        ((1.6, 1.6, 0), (2.4, 2.0, 1.7)),
        ((-2, -2, 0.2), (-1.9, -1.9, 0.3)),
    )
    positions = np.array([[0.1, 0, 0.9], [1.8, 1.8, 0.85], [2.2, 1.8, 0.85], [-1.9, -1.9, 0.8], [-2, 2, 0.9]])
    assigned = assign_components(observation, positions)
    for k, position in enumerate(positions):
        inside = np.array([((point - position) ** 2 / np.array([0.3, 0.3, position[2]]) ** 2).sum() <= 1 for point in observation.points])
        counts = [np.count_nonzero(inside & (observation.labels == b)) for b in range(len(observation.blobs))]
        enough = max(counts) * 0.1**3 >= 0.02 * 4 / 3 * np.pi * 0.3 * 0.3 * position[2]
        assert assigned[k] == (np.argmax(counts) if enough else -1)
    assert assigned[1] == assigned[2] and list(assigned[3:]) == [-1, -1]
    assert assign_components(observation, positions, least_fill=0.0)[3] >= 0


@given(st.integers(0, 2**32 - 1), st.integers(1, 8))
@settings(max_examples=25, deadline=None)
def test_a_plain_tree_says_what_scikit_learn_says(seed, depth):
    rng = np.random.default_rng(seed)
    features = rng.normal(size=(120, len(FEATURES))).round(1)
    is_person = rng.random(120) < 0.5
    grown = DecisionTreeClassifier(criterion="entropy", max_depth=depth, random_state=0).fit(features, is_person)
    tree = plain_tree(grown.tree_)
    asked = np.concatenate([features, rng.normal(size=(200, len(FEATURES)))])
    assert np.array_equal(predict_person(tree, asked), grown.predict(asked))
    assert person_share(tree, asked) == pytest.approx(grown.predict_proba(asked)[:, 1])
    assert len(predict_person(tree, np.zeros((0, len(FEATURES))))) == 0


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_a_tree_comes_back_from_its_file(tmp_path_factory, seed):
    rng = np.random.default_rng(seed)
    grown = DecisionTreeClassifier(random_state=0).fit(rng.normal(size=(50, len(FEATURES))), rng.random(50) < 0.5)
    path = tmp_path_factory.mktemp("tree") / "tree.csv"
    write_tree(path, plain_tree(grown.tree_), ("made up", "of two\nlines"))
    assert read_tree(path) == plain_tree(grown.tree_)
    assert path.read_text().startswith("# made up\n# of two lines\nnode,feature,threshold,")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text.replace("top_m", "tip_m"), "line 3: unknown feature 'tip_m'"),
        (lambda text: text.replace("1.0,1,2", "high,1,2"), "line 3: could not convert"),
        (lambda text: text.replace("1.0,1,2", "nan,1,2"), "node 0: the threshold"),
        (lambda text: text.replace("1.0,1,2", "1.0,0,2"), "node 0: its two next nodes"),
        (lambda text: text.replace("1.0,1,2", "1.0,1,9"), "node 0: its two next nodes"),
        (lambda text: text.replace("1.0,1,2", "1.0,1"), "line 3: 5 values where"),
        (lambda text: text.replace("30.0,3,4", "30.0,1,4"), "node 2: its two next nodes"),
        (lambda text: text + "5,,,,,0.5\n", "node 5 cannot be reached"),
        (lambda text: text + "7,,,,,0.5\n", "line 8: node 7 where node 5"),
        (lambda text: text.replace("0.4\n", "4\n"), "share of people"),
        (lambda text: "\n".join(text.splitlines()[:2]), "one node at least"),
        (lambda text: "frame,person\n", "holds no person tree"),
        (lambda text: "", "holds no person tree"),
    ],
)
def test_a_broken_tree_is_named(tmp_path, change, words):
    path = tmp_path / "tree.csv"
    write_tree(path, SMALL_TREE, ("a note",))
    path.write_text(change(path.read_text()))
    with pytest.raises(InputError, match=words) as error:
        LifecycleSettings(person=str(path))
    assert str(path) in str(error.value)


def test_a_tree_that_is_not_there_or_is_no_text(tmp_path):
    with pytest.raises(InputError, match="no such file; train a tree"):
        LifecycleSettings(person=str(tmp_path / "none.csv"))
    (tmp_path / "bytes").write_bytes(b"\xff\xfe\x00")
    for path in (tmp_path / "bytes", tmp_path):
        with pytest.raises(InputError, match=r"not text in UTF-8|cannot be read"):
            read_tree(path)


def test_the_shipped_tree_knows_people_from_things():
    tree = default_tree()
    #            weight, centroid, top, height, sides
    standing, seated = [85, 0.95, 1.75, 1.75, 0.7, 0.5], [80, 0.65, 1.3, 1.3, 0.8, 0.6]
    speck, chair, table_top = [0.3, 0.5, 0.55, 0.05, 0.05, 0.05], [25, 0.4, 0.85, 0.85, 0.5, 0.45], [40, 0.7, 0.75, 0.1, 1.4, 0.7]
    assert list(predict_person(tree, np.array([standing, seated, speck, chair, table_top]))) == [True, True, False, False, False]


@pytest.mark.parametrize("name", CLASSIFIERS)
def test_every_classifier_learns_what_is_easy(name):
    rng = np.random.default_rng(1)
    features, is_person = people_and_things(rng)
    verdict = fit_classifier(name, features, is_person, np.arange(len(features)) // 20, rng)
    unseen, truth = people_and_things(rng)
    assert detection_scores(truth, verdict(unseen)).f_measure > 0.9
    assert verdict(unseen[:0]).shape == (0,)


def test_classifiers_refuse_what_cannot_be_learnt():
    rng = np.random.default_rng(2)
    features, is_person = people_and_things(rng)
    groups = np.arange(len(features)) // 20
    with pytest.raises(InputError, match="unknown classifier 'oracle'"):
        fit_classifier("oracle", features, is_person, groups, rng)
    with pytest.raises(InputError, match="0 components are people"):
        fit_classifier("k-means", features, np.zeros(len(features), bool), groups, rng)
    with pytest.raises(InputError, match="two groups"):
        fit_tree(features, is_person, np.zeros(len(features), int), rng)
    with pytest.raises(InputError, match="finite"):
        fit_tree(np.full_like(features, np.nan), is_person, groups, rng)


def test_pruning_leaves_what_holds_on_other_data():
    rng = np.random.default_rng(3)
    features, is_person = people_and_things(rng, 600)
    is_person = is_person ^ (rng.random(600) < 0.1)  # every tenth label is wrong
    grown = DecisionTreeClassifier(criterion="entropy", random_state=0).fit(features, is_person)
    tree = fit_tree(features, is_person, np.arange(600) // 60, rng)
    assert len(tree) < grown.tree_.node_count / 5
    unseen, truth = people_and_things(rng, 2000)
    assert detection_scores(truth, predict_person(tree, unseen)).f_measure > detection_scores(truth, grown.predict(unseen)).f_measure


@given(st.lists(st.tuples(st.booleans(), st.booleans()), min_size=1))
def test_scores_against_scikit_learn(pairs):
    truth, predicted = np.array(pairs).T
    ours = detection_scores(truth, predicted)
    theirs = precision_recall_fscore_support(truth, predicted, average="binary", zero_division=np.nan)
    assert [ours.precision, ours.recall, ours.f_measure] == pytest.approx(theirs[:3], nan_ok=True)


def test_groups_keep_neighbouring_frames_together():
    frames, recordings = np.tile(np.arange(100), 2), np.repeat([0, 1], 100)
    groups = frame_groups(frames, recordings, 25)
    assert len(np.unique(groups)) == 8
    assert all(len(np.unique(groups[(frames // 25 == f) & (recordings == r)])) == 1 for f in range(4) for r in range(2))
    many = np.repeat(np.arange(5), 40)
    assert np.array_equal(frame_groups(np.arange(200), many), many)


def test_tables_are_joined():
    one = FeatureTable(np.arange(2), np.ones((2, 6)), np.array([0, 2]), np.array([0, 1]), 3, 1)
    both = join_tables([one, one])
    assert list(both.recordings) == [0, 1, 2, 3] and both.positions == 6 and both.unassigned == 2
    assert list(both.is_person) == [False, True, False, True] and len(both) == 4
    with pytest.raises(InputError, match="at least"):
        join_tables([])


def test_settings_with_a_tree_decide_by_it_and_say_so():
    person, chair, cabinet, column = (
        ((0, 0, 0), (0.4, 0.4, 1.7)),
        ((1, 1, 0), (1.6, 1.6, 0.8)),
        ((-2, -2, 0), (-1, -1.2, 1.0)),
        ((2, -2, 0), (2.1, -1.9, 2)),
    )
    blobs = box_room(person, chair, cabinet, column).blobs
    by_tree, by_rules = LifecycleSettings(person="tree"), LifecycleSettings(person="rules")
    assert by_rules.tree is None and by_tree.tree == default_tree()
    named = {round(x, 1): k for k, x in enumerate(blobs.lowest[:, 0])}
    order = [named[x] for x in (0.0, 1.0, -2.0, 2.0)]
    assert list(looks_like_person(blobs, by_rules)[order]) == [True, False, False, False]
    assert list(looks_like_person(blobs, replace(by_rules, most_volume_m3=1.0))[order]) == [True, False, True, False]
    assert list(looks_like_person(blobs, replace(by_tree, most_volume_m3=1.0))[order]) == [True, False, False, False]
    assert "[tree]" in to_toml(asdict(by_tree)) and "[tree]" not in to_toml(asdict(by_rules))
    assert replace(by_tree, person="rules").tree is None


@pytest.mark.parametrize(
    ("bad", "good"),
    [(TrackVerdict(efficiency=0.01), TrackVerdict(efficiency=0.5)), (TrackVerdict(like_person=False), TrackVerdict(like_person=True))],
)
def test_tracks_that_do_badly_for_long_die(bad, good):
    limits = LifecycleSettings(unlike_s=1.0, efficiency_s=1.0)
    track = Track(0, np.array([0, 0, 0.9]), np.zeros(3), np.zeros(3), 0.08, 0, 10)
    assert judge_track(track, good, [], 10.0, limits) is not None
    for _ in range(10):
        track = judge_track(track, bad, [], 10.0, limits)
    assert judge_track(track, TrackVerdict(), [], 10.0, limits) is not None  # not judged in this frame
    assert judge_track(judge_track(track, good, [], 10.0, limits), bad, [], 10.0, limits) is not None
    assert judge_track(track, bad, [], 10.0, limits) is None


def test_the_younger_of_two_tracks_in_one_place_ends():
    limits = LifecycleSettings(same_place_s=0.5)
    older, younger = (Track(k, np.array([0.1 * k, 0, 0.9]), np.zeros(3), np.zeros(3), 0.08, 0, 10) for k in range(2))
    for _ in range(5):
        younger = judge_track(younger, TrackVerdict(like_person=True), [older], 10.0, limits)
    assert judge_track(younger, TrackVerdict(like_person=True), [], 10.0, limits).crowded == 0  # apart again
    assert judge_track(younger, TrackVerdict(like_person=True), [older], 10.0, limits) is None


def test_table_of_a_recording(recording_folder):
    with pytest.raises(InputError, match=r"centroids\.csv: there is no such file"):
        feature_table(open_recording(recording_folder))
    truth = TrackTable(np.arange(12), np.zeros(12, int), np.tile([0.0, 0.0, 0.9], (12, 1)), np.zeros((12, 3)))
    write_tracks(recording_folder / "truth" / "centroids.csv", truth)
    recording = open_recording(recording_folder)
    with pytest.raises(InputError, match="`every`"):
        feature_table(recording, every=0)
    with pytest.raises(InputError, match="`hulls`"):
        feature_table(recording, hulls=("loose",))
    table = feature_table(recording, 0.15, on_problem=lambda line: None)
    assert table.features.shape == (len(table), len(FEATURES)) and table.unassigned <= table.positions <= 12


def test_training_from_the_command_line(tmp_path, recording_folder, monkeypatch, caplog):
    assert train_person_tree.main([str(tmp_path / "none"), "--out", str(tmp_path / "tree.csv")]) == 2
    rng = np.random.default_rng(4)
    features, is_person = people_and_things(rng)
    made_up = FeatureTable(np.arange(300), features, is_person.astype(int), np.zeros(300, int), 120, 0)
    monkeypatch.setattr(train_person_tree, "feature_table", lambda *_, **__: made_up)
    out = tmp_path / "tree.csv"
    assert train_person_tree.main([str(recording_folder), "--out", str(out)]) == 0
    assert detection_scores(is_person, predict_person(read_tree(out), features)).f_measure > 0.95
    assert "take_1" in out.read_text().splitlines()[0]


def test_what_the_shipped_tree_was_trained_on(tmp_path):
    recipes = training_recipes()
    assert len({recipe.name for recipe, _ in recipes}) == len(recipes) >= 11
    tested = {name for name in shipped_recipes() if not name.startswith("train_")}
    assert not {recipe.name for recipe, _ in recipes} & tested
    box = FurnitureRecipe("box", (0.5, 0.5), size_m=(0.6, 0.6, 0.9), color=(0.1, 0.1, 0.1))
    small = replace(load_recipe("tiny"), furniture=(box,), seconds=0.1, cell_m=0.03, background_frames=3)
    folder = render_brought_in(replace(small, rig=replace(small.rig, size_px=(80, 60))), tmp_path / "brought")
    assert not list(tmp_path.glob(".*"))
    recording = open_recording(folder)
    empty = next(background_frames(recording, 0)).astype(float)
    action = next(iterate_frames(recording)).images[0].astype(float)
    uv, _ = project(recording.rig[0], np.array([0.5, 0.5, 0.85]))
    u, v = np.round(uv).astype(int).ravel()
    assert empty[v, u].mean() - action[v, u].mean() > 30


def test_persons_from_data_needs_a_place(tmp_path):
    (tmp_path / "file").write_text("")
    assert person_data.main([str(tmp_path / "file"), "--workers", "1"]) == 2
