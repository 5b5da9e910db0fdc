"""What many cells need and one makes: recordings and what was seen in them, kept beside the cells.

Each is made once. A lock of the operating system's, which dies with its holder, keeps two workers from making the same thing at once, and
what is made appears under its name only when it is whole; so a run may be killed at any time.
"""

from __future__ import annotations

import contextlib
import functools
import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields, is_dataclass
from pathlib import Path

import numpy as np

from hmc.errors import InputError
from hmc.experiments.drill_clips import drill_recipes
from hmc.experiments.engine.experiment import Source
from hmc.experiments.engine.store import digest
from hmc.experiments.five_actions import action_recipes
from hmc.experiments.nine_actions import nine_recipes
from hmc.experiments.person_data import render_brought_in, training_recipes
from hmc.io.door import kept_arrays
from hmc.io.files import real_path
from hmc.io.recording import Recording, open_recording, read_rig
from hmc.io.settings import read_settings
from hmc.synthetic.recipe import Recipe, load_recipe
from hmc.synthetic.render import render_recording
from hmc.voxels.grid import VoxelGrid
from hmc.voxels.hulls import FrontendSettings, HullStep, stream_hulls

try:
    import fcntl
except ImportError:  # no such locks on Windows: two workers may then make the same thing, and the first to finish keeps it
    fcntl = None  # type: ignore[assignment]

__all__ = ["Inputs", "once", "read_hulls", "recipe_of", "rendered", "source_of", "write_hulls"]

#: Files of a recording on which a cell's result depends.
_CONTENT = ("calibration*", "recording.toml", "videos/*", "images/*/*", "silhouettes/*/*", "background/*", "background/*/*", "truth/*.csv")
#: The person tracker's input is computed with one thread: workers share the cores.
_FRONTEND = FrontendSettings(threads=1)
#: Of the levels of a voxel that are kept, 1 to 3 by the hulls that hold it: added where people may be (`HullStep.doubted`).
DOUBTED = 4


def rendered(recipe: str) -> Source:
    """A shipped recipe, or one of those of `person_data` and `five_actions`, as a source; the label changes when the recipe does.

    Raises
    ------
    InputError
        When there is no such recipe.
    """
    content, brought_in = _recipe_of(recipe)
    return Source(f"{recipe}@{digest([_told(content), brought_in], 8)}")


def recipe_of(name: str) -> Recipe:
    """A shipped recipe, or one of those that experiments make of them; `rendered` says what is refused."""
    return _recipe_of(name)[0]


def _told(value: object) -> object:
    """What a recipe tells, without what it leaves at its default: keys that recipes get one day change no label."""
    if is_dataclass(value):
        pairs = ((one, getattr(value, one.name)) for one in fields(value))
        return {one.name: _told(content) for one, content in pairs if repr(content) != repr(_default(one))}
    if isinstance(value, (list, tuple)):
        return [_told(one) for one in value]
    return repr(value)


def _default(one: Field) -> object:
    return one.default if one.default_factory is MISSING else one.default_factory()


def source_of(folder: Path) -> Source:
    """A recording of the user's as a source; the label changes when a file's size or the calibration does, not with the place.

    Raises
    ------
    InputError
        When the folder is no recording.
    """
    open_recording(folder)
    files = sorted({file for pattern in _CONTENT for file in folder.glob(pattern) if file.is_file()})
    sizes = [[str(file.relative_to(folder)), file.stat().st_size] for file in files]
    text = [file.read_text(encoding="utf-8", errors="replace") for file in files if file.parent == folder]
    return Source(f"{real_path(folder).name}@{digest([sizes, text], 8)}", real_path(folder))


def once(path: Path, make: Callable[[Path], object]) -> Path:
    """A file or folder that is made where it is not there yet.

    Parameters
    ----------
    path : Path
    make : callable
        ``make(part)`` makes it at `part`, a sibling of `path`, which is then renamed.

    Returns
    -------
    Path
        `path`.
    """
    if path.exists():
        return path
    path.parent.mkdir(parents=True, exist_ok=True)
    with _locked(path.with_name(f".{path.name}.lock")) as alone:
        if path.exists():
            return path
        if alone:
            for left in path.parent.glob(f".*{path.name}.*.part"):
                _remove(left)
        part = path.with_name(f".{path.name}.{os.getpid()}.part")
        try:
            make(part)
            with contextlib.suppress(FileExistsError if alone else OSError):
                os.replace(part, path)
        finally:
            _remove(part)
    return path


def _rendered_name(label: str) -> str:
    """The recipe's name of a label, which must be of the recipe as it is."""
    name = label.rpartition("@")[0]
    if rendered(name).label != label:
        raise InputError(f"the recording {label} is neither among --recordings nor a shipped recipe as it is now")
    return name


