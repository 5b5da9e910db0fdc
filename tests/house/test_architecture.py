"""The plan of the house: who may import whom, what a core module may need, and what no file of the package does."""

import ast
import functools
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "hmc"
MODULES = sorted(PACKAGE.rglob("*.py"))

MAX_LINES = 500

# What each part of the package may import of the others. A part is a package or a module directly under hmc/; the rooms of `pose` are parts
# of their own, and so are its modules.
BASE = {"errors", "landmarks"}
CAMERA = BASE | {"camera"}
IO = CAMERA | {"io"}
VOXELS = IO | {"processes", "voxels"}
TRACKING = VOXELS | {"search", "tracking"}
BODY = CAMERA | {"search", "body"}
MOTION = BODY | IO | {"metrics", "motion"}
VIEWS = TRACKING | BODY | {"pose.spectral", "pose.views"}
OBJECTIVES = VIEWS | {"pose.objectives"}
METHOD = OBJECTIVES | {"pose.method"}
STEPS = METHOD | {"pose.steps"}
STARTS = STEPS | {"pose.starts"}
PERSON = STARTS | {"pose.legs", "pose.person"}
BACK = STEPS | {"pose.anew", "pose.back_settings", "pose.part_colors", "pose.turned"}
FINISHED = MOTION | {"view"}
FOLLOWING = PERSON | FINISHED | {"pose.finished", "pose.records", "pose.follow", "pose.keypoint_cues", "pose.keypoint_sides"}
METHODS = STARTS | BACK | {"pose.legs", "pose.recovery", "pose.methods"}
POSE = METHODS | FOLLOWING | {"pose.backward", "pose.clear_views", "pose.keypoint_tracks", "pose.occluders", "pose.registry"}
POSE |= {"pose.contacts", "pose.keypoint_views", "pose.limb_colors", "pose.second_pass", "pose.trust", "pose.trust_model"}
POSE |= {"pose.chain", "pose.head_colors", "pose.turned_back", "pose.turned_by_keypoints", "pose.turned_by_silhouettes"}
METRICS = IO | {"metrics"}
VIEW = VOXELS | {"body", "view"}
EVERYTHING = POSE | METRICS | VIEW | {"motion", "check", "synthetic", "plugins"}
MAY_IMPORT = {
    "errors": set(),
    "landmarks": {"errors"},
    "camera": BASE,
    "io": IO | {"processes"},
    "search": BASE,
    "voxels": VOXELS,
    "tracking": TRACKING | {"plugins"},
    "body": BODY,
    "motion": MOTION,
    "pose.views": VIEWS,
    "pose.spectral": TRACKING | {"pose.spectral"},
    "pose.objectives": OBJECTIVES,
    "pose.method": METHOD,
    "pose.steps": STEPS,
    "pose.legs": STEPS,
    "pose.starts": STARTS,
    "pose.recovery": STARTS | {"pose.turned"},
    "pose.person": PERSON,
    "pose.records": PERSON | {"pose.records"},
    "pose.finished": FINISHED,
    "pose.follow": FOLLOWING,
    "pose.keypoint_cues": OBJECTIVES | {"pose.keypoint_sides"},
    "pose.keypoint_sides": VIEWS,
    "pose.keypoint_tracks": VIEWS,
    "pose.keypoint_views": FOLLOWING | {"pose.trust"},
    "pose.anew": STARTS,
    "pose.turned": STARTS,
    "pose.back_settings": BACK,
    "pose.occluders": VIEWS,
    "pose.part_colors": VIEWS,
    "pose.second_pass": FOLLOWING | BACK | {"pose.contacts", "pose.occluders"},
    "pose.head_colors": VIEWS | {"pose.part_colors", "pose.second_pass"},
    "pose.limb_colors": FOLLOWING | BACK | {"pose.clear_views", "pose.second_pass", "pose.trust"},
    "pose.backward": FOLLOWING
    | BACK
    | {"pose.backward", "pose.contacts", "pose.head_colors", "pose.limb_colors", "pose.occluders", "pose.second_pass"},
    "pose.contacts": BODY | IO,
    "pose.turned_by_keypoints": OBJECTIVES | {"pose.keypoint_cues"},
    "pose.turned_by_silhouettes": VOXELS,
    "pose.turned_back": OBJECTIVES | {"pose.keypoint_cues", "pose.turned_by_keypoints", "pose.turned_by_silhouettes"},
    "pose.chain": FOLLOWING | {"pose.backward", "pose.keypoint_views", "pose.trust", "pose.turned_back"},
    "pose.clear_views": FOLLOWING,
    "pose.trust": FOLLOWING | {"pose.clear_views", "pose.trust_model"},
    "pose.trust_model": set(),
    "pose.methods": METHODS,
    "pose.registry": METHODS | {"pose.registry", "plugins"},
    "pose.__init__": {"callable_package"},
    "metrics": METRICS,
    "check": VOXELS | {"check", "callable_package"},
    "view": VIEW | {"callable_package"},
    "synthetic": IO | BODY | {"synthetic"},
    # a session's file, what is kept of its trials, and its report, which shows poses and bodies over images; runs nothing itself
    "trials": VIEW | {"trials"},
    "plugins": BASE,
    "processes": set(),
    "citations": {"errors", "pose.registry", "tracking"},
    "session": POSE | {"session"},
    "experiments": EVERYTHING,
    "api": EVERYTHING,
    "callable_package": set(),  # finds `api` by its name, once it is called
    "cli": EVERYTHING | {"citations", "experiments", "trials"},
    "__main__": {"cli"},
    "__init__": set(),
}

