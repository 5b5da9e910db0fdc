"""Recipes to recordings on disk: frames are rendered by several processes and written in order."""

from __future__ import annotations

import multiprocessing
import shutil
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from threadpoolctl import threadpool_limits

from hmc.errors import InputError
from hmc.io.calibration import write_calibration
from hmc.io.files import part_path, sweep, write_toml
from hmc.io.results import PoseTable, TrackTable, write_joints, write_tracks
from hmc.io.video import check_written
from hmc.landmarks import FOOT_POINTS, LANDMARKS
from hmc.synthetic.actor import PARTS
from hmc.synthetic.feet import true_foot_points
from hmc.synthetic.image import Backdrop, develop, exposure, light_crowd, make_backdrop, picture, relit, static_shadows
from hmc.synthetic.recipe import Recipe, load_recipe
from hmc.synthetic.scene import Scene, build_scene, crowd_at
from hmc.synthetic.shading import ShadowMap
from hmc.synthetic.skeleton import landmark_positions
from hmc.synthetic.surface import volume_centroid

__all__ = ["render_recording"]

Pictures = list[tuple[np.ndarray, np.ndarray | None]]


def render_recording(
    recipe: Recipe | str | Path,
    out: str | Path,
    seed: int | None = None,
    workers: int = 1,
    on_progress: Callable[[int, int], None] | None = None,
    pictures: bool = True,
) -> Path:
    """Render a recipe into a recording with truth.

    The recording appears under its name only when it is complete.

    Parameters
    ----------
    recipe : Recipe, path, or name of a shipped recipe
    out : path
        Folder of the recording; must not exist, or hold a recording that was rendered before (it is replaced).
    seed : int, optional
        In place of the recipe's. The same recipe and seed give the same recording, whatever the number of workers.
    workers : int
        Processes. A script that asks for more than one must keep its top level behind ``if __name__ == "__main__":``.
    on_progress : callable, optional
        Called with the number of frames done and their total, once a frame.
    pictures : bool
        With videos and silhouettes; without, calibration, settings and truth alone, which take a fraction of the time.

    Returns
    -------
    Path
        `out`.

    Raises
    ------
    InputError
        When the recipe is wrong, or `out` is something else than a rendered recording.
    """
    recipe = recipe if isinstance(recipe, Recipe) else load_recipe(recipe)
    out = Path(out)
    if out.exists() and not (
        out.is_dir() and (not any(out.iterdir()) or ((out / "calibration.toml").is_file() and (out / "truth").is_dir()))
    ):
        raise InputError(f"{out}: exists and is no rendered recording; choose another folder or remove it")
    scene = build_scene(recipe, seed)
    out.parent.mkdir(parents=True, exist_ok=True)
    sweep(out.parent)
    part = part_path(out)
    try:
        _write_tables(scene, part)
        if pictures:
            _write_pictures(scene, part, workers, on_progress)
        if out.exists():
            shutil.rmtree(out)
        part.rename(out)
    finally:
        shutil.rmtree(part, ignore_errors=True)
    return out


def _write_tables(scene: Scene, folder: Path) -> None:
    """Calibration, settings, and the truth about the joints and volumes of the people in the room."""
    recipe = scene.recipe
    (folder / "truth").mkdir(parents=True)
    write_calibration(folder / "calibration.toml", scene.rig)
    settings = {
        "name": recipe.name, "fps": recipe.fps, "frames": recipe.n_frames, "units": "m", "up": "z", "room": scene.room.corners,
        "persons": len(scene.actors), "subject_height_m": [actor.skeleton.height_m for actor in scene.actors],
    }  # fmt: skip
    write_toml(folder / "recording.toml", settings)
    n, persons = recipe.n_frames, len(scene.actors)
    present = np.array([scene.in_room(k) for k in range(persons)], bool).reshape(persons, n).T
    frames, actors = np.nonzero(present)
    joints, feet = np.zeros((n, persons, len(LANDMARKS), 3)), np.zeros((n, persons, len(FOOT_POINTS), 3))
    centroids, heads = np.zeros((n, persons, 3)), np.zeros((n, persons, 3))
    for k, (actor, motion) in enumerate(zip(scene.actors, scene.motions, strict=True)):
        joints[:, k] = landmark_positions(actor.skeleton, motion.root, motion.orientations)
        feet[:, k] = true_foot_points(actor, motion.root, motion.orientations)
    for frame in range(n):
        crowd = crowd_at(scene, frame)
        for k in np.flatnonzero(present[frame]).tolist():
            own = crowd.vertices[crowd.persons == k]
            centroids[frame, k] = volume_centroid(own, scene.actors[k].triangles)[1]
            heads[frame, k] = own[scene.actors[k].parts == list(PARTS).index("head")].mean(axis=0)
    write_joints(folder / "truth" / "joints.csv", PoseTable(frames, actors, joints[present]))
    write_joints(folder / "truth" / "feet.csv", PoseTable(frames, actors, feet[present], names=FOOT_POINTS))
    write_tracks(folder / "truth" / "centroids.csv", TrackTable(frames, actors, centroids[present], heads[present]))


