"""Scalable body models: the relations that are checked, the shipped models, a user's own from a file."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmc.body.joints import DOF_NAMES, N_CANTON, N_DOF
from hmc.body.model import PARTS
from hmc.body.scalable_models import MODEL_1, MODEL_2, UNITIVE, UNITIVE_PIECES, Inclusive, Model, Union, Unitive
from hmc.errors import InputError
from hmc.pose.methods.model_file import read_hierarchy
from hmc.pose.methods.scalable import method_preset
from hmc.pose.steps.presets import PRESETS

TRUNK = Model("trunk", ("root_tx", "root_rz"), ("torso",))
ARM = Model("arm", ("r_elbow_z",), ("r_forearm",))
LEG = Model("leg", ("r_knee_y",), ("r_shank",))


def test_the_shipped_inclusive_models_have_the_thesis_s_dimensions():
    for model in (MODEL_1, MODEL_2):
        # 6 and 16 as in Eq. 7.18; the last is the whole body, the thesis's waist and our trunk included.
        assert model.added.tolist() == [6, 10, 11 + N_DOF - N_CANTON]
        assert set(model.models[-1].angles) == set(DOF_NAMES) and set(model.models[-1].parts) == set(PARTS)
    assert MODEL_1.models[1].angles == MODEL_2.models[1].angles
    assert set(MODEL_2.models[1].parts) < set(MODEL_1.models[1].parts)


def test_an_angle_or_part_that_breaks_inclusion_is_named():
    small = Model("small", ("root_tx", "root_ty"), ("torso", "head"))
    with pytest.raises(InputError, match=r"'large' lacks the angle 'root_ty' of 'small'"):
        Inclusive("mine", (small, Model("large", ("root_tx", "root_rz", "neck_x"), ("torso", "head"))))
    with pytest.raises(InputError, match=r"'large' lacks the part 'head' of 'small'"):
        Inclusive("mine", (small, Model("large", ("root_tx", "root_ty", "neck_x"), ("torso",))))
    with pytest.raises(InputError, match="`thinning` must be a whole number of at least 1"):
        Inclusive("mine", (small,), thinning=0)
    with pytest.raises(InputError, match="adds no angle"):
        Inclusive("mine", (small, replace(small, name="same")))


def test_unknown_and_repeated_names_are_refused():
    with pytest.raises(InputError, match="no angle named 'r_elbow_y'; did you mean 'r_elbow_z'"):
        Model("arm", ("r_elbow_y",), ("r_forearm",))
    with pytest.raises(InputError, match="no part named 'forearm'"):
        Model("arm", ("r_elbow_z",), ("forearm",))
    with pytest.raises(InputError, match="'r_elbow_z' stands there twice"):
        Model("arm", ("r_elbow_z", "r_elbow_z"), ("r_forearm",))


def test_a_union_that_is_none_is_refused_and_what_breaks_it_named():
    def body(angles, parts):
        return Unitive("mine", (TRUNK, ARM, LEG), (Union(Model("body", angles, parts), ("trunk", "arm", "leg")),))

    angles, parts = (*TRUNK.angles, *ARM.angles, *LEG.angles), ("torso", "r_forearm", "r_shank")
    assert body(angles, parts).limbs == (ARM, LEG)
    with pytest.raises(InputError, match="lacks the angle 'r_knee_y'"):
        body(angles[:-1], parts)
    with pytest.raises(InputError, match="has the part 'head' of none of them"):
        body(angles, (*parts, "head"))
    with pytest.raises(InputError, match="both have 'r_elbow_z'"):
        Unitive("mine", (TRUNK, ARM, replace(LEG, angles=("r_elbow_z",))), ())
    with pytest.raises(InputError, match="the last union must be the whole body; it lacks 'leg'"):
        Unitive("mine", (TRUNK, ARM, LEG), (Union(Model("half", angles[:-1], parts[:-1]), ("trunk", "arm")),))


@pytest.mark.parametrize("tree", [UNITIVE, UNITIVE_PIECES])
@given(st.data())
def test_the_largest_possible_model_is_the_union_of_all_possible_ones_in_it(tree, data):
    active = np.array(data.draw(st.lists(st.booleans(), min_size=len(tree.limbs), max_size=len(tree.limbs))))
    names = [limb.name for limb in tree.limbs]
    allowed = np.zeros(len(active), bool)
    for chosen in product((False, True), repeat=len(active)):
        chosen = np.array(chosen)
        if np.all(chosen <= active) and all(not chosen[names.index(a)] or chosen[names.index(b)] for a, b in tree.needs):
            allowed |= chosen
    np.testing.assert_array_equal(tree.possible(active), allowed)
    assert set(tree.model(allowed).parts) == {"torso", "head"} | {
        p for limb, on in zip(tree.limbs, allowed, strict=True) if on for p in limb.parts
    }


def text_of(models, kind, extra=""):
    lines = [f'kind = "{kind}"', extra]
    for key, one in models:
        lines += [f"[[{key}]]", f'name = "{one.name}"', f"angles = {list(one.angles)}", f"parts = {list(one.parts)}"]
    return "\n".join(lines).replace("'", '"')


def test_models_come_back_from_a_file(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(text_of([("model", one) for one in MODEL_2.models], "inclusive", 'name = "2"\nthinning = 2'))
    assert read_hierarchy(path) == MODEL_2
    path.write_text(
        text_of([("leaf", leaf) for leaf in UNITIVE.leaves], "unitive", f'name = "figure 7.11"\nneeds = {[list(n) for n in UNITIVE.needs]}')
        + "".join(f'\n[[union]]\nname = "{u.model.name}"\nof = {list(u.of)}\n'.replace("'", '"') for u in UNITIVE.unions)
    )
    assert read_hierarchy(path) == UNITIVE
    assert method_preset(PRESETS["default"], "ddm-apf", [str(path)]).limbs.tree == UNITIVE


def test_a_joint_stands_for_its_angles(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('kind = "inclusive"\n[[model]]\nname = "trunk"\nangles = ["root", "neck"]\nparts = ["torso"]\n')
    assert read_hierarchy(path).models[0].angles == DOF_NAMES[:6] + ("neck_x", "neck_y")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("kind = 3", "`kind` must be"),
        ("kind = [", "not a TOML file"),
        ('kind = "inclusive"\nmodels = 1', "unknown key `models`; did you mean `model`"),
        ('kind = "inclusive"', "has no models"),
        ('kind = "inclusive"\n[[model]]\nname = "a"\nangles = "root"\nparts = ["torso"]', "`angles` must be a list of names"),
        ('kind = "inclusive"\nheld = "never"\n[[model]]\nname = "a"\nangles = ["root"]\nparts = ["torso"]', "`held` must be"),
    ],
)
def test_bad_files_end_with_a_line_that_names_them(tmp_path, text, says):
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=says) as caught:
        read_hierarchy(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_models_that_a_method_cannot_use_are_refused(tmp_path):
    default = PRESETS["default"]
    assert method_preset(default, "shbm-apf").models == (MODEL_1,)
    assert method_preset(default, "shbm-apf", ["auto"]).models == (MODEL_1, MODEL_2)
    with pytest.raises(InputError, match="method ddm-apf has no use for an inclusive model"):
        method_preset(default, "ddm-apf", ["1"])
    with pytest.raises(InputError, match="give one"):
        method_preset(default, "shbm-apf", ["1", "2"])
    with pytest.raises(InputError, match="there is no such file"):
        method_preset(default, "shbm-apf", [str(tmp_path / "none.toml")])