#: What draws; only this may need what a server lacks.
DRAWING = ("hmc.view.plots", "hmc.view.motion_plots", "hmc.experiments")
UNWANTED = ("matplotlib", "mpl_toolkits", "pandas", "tqdm")

#: What takes long to import and few runs need, and what all of them need but a command that only explains itself.
SLOW = ("sklearn", "scipy.stats", "scipy.signal", *UNWANTED)
NUMBERS = ("scipy", "cv2")

#: Loading what these wrote can run code.
UNSAFE_MODULES = {"pickle", "cPickle", "dill", "cloudpickle", "shelve", "marshal"}


@functools.cache
def parse(path):
    return ast.parse(path.read_text(encoding="utf-8"), str(path))


def trees(but=()):
    """Path and syntax tree of every file of the package, without some parts."""
    return [(path, parse(path)) for path in MODULES if part_of(path) not in but]


def part_of(path):
    """The part of the package that a file belongs to."""
    return part_named(path.relative_to(PACKAGE).with_suffix("").parts)


def part_named(names):
    """The part that a module belongs to, by its names below hmc."""
    return ".".join(names[:2]) if names[0] == "pose" else names[0]


def imported(tree):
    """Full names of the modules that a file imports, wherever in the file; of `from a import b` both a and a.b."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module or ""
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def where(path, node):
    return f"{path.relative_to(PACKAGE.parent)}:{node.lineno}"


def calls(tree, *names):
    """Calls of functions by their last name: print(...), np.load(...)."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            if name in names:
                yield node


def test_plan_has_one_direction():
    TopologicalSorter({part: allowed - {part} for part, allowed in MAY_IMPORT.items()}).prepare()  # raises CycleError


def test_every_part_is_in_the_plan():
    unknown = {part_of(path) for path in MODULES} - set(MAY_IMPORT)
    assert not unknown, f"say in MAY_IMPORT what these may import: {sorted(unknown)}"