@dataclass(frozen=True)
class Inputs:
    """Shared inputs of cells.

    Attributes
    ----------
    folder : Path
        Where they are kept.
    recordings : mapping of str to Path
        The user's recordings by label.
    """

    folder: Path
    recordings: Mapping[str, Path] = field(default_factory=dict)

    def recording_folder(self, label: str) -> Path:
        """The folder of a recording; one of a shipped recipe is rendered where it is not there.

        Parameters
        ----------
        label : str
            A `Source`'s.

        Raises
        ------
        InputError
            When the label is of a recording that was not given, or of an earlier form of a recipe.
        """
        if label in self.recordings:
            return self.recordings[label]
        recipe, brought_in = _recipe_of(_rendered_name(label))
        render = render_brought_in if brought_in else render_recording
        return once(self.folder / label / "recording", lambda part: render(recipe, part))

    def recording(self, label: str) -> Recording:
        """A recording, opened."""
        return open_recording(self.recording_folder(label))

    def unseen_recording(self, label: str) -> Recording:
        """A recording of which no image is read: of a shipped recipe calibration and truth alone, where it is not there whole."""
        if label in self.recordings or (self.folder / label / "recording").is_dir():
            return self.recording(label)
        recipe = recipe_of(_rendered_name(label))
        folder = once(self.folder / label / "tables", lambda part: render_recording(recipe, part, pictures=False))
        told = read_settings(folder)
        room, heights = np.asarray(told["room"], float), tuple(told["subject_height_m"])
        return Recording(folder, told["name"], float(told["fps"]), read_rig(folder), room, told["frames"], 0, told["persons"], heights)

    def truth(self, label: str) -> Path:
        """The file of true centroids of a recording.

        Raises
        ------
        InputError
            When the recording has none.
        """
        path = self.recording_folder(label) / "truth" / "centroids.csv"
        if not path.is_file():
            raise InputError(f"{path.parent.parent}: has no truth/centroids.csv; this experiment scores tracks against it")
        return path

    def hulls(self, label: str, voxel_size_m: float) -> Iterator[HullStep]:
        """Silhouettes and hulls of a whole recording, in order, without images.

        Parameters
        ----------
        label : str
        voxel_size_m : float

        Yields
        ------
        HullStep
            As from `hmc.voxels.hulls.stream_hulls`, with None for images and doubts.
        """
        recording = self.recording(label)
        grid = VoxelGrid.from_room(recording.room, voxel_size_m, len(recording.rig))
        folder = once(self.folder / label / f"hulls-{1000 * voxel_size_m:g}mm", lambda part: write_hulls(part, _hulls(recording, grid)))
        yield from read_hulls(folder, grid, recording)


def read_hulls(folder: Path, grid: VoxelGrid, recording: Recording, first: int = 0, last: int | None = None) -> Iterator[HullStep]:
    """Silhouettes and hulls as `write_hulls` kept them, in order, from frame `first` to before `last`, with None for images and doubts."""
    sizes = [camera.size for camera in recording.rig]
    for path in sorted(folder.glob("*.npz")):
        if int(path.stem) < first or (last is not None and int(path.stem) >= last):
            continue
        with kept_arrays(path) as data:
            levels = np.zeros(grid.shape, np.uint8)
            levels.ravel()[data["voxels"]] = data["levels"]
            masks = tuple(_unpack(data[f"mask_{c}"], size) if f"mask_{c}" in data else None for c, size in enumerate(sizes))
        nothing = (None,) * len(sizes)
        doubted, levels = levels >= DOUBTED, levels % DOUBTED
        hulls = levels == 3, levels >= 2, levels >= 1
        yield HullStep(int(path.stem), nothing, masks, nothing, *hulls, doubted if doubted.any() else None)


def write_hulls(folder: Path, steps: Iterable[HullStep]) -> None:
    """Keep silhouettes and hulls, one file a frame, in a new folder."""
    folder.mkdir()
    for step in steps:
        levels = step.strict.astype(np.uint8) + step.tolerant + step.loose
        if step.doubted is not None:
            levels[step.doubted] += DOUBTED
        voxels = np.flatnonzero(levels).astype(np.int64 if levels.size > np.iinfo(np.int32).max else np.int32)
        masks = {f"mask_{c}": np.packbits(mask) for c, mask in enumerate(step.masks) if mask is not None}
        np.savez_compressed(folder / f"{step.index:08d}.npz", voxels=voxels, levels=levels.ravel()[voxels], **masks)  # type: ignore[arg-type]


def _recipe_of(name: str) -> tuple[Recipe, bool]:
    """A recipe, and whether its furniture comes in after the empty room was filmed."""
    return _own_recipes().get(name) or (load_recipe(name), False)


@functools.cache
def _own_recipes() -> dict[str, tuple[Recipe, bool]]:
    """The recipes that experiments make of the shipped ones, by name."""
    as_filmed = ((recipe, False) for recipe in (*action_recipes(), *nine_recipes(), *drill_recipes()))
    return {recipe.name: (recipe, brought_in) for recipe, brought_in in reversed([*training_recipes(), *as_filmed])}


def _hulls(recording: Recording, grid: VoxelGrid) -> Iterator[HullStep]:
    return stream_hulls(recording, grid, _FRONTEND, on_problem=lambda line: None)


def _unpack(bits: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    return np.unpackbits(bits, count=size[0] * size[1]).astype(bool).reshape(size[1], size[0])


@contextlib.contextmanager
def _locked(path: Path) -> Iterator[bool]:
    """Hold a lock; yields whether there are locks here."""
    with open(path, "w") as file:
        if fcntl is not None:
            fcntl.flock(file, fcntl.LOCK_EX)
        yield fcntl is not None


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)