def _write_pictures(scene: Scene, folder: Path, workers: int, on_progress: Callable[[int, int], None] | None) -> None:
    """Videos of the action and of the empty room, and silhouettes."""
    recipe, store = scene.recipe, folder / "backdrops"
    store.mkdir()
    total = recipe.n_frames + recipe.background_frames
    done = 0
    with _pool(workers, scene, store) as (prepare, render):
        for _ in prepare(range(len(scene.rig))):
            pass
        for name, frames in (("background", range(-recipe.background_frames, 0)), ("videos", range(recipe.n_frames))):
            if not frames:
                continue
            with _writers(scene, folder / name) as writers:
                for frame, pictures in zip(frames, render(frames), strict=True):
                    for camera, writer, (image, labels) in zip(scene.rig, writers, pictures, strict=True):
                        writer.write(image)
                        if labels is not None:
                            _write_silhouette(
                                folder / "truth" / "silhouettes" / camera.name / f"{frame:06d}.png", labels, len(scene.actors)
                            )
                    done += 1
                    if on_progress is not None:
                        on_progress(done, total)
            for camera in scene.rig:
                place = f"{name}/{camera.name}.mp4"
                check_written(place, folder / place, len(frames))
    shutil.rmtree(store)


def _write_silhouette(path: Path, labels: np.ndarray, persons: int) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(cv2.imencode(".png", labels * np.uint8(255 if persons == 1 else 85 if persons <= 3 else 51))[1].tobytes())


@contextmanager
def _writers(scene: Scene, folder: Path) -> Iterator[list[cv2.VideoWriter]]:
    folder.mkdir()
    code = cv2.VideoWriter.fourcc(*"mp4v")
    writers = [cv2.VideoWriter(str(folder / f"{camera.name}.mp4"), code, scene.recipe.fps, camera.size) for camera in scene.rig]
    try:
        if not all(writer.isOpened() for writer in writers):
            raise OSError(f"{folder}: OpenCV cannot write MPEG-4 video here")
        yield writers
    finally:
        for writer in writers:
            writer.release()


class _Studio:
    """What one process needs to render frames; built once in each."""

    def __init__(self, scene: Scene, store: Path) -> None:
        self.scene = scene
        self.store = store
        self.furniture: tuple[ShadowMap, ...] = static_shadows(scene)
        self.backdrops: list[Backdrop] = []
        self.action, self.relit = _dimmed(scene), list[Backdrop]()

    def store_backdrop(self, camera: int) -> None:
        backdrop = make_backdrop(self.scene, self.scene.rig[camera], self.furniture, _rng(self.scene, 0, camera))
        np.savez(self.store / f"{camera}.npz", **vars(backdrop))

    def load(self) -> None:
        for camera in range(len(self.scene.rig)):
            with np.load(self.store / f"{camera}.npz", allow_pickle=False) as arrays:
                self.backdrops.append(Backdrop(**arrays))
        changed = self.action is not self.scene
        self.relit = [relit(one, self.scene, self.action) for one in self.backdrops] if changed else self.backdrops

    def render(self, frame: int) -> Pictures:
        """The images of all cameras, and silhouettes where they are due; negative frames show the empty room."""
        if not self.backdrops:
            self.load()
        scene, backdrops = (self.scene, self.backdrops) if frame < 0 else (self.action, self.relit)
        pictures: Pictures = []
        lit = light_crowd(scene, crowd_at(scene, frame), self.furniture) if frame >= 0 or scene.props else None
        for k, (camera, backdrop, empty) in enumerate(zip(scene.rig, backdrops, self.backdrops, strict=True)):
            rng = _rng(scene, 1 + (frame if frame >= 0 else 10**7 - frame), k)
            labels = None
            radiance = backdrop.radiance
            if lit is not None:
                radiance, labels = picture(scene, camera, backdrop, lit)
                if frame < 0 or frame % scene.recipe.silhouette_every:
                    labels = None
            gain = exposure(radiance, empty, scene) if frame >= 0 else 1.0
            pictures.append((develop(radiance, camera.size, scene, rng, gain), labels))
        return pictures


def _dimmed(scene: Scene) -> Scene:
    """The scene with its lamps as they are in the action."""
    share = scene.recipe.light.dimmed
    if share == 1:
        return scene
    first, *others = scene.lights
    return replace(scene, lights=(replace(first, power=first.power * share), *others))


def _rng(scene: Scene, stage: int, camera: int) -> np.random.Generator:
    """A generator that depends on what is rendered, never on the worker that renders it."""
    return np.random.default_rng([scene.seed, stage, camera])


# A worker process keeps its studio here; `_open_studio` is the pool's initialiser and nothing else writes it.
_STUDIO: list[_Studio] = []


def _open_studio(scene: Scene, store: Path) -> None:
    # An interrupt is the parent's to answer: it ends the pool.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # One thread each: the processes share the cores, and sums do not depend on how threads divide them.
    cv2.setNumThreads(1)
    threadpool_limits(1)
    _STUDIO[:] = [_Studio(scene, store)]


def _store_backdrop(camera: int) -> None:
    _STUDIO[0].store_backdrop(camera)


def _render_frame(frame: int) -> Pictures:
    return _STUDIO[0].render(frame)


@contextmanager
def _pool(workers: int, scene: Scene, store: Path) -> Iterator[tuple[Callable, Callable]]:
    """Two functions that map `_Studio.store_backdrop` over cameras and `_Studio.render` over frames, lazily and in order."""
    if workers <= 1:
        with threadpool_limits(1):
            studio = _Studio(scene, store)
            yield (lambda cameras: map(studio.store_backdrop, cameras)), (lambda frames: map(studio.render, frames))
        return
    # Spawned, not forked: a fork copies the locks of threads that the parent may be running.
    with multiprocessing.get_context("spawn").Pool(workers, _open_studio, (scene, store)) as pool:
        yield (lambda cameras: pool.imap(_store_backdrop, cameras)), (lambda frames: pool.imap(_render_frame, frames))