def test_imports_follow_the_plan():
    wrong = []
    for path, tree in trees():
        allowed = MAY_IMPORT[part_of(path)] | {part_of(path)}
        for name in imported(tree):
            names = name.split(".")
            # `from hmc import __version__` imports no part
            if names[0] == "hmc" and len(names) > 1 and names[1] != "__version__" and part_named(names[1:]) not in allowed | {"pose"}:
                wrong.append(f"{path.relative_to(PACKAGE.parent)} imports {name}")
    assert not wrong, "\n".join(wrong)


def test_imports_are_absolute():
    relative = [
        where(path, node) for path, tree in trees() for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.level > 0
    ]
    assert not relative


def test_core_needs_nothing_that_draws():
    names = [
        ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts)
        for path in MODULES
        if part_of(path) != "__main__" and path.name != "__init__.py"
    ]
    names = [name for name in names if not name.startswith(DRAWING)]
    program = f"""
import importlib, importlib.abc, sys

class Refuse(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {UNWANTED!r}:
            raise ImportError(f"{{name}} is not here")

sys.meta_path.insert(0, Refuse())
for name in {names!r}:
    importlib.import_module(name)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=PACKAGE.parent)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "program",
    ["from hmc.cli import main; main(['--help'])", "import hmc.cli.pose, hmc.pose.backward, hmc.pose.finished, hmc.tracking.resumable"],
    ids=["help", "run"],
)
def test_what_is_slow_to_import_is_not_before_it_is_used(program):
    slow = SLOW + (NUMBERS if "--help" in program else ())
    program = f"import sys\ntry:\n    {program}\nexcept SystemExit:\n    pass\nprint(*(name for name in {slow!r} if name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=PACKAGE.parent)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "", done.stdout.splitlines()[-1]


def test_links_that_go_round_end_nothing():
    """`Path.resolve` raises RuntimeError where a link leads to itself (Python 3.12 and before); `hmc.io.files.real_path` does not."""
    own = ("hmc/io/shipped.py", "hmc/io/provenance.py")  # where the package itself lies
    wrong = [where(path, node) for path, tree in trees() for node in calls(tree, "resolve")]
    assert not [place for place in wrong if not place.startswith(own)]


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_files_are_short(path):
    assert len(path.read_text(encoding="utf-8").splitlines()) <= MAX_LINES


def test_nothing_that_is_loaded_can_run_code():
    wrong = []
    for path, tree in trees():
        wrong += [f"{path.name} imports {name}" for name in imported(tree) if name.split(".")[0] in UNSAFE_MODULES]
        wrong += [f"{where(path, node)} {ast.unparse(node.func)}" for node in calls(tree, "eval", "exec", "read_pickle")]
        for node in calls(tree, "load"):
            refused = any(
                keyword.arg == "allow_pickle" and isinstance(keyword.value, ast.Constant) and keyword.value.value is False
                for keyword in node.keywords
            )
            if ast.unparse(node.func) in ("np.load", "numpy.load", "joblib.load") and not refused:
                wrong.append(f"{where(path, node)}: {ast.unparse(node.func)} without allow_pickle=False")
    assert not wrong, "\n".join(wrong)


def test_library_neither_prints_nor_asserts():
    printing = [where(path, node) for path, tree in trees(but=("cli",)) for node in calls(tree, "print")]
    asserting = [where(path, node) for path, tree in trees() for node in ast.walk(tree) if isinstance(node, ast.Assert)]
    assert not printing + asserting


def test_no_random_numbers_without_a_seed():
    made = [
        where(path, node)
        for path, tree in trees(but=("cli",))
        for node in calls(tree, "default_rng")
        if not node.args and not node.keywords
    ]
    assert not made, "without a seed, two runs differ"


def test_everything_public_is_described():
    bare = []
    for path, tree in trees():
        if path.read_text(encoding="utf-8").strip() and not ast.get_docstring(tree):
            bare.append(str(path.relative_to(PACKAGE)))
        for node in tree.body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_") and not ast.get_docstring(node):
                bare.append(f"{where(path, node)} {node.name}")
    assert not bare, "\n".join(bare)
