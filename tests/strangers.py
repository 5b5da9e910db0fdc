# ruff: noqa: E501
"""Recordings, results and surroundings as a stranger may bring them, given to whole commands: how each ends.

``python tests/strangers.py`` takes the miniature of `tests/miniature.py` and does to it what no broken file does: calibrations that mean something
else, images of other kinds, numbers that begin elsewhere, clocks that jump, folders in one another, a terminal that is not there. Each strange thing
is given to the commands that meet it, alone and then in pairs (`--pairs`); what is counted is said in `tests/mutations.py`.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import resource
import shutil
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
from miniature import COARSE, QUICK, Given, build
from mutations import Ending, _copied, judged, warm

from hmc.io.calibration import read_calibration

CHECK = ("check", "rec", "--out", "check.png")
TRACK = ("track", "rec", "--out", "new", "--voxel", "0.1", *QUICK)
POSE = ("pose", "rec", "--out", "new", *COARSE)
POINTS = ("pose", "rec", "--out", "new", "--cues", "keypoints", "--quiet")
WORLD = ("world", "rec", "--out", "world.png", "--dry-run")
GIVEN_POINTS = ("world", "rec", "--out", "world.png", "--points", "points.csv")
SYNC = ("sync", "rec", "--out", "sync.png", "--dry-run")
EVALUATE = ("evaluate", "result", "rec", "--angles", "--offsets", "--images", "--threshold", "auto")
VIEW = ("view", "result", "rec", "--out", "v.png", "--no-voxels")
RUN = ("run", "session.toml", "--out", "all", "--quiet", "--workers", "1")
SYNTH = ("synth", "recipe.toml", "--out", "new", *QUICK)
EXPORT = ("export", "result", "--to", "trc")
ANGLES = ("angles", "result")

Change = Callable[[Path], None]


@dataclass(frozen=True)
class Strange:
    """What is done to the folder, the commands that meet it, and what is done to the process before it runs one."""

    change: Change
    commands: tuple[tuple[str, ...], ...]
    before: Change | None = None


#: What is strange, by name.
STRANGE: dict[str, Strange] = {}


def strange(*commands: tuple[str, ...], named: str, before: Change | None = None) -> Callable[[Change], Change]:
    """Note a change."""

    def note(change: Change) -> Change:
        STRANGE[named] = Strange(change, commands, before)
        return change

    return note


def camera_table(folder: Path, k: int) -> tuple[str, re.Match[str]]:
    """The text of the calibration, and where camera k stands in it."""
    text = (folder / "rec/calibration.toml").read_text()
    return text, list(re.finditer(r"(?ms)^\[[^\]]+\]\n.*?(?=^\[|\Z)", text))[k]


def with_camera(change: Callable[[str], str], cameras: tuple[int, ...] = (0,)) -> Change:
    """A change of the tables of some cameras."""

    def do(folder: Path) -> None:
        for k in cameras:
            text, found = camera_table(folder, k)
            new = text[: found.start()] + change(found[0]) + text[found.end() :]
            assert new != text
            (folder / "rec/calibration.toml").write_text(new)

    return do


def values_of(table: str, key: str) -> np.ndarray:
    import tomllib

    return np.array(next(iter(tomllib.loads(table).values()))[key], float)


def with_values(key: str, change: Callable[[np.ndarray], object], cameras: tuple[int, ...] = (0,)) -> Change:
    """Other values of a camera."""

    def other(table: str) -> str:
        value = change(values_of(table, key))
        value = value.tolist() if isinstance(value, np.ndarray) else value
        return re.sub(rf"(?m)^{key} = .*$", lambda _: f"{key} = {json.dumps(value)}", table)

    return with_camera(other, cameras)


ALL = (0, 1, 2, 3)
CALIBRATED = (CHECK, TRACK)


def _scaled_rows(by: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda m: np.array([[m[0, 0] * by, 0, m[0, 2]], [0, m[1, 1] * by, m[1, 2]], [0, 0, 1]])


for name, change in {
    "two equal cameras": None,
    "focal length in mm": with_values("matrix", _scaled_rows(0.06), ALL),
    "focal length in mm, one": with_values("matrix", _scaled_rows(0.06)),
    "intrinsics in shares of the width": with_values("matrix", lambda m: np.array([[m[0, 0] / 80, 0, m[0, 2] / 80], [0, m[1, 1] / 60, m[1, 2] / 60], [0, 0, 1]]), ALL),
    "centre in shares": with_values("matrix", lambda m: np.array([[m[0, 0], 0, 0.5], [0, m[1, 1], 0.5], [0, 0, 1]]), ALL),
    "negative fx": with_values("matrix", lambda m: m * np.array([[-1, 1, 1], [1, 1, 1], [1, 1, 1]])),
    "negative fx and fy": with_values("matrix", lambda m: m * np.array([[-1, 1, 1], [1, -1, 1], [1, 1, 1]]), ALL),
    "matrix transposed": with_values("matrix", lambda m: m.T),
    "matrix flat": with_values("matrix", lambda m: m.ravel()),
    "centre outside": with_values("matrix", lambda m: m + np.array([[0, 0, 500], [0, 0, 0], [0, 0, 0]])),
    "mirrored": with_values("rotation", lambda r: np.diag([-1.0, 1, 1]) @ _matrix(r)),
    "transposed rotation": with_values("rotation", lambda r: _matrix(r).T, ALL),
    "rotation in degrees": with_values("rotation", lambda r: np.degrees(r), ALL),
    "rotation a quaternion": with_values("rotation", lambda r: [1, 0, 0, 0]),
    "rotation zero": with_values("rotation", lambda r: [0, 0, 0], ALL),
    "translation of the centre": with_values("translation", lambda t: t[::-1].copy(), ALL),
    "translation zero": with_values("translation", lambda t: [0, 0, 0], ALL),
    "millimetres": with_values("translation", lambda t: t * 1000, ALL),
    "millimetres, one": with_values("translation", lambda t: t * 1000),
    "centimetres": with_values("translation", lambda t: t * 100, ALL),
    "size swapped": with_values("size", lambda s: [60, 80]),
    "size as text": with_values("size", lambda s: ["80", "60"]),
    "size one number": with_values("size", lambda s: 80),
    "size of nothing": with_values("size", lambda s: [0, 0]),
    **{f"{n} zero distortions": with_values("distortions", lambda d, n=n: [0.0] * n, ALL) for n in (0, 1, 2, 3, 6, 7, 13, 14, 30)},
    "distortions None": with_values("distortions", lambda d: False),
    "strong distortions": with_values("distortions", lambda d: [-5.0, 8.0, 0, 0], ALL),
}.items():  # fmt: skip
    if change is not None:
        strange(*CALIBRATED, named=name)(change)


def _matrix(rotation: np.ndarray) -> np.ndarray:
    return rotation if rotation.size == 9 else cv2.Rodrigues(rotation)[0]


@strange(*CALIBRATED, EVALUATE, named="two equal cameras")
def _equal(folder: Path) -> None:
    rig = read_calibration(folder / "rec")
    for key, value in (
        ("matrix", rig[0].matrix),
        ("rotation", cv2.Rodrigues(rig[0].rotation.copy())[0].ravel()),
        ("translation", rig[0].translation),
    ):
        with_values(key, lambda _, value=value: value, (1,))(folder)


@strange(*CALIBRATED, named="all cameras equal")
def _all_equal(folder: Path) -> None:
    rig = read_calibration(folder / "rec")
    for key, value in (
        ("matrix", rig[0].matrix),
        ("rotation", cv2.Rodrigues(rig[0].rotation.copy())[0].ravel()),
        ("translation", rig[0].translation),
    ):
        with_values(key, lambda _, value=value: value, (1, 2, 3))(folder)


@strange(CHECK, TRACK, named="two cameras' places swapped")
def _swapped_places(folder: Path) -> None:
    text = (folder / "rec/calibration.toml").read_text()
    (folder / "rec/calibration.toml").write_text(text.replace("cam_00", "X").replace("cam_01", "cam_00").replace("X", "cam_01"))


@strange(CHECK, TRACK, named="one camera")
def _one_camera(folder: Path) -> None:
    _, found = camera_table(folder, 0)
    (folder / "rec/calibration.toml").write_text(found[0])


@strange(CHECK, TRACK, named="no camera")
def _no_camera(folder: Path) -> None:
    (folder / "rec/calibration.toml").write_text("# none\n")


@strange(CHECK, TRACK, POSE, VIEW, named="names of cameras that are patterns")
def _patterns(folder: Path) -> None:
    _renamed(folder, ["cam[0]", "c*m", "%d", "~"])


@strange(CHECK, TRACK, named="a camera's name of 300 letters")
def _long(folder: Path) -> None:
    text = (folder / "rec/calibration.toml").read_text()
    (folder / "rec/calibration.toml").write_text(text.replace("cam_00", "c" * 300))


@strange(CHECK, TRACK, POSE, VIEW, named="names of cameras in other scripts")
def _scripts(folder: Path) -> None:
    _renamed(folder, ["カメラ", "камера", "caméra", "🎥"])


@strange(CHECK, TRACK, named="names of cameras that differ in form alone")
def _forms(folder: Path) -> None:
    _renamed(folder, ["cam\u00e9", "came\u0301", "CAM", "cam"])


@strange(CHECK, TRACK, VIEW, named="names that are reserved")
def _reserved(folder: Path) -> None:
    _renamed(folder, ["con", "..a", "-x", "a b "])


def _renamed(folder: Path, names: list[str]) -> None:
    text = (folder / "rec/calibration.toml").read_text()
    for k, name in enumerate(names):
        text = re.sub(rf"(?m)^\[cam_0{k}\]", lambda _, name=name: f"[{json.dumps(name, ensure_ascii=False)}]", text)
        text = text.replace(f'"cam_0{k}"', json.dumps(name, ensure_ascii=False))
        for part in sorted((folder / "rec").rglob(f"cam_0{k}*"), key=lambda one: -len(one.parts)):
            part.rename(part.with_name(part.name.replace(f"cam_0{k}", name)))
    (folder / "rec/calibration.toml").write_text(text)


@strange(CHECK, TRACK, named="two calibrations")
def _two_calibrations(folder: Path) -> None:
    rig = read_calibration(folder / "rec")
    for camera in rig:
        storage = cv2.FileStorage(str(folder / "rec" / f"{camera.name}.yml"), cv2.FILE_STORAGE_WRITE)
        storage.write("camera_matrix", camera.matrix * 1.5)
        storage.release()


# ---- footage


def images_of(folder: Path, camera: str = "cam_02") -> list[Path]:
    return sorted((folder / "rec/images" / camera).iterdir())


def each_image(
    change: Callable[[np.ndarray], np.ndarray],
    suffix: str = ".png",
    frames: slice = slice(None),
    what: str = "images",
    options: tuple[int, ...] = (),
) -> Change:
    """Other images of camera 2 in place of its own."""

    def do(folder: Path) -> None:
        for file in sorted((folder / "rec" / what / "cam_02").iterdir())[frames]:
            image = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
            file.unlink()
            assert cv2.imwrite(str(file.with_suffix(suffix)), change(image), list(options))

    return do


def both(*changes: Change) -> Change:
    def do(folder: Path) -> None:
        for change in changes:
            change(folder)

    return do


def deep(bits: int, scale: int = 1) -> Callable[[np.ndarray], np.ndarray]:
    return lambda image: ((image.astype(np.uint16) << (bits - 8)) * scale).astype(np.uint16)


SEEN = (CHECK, TRACK)
for name, change in {
    "12-bit images": each_image(deep(12)),
    "12-bit images and empty scene": both(each_image(deep(12)), each_image(deep(12), what="background")),
    "10-bit tiff": each_image(deep(10), ".tiff"),
    "16-bit images": each_image(deep(16)),
    "float images": each_image(lambda image: image.astype(np.float32) / 255, ".tiff"),
    "gray images": each_image(lambda image: image[..., 1]),
    "images with alpha": each_image(lambda image: np.dstack([image, np.zeros(image.shape[:2], np.uint8)])),
    "another size in the middle": each_image(lambda image: cv2.resize(image, (160, 120)), frames=slice(2, 3)),
    "another size first": each_image(lambda image: cv2.resize(image, (160, 120)), frames=slice(0, 1)),
    "another size": each_image(lambda image: cv2.resize(image, (160, 120))),
    "turned in the middle": each_image(lambda image: np.ascontiguousarray(np.rot90(image)), frames=slice(2, None)),
    "one pixel": each_image(lambda image: image[:1, :1]),
    "one pixel, one": each_image(lambda image: image[:1, :1], frames=slice(0, 1)),
    "jpeg": each_image(lambda image: image, ".jpg"),
    "white": each_image(lambda image: np.full_like(image, 255)),
    "empty scene of another size": each_image(lambda image: cv2.resize(image, (81, 61)), what="background"),
    "empty scene black": each_image(np.zeros_like, what="background"),
}.items():
    strange(*SEEN, named=name)(change)


@strange(*SEEN, SYNC, named="one camera begins with 1000")
def _thousand(folder: Path) -> None:
    for file in images_of(folder):
        file.rename(file.with_name(f"{int(file.stem) + 1000:06d}.png"))


@strange(*SEEN, SYNC, named="both of images begin with 1000")
def _thousands(folder: Path) -> None:
    for camera in ("cam_02", "cam_03"):
        for file in images_of(folder, camera):
            file.rename(file.with_name(f"{int(file.stem) + 1000:06d}.png"))


@strange(*SEEN, named="every other number")
def _every_other(folder: Path) -> None:
    for file in reversed(images_of(folder)):
        file.rename(file.with_name(f"{2 * int(file.stem):06d}.png"))


@strange(*SEEN, named="names with dates")
def _dated(folder: Path) -> None:
    for file in images_of(folder):
        file.rename(file.with_name(f"2024-05-01_12-00-00_{int(file.stem):04d}_cam2.png"))


@strange(*SEEN, named="times as names")
def _nanoseconds(folder: Path) -> None:
    for file in images_of(folder):
        file.rename(file.with_name(f"{1_700_000_000_000 + 66 * int(file.stem)}.png"))


@strange(*SEEN, VIEW, named="in videos and in images")
def _both_places(folder: Path) -> None:
    (folder / "rec/images/cam_00").mkdir()
    for file in images_of(folder):
        shutil.copy(file, folder / "rec/images/cam_00")


@strange(*SEEN, named="a jpeg cut in the middle")
def _cut_jpeg(folder: Path) -> None:
    each_image(lambda image: image, ".jpg")(folder)
    file = images_of(folder)[2]
    data = file.read_bytes()
    file.write_bytes(data[: len(data) // 2])


@strange(*SEEN, named="jpeg named png")
def _misnamed(folder: Path) -> None:
    each_image(lambda image: image, ".jpg")(folder)
    for file in images_of(folder):
        file.rename(file.with_suffix(".png"))


@strange(*SEEN, named="pages in one tiff")
def _pages(folder: Path) -> None:
    images = [cv2.imread(str(file)) for file in images_of(folder)]
    shutil.rmtree(folder / "rec/images/cam_02")
    cv2.imwritemulti(str(folder / "rec/images/cam_02.tiff"), images)


@strange(*SEEN, named="a moving gif as png")
def _gif(folder: Path) -> None:
    for file in images_of(folder):
        file.write_bytes(b"GIF89a" + file.read_bytes())


def video(folder: Path, name: str, fps: float, n: int, codec: str = "MJPG", size: tuple[int, int] = (80, 60)) -> None:
    writer = cv2.VideoWriter(str(folder / "rec/videos" / name), cv2.VideoWriter_fourcc(*codec), fps, size)
    rng = np.random.default_rng(0)
    for _ in range(n):
        writer.write(rng.integers(0, 256, (size[1], size[0], 3), np.uint8))
    writer.release()


for name, (fps, n, size) in {
    "video of one frame": (15, 1, (80, 60)),
    "video of two frames": (15, 2, (80, 60)),
    "video of 9000 frames a second": (9000, 4, (80, 60)),
    "video of a frame in ten seconds": (0.1, 4, (80, 60)),
    "video of another size": (15, 4, (96, 64)),
    "long video": (15, 3000, (80, 60)),
}.items():

    @strange(*SEEN, named=name)
    def _other_video(folder: Path, fps: float = fps, n: int = n, size: tuple[int, int] = size) -> None:
        (folder / "rec/videos/cam_00.mp4").unlink()
        video(folder, "cam_00.avi", fps, n, size=size)


@strange(*SEEN, named="every video the same")
def _same_video(folder: Path) -> None:
    (folder / "rec/videos/cam_01.mp4").unlink()
    os.link(folder / "rec/videos/cam_00.mp4", folder / "rec/videos/cam_01.mp4")


@strange(*SEEN, VIEW, named="a camera's folder that leads round")
def _round(folder: Path) -> None:
    (folder / "rec/images/cam_02/cam_02").symlink_to("..")
    (folder / "rec/images/cam_02/more").symlink_to(folder / "rec")


@strange(*SEEN, named="videos that lead to themselves")
def _self(folder: Path) -> None:
    shutil.rmtree(folder / "rec/videos")
    (folder / "rec/videos").symlink_to("videos")


@strange(*SEEN, named="silhouettes of 0 and 1")
def _ones(folder: Path) -> None:
    for file in (folder / "rec").glob("silhouettes/*/*.png"):
        cv2.imwrite(str(file), (cv2.imread(str(file), 0) > 0).astype(np.uint8))


@strange(CHECK, TRACK, POSE, named="silhouettes alone, begin with 1000")
def _masks_alone(folder: Path) -> None:
    for part in ("videos", "images", "background", "keypoints", "times"):
        shutil.rmtree(folder / "rec" / part, ignore_errors=True)
    for file in sorted((folder / "rec").glob("silhouettes/cam_01/*.png")):
        file.rename(file.with_name(f"{int(file.stem) + 1000:06d}.png"))


# ---- keypoints and times

POINTED = (CHECK, POINTS)


def each_point(change: Callable[[np.ndarray], np.ndarray], cameras: tuple[str, ...] = ("cam_00",)) -> Change:
    """Other keypoints, (n, 3), of the camera with a file a frame."""

    def do(folder: Path) -> None:
        for camera in cameras:
            for file in sorted((folder / "rec/keypoints" / camera).glob("*.json")):
                document = json.loads(file.read_text())
                for one in document["people"]:
                    one["pose_keypoints_2d"] = change(np.array(one["pose_keypoints_2d"]).reshape(-1, 3)).ravel().tolist()
                file.write_text(json.dumps(document))

    return do


for name, change in {
    "keypoints of images ten times as large": each_point(lambda p: p * [10, 10, 1]),
    "keypoints of images twice as large": each_point(lambda p: p * [2, 2, 1]),
    "keypoints of images half as large": each_point(lambda p: p * [0.5, 0.5, 1]),
    "keypoints upside down": each_point(lambda p: p * [1, -1, 1]),
    "confidence in percent": each_point(lambda p: p * [1, 1, 100]),
    "confidence of two": each_point(lambda p: p * [1, 1, 1.2]),
    "confidence below nothing": each_point(lambda p: p * [1, 1, -1]),
    "twelve points": each_point(lambda p: p[:12]),
    "keypoints all at one place": each_point(lambda p: p * [0, 0, 1] + [30, 30, 0]),
}.items():
    strange(*POINTED, named=name)(change)


@strange(*POINTED, named="keypoints begin with 1000")
def _points_thousand(folder: Path) -> None:
    for file in sorted((folder / "rec/keypoints/cam_00").glob("*.json")):
        file.rename(file.with_name(re.sub(r"_0{9}00(\d)_", r"_00000000100\1_", file.name)))


def text_of(pattern: str, change: Callable[[str], str], codec: str = "utf-8", newline: bytes = b"\n") -> Change:
    """Other text in some files."""

    def do(folder: Path) -> None:
        found = sorted(folder.glob(pattern))
        assert found, pattern
        for file in found:
            file.write_bytes(change(file.read_text()).encode(codec).replace(b"\n", newline))

    return do


def semicolons(text: str) -> str:
    return re.sub(r"(\d)\.(\d)", r"\1,\2", text.replace(",", ";"))


TEXTS: dict[str, Callable[[str], Change]] = {
    "CRLF": lambda pattern: text_of(pattern, str, newline=b"\r\n"),
    "BOM": lambda pattern: text_of(pattern, str, "utf-8-sig"),
    "semicolons, decimal commas": lambda pattern: text_of(pattern, semicolons),
    "tabs": lambda pattern: text_of(pattern, lambda text: text.replace(",", "\t")),
    "thousands": lambda pattern: text_of(pattern, lambda text: re.sub(r"(?m)(\d)\.(\d)", r"\1'000.\2", text)),
    "a comment first": lambda pattern: text_of(pattern, lambda text: "# made by hand\n" + text),
    "capitals": lambda pattern: text_of(pattern, str.upper),
    "columns elsewhere": lambda pattern: text_of(
        pattern, lambda text: "\n".join(",".join(reversed(line.split(","))) for line in text.splitlines()) + "\n"
    ),
    "trailing commas": lambda pattern: text_of(pattern, lambda text: text.replace("\n", ",\n")),
}
for what, pattern, commands in (
    ("keypoints", "rec/keypoints/*.csv", (POINTS,)),
    ("times", "rec/times/*.csv", (TRACK,)),
    ("truth", "rec/truth/joints.csv", (EVALUATE,)),
    ("joints", "result/joints.csv", (EVALUATE, EXPORT)),
    ("points", "points.csv", (GIVEN_POINTS,)),
):
    for name, made in TEXTS.items():
        strange(*commands, named=f"{what}: {name}")(made(pattern))
for what, pattern, commands in (
    ("calibration", "rec/calibration.toml", (CHECK,)),
    ("recording.toml", "rec/recording.toml", (CHECK,)),
    ("session", "session.toml", (RUN,)),
    ("recipe", "recipe.toml", (SYNTH,)),
    ("settings", "settings.toml", (POSE,)),
):
    for name in ("CRLF", "BOM", "capitals", "semicolons, decimal commas"):
        strange(*commands, named=f"{what}: {name}")(TEXTS[name](pattern))


def each_time(change: Callable[[np.ndarray], np.ndarray], pattern: str = "cam_00.csv", form: str = "{:.4f}") -> Change:
    def do(folder: Path) -> None:
        for file in (folder / "rec/times").glob(pattern):
            times = change(np.arange(4) / 15)
            file.write_text("frame,time_s\n" + "".join(f"{k},{form.format(t)}\n" for k, t in enumerate(times)))

    return do


for name, change in {
    "a clock that jumps an hour": each_time(lambda t: t + 3600 * (np.arange(4) > 1)),
    "a clock that jumps back": each_time(lambda t: t - 0.5 * (np.arange(4) > 1)),
    "a clock that stands": each_time(lambda t: t * 0),
    "a clock an hour late": each_time(lambda t: t + 3600),
    "all clocks an hour late": each_time(lambda t: t + 3600, "*.csv"),
    "times of the epoch": each_time(lambda t: t + 1.7e9, "*.csv"),
    "times in ms": each_time(lambda t: t * 1000, "*.csv"),
    "times in ms, one": each_time(lambda t: t * 1000),
    "times in ns": each_time(lambda t: t * 1e9, "*.csv", "{:.0f}"),
    "times as dates": each_time(lambda t: t, "*.csv", "2024-05-01T12:00:00.{:.0f}"),
    "times with units": each_time(lambda t: t, "*.csv", "{:.4f} s"),
}.items():
    strange(TRACK, SYNC, named=name)(change)


# ---- recording.toml, session.toml, recipes, settings


def settings(lines: str, drop: str = "") -> Change:
    def do(folder: Path) -> None:
        file = folder / "rec/recording.toml"
        kept = [line for line in file.read_text().splitlines() if not drop or not re.match(rf"{drop} ?=", line)]
        file.write_text("\n".join([lines, *kept]) + "\n")

    return do


for name, change in {
    "unknown keys": settings('colour = "red"\n'),
    "fps a text": settings('fps = "15"', "fps"),
    "fps 15000": settings("fps = 15000", "fps"),
    "room in mm": settings("room = [[-2000, -2000, 0], [2000, 2000, 2600]]", "room"),
    "room that is nowhere": settings("room = [[50, 50, 0], [52, 52, 2]]", "room"),
    "room of a millimetre": settings("room = [[0, 0, 0], [0.001, 0.001, 0.001]]", "room"),
    "room a hundred metres wide": settings("room = [[-49, -49, 0], [49, 49, 40]]", "room"),
    "one file for two cameras": settings('videos = { cam_00 = "videos/cam_01.mp4" }'),
    "videos outside": settings('videos = "../../{camera}.mp4"'),
    "videos in a folder of the system": settings('videos = { cam_00 = "/proc/self/mem" }'),
    "an address as video": settings('videos = { cam_00 = "http://localhost:1/x.mp4" }'),
    "first frame beyond": settings("first_frame = { cam_00 = 4 }"),
    "first frame of each": settings("first_frame = { cam_00 = 3, cam_01 = 0 }"),
    "persons 1000": settings("persons = 1000", "persons"),
    "persons none": settings("persons = 0", "persons"),
    "a name that leads elsewhere": settings('name = "../../x"', "name"),
    "a name of many lines": settings('name = "a\\nb\\u001b[31m"', "name"),
    "up the other way": settings('up = "-z"'),
    "units of miles": settings("units = 1609.0"),
    "image size scaled": settings('image_size = "scaled"'),
}.items():
    strange(CHECK, TRACK, named=name)(change)


def session(lines: str, after: str = "", drop: str = "") -> Change:
    def do(folder: Path) -> None:
        file = folder / "session.toml"
        kept = [line for line in file.read_text().splitlines() if not drop or not re.match(rf"{drop} ?=", line)]
        file.write_text("\n".join([lines, *kept, after]) + "\n")

    return do


for name, change in {
    "overlapping trials": session("", '[[trial]]\nname = "again"\nfolder = "trials/one"'),
    "trials that are the session": session('trials = "."', drop="trials"),
    "trials up there": session('trials = "../*"', drop="trials"),
    "trials of all depths": session('trials = "**"', drop="trials"),
    "a trial of another case": session("", '[[trial]]\nname = "ONE"\nfolder = "trials/two"'),
    "a trial that begins at its end": session("", '[[trial]]\nname = "one"\nstart = 4'),
    "a trial of no frames": session("", '[[trial]]\nname = "one"\nframes = 0'),
    "a trial of -1 frames": session("", '[[trial]]\nname = "one"\nframes = -1'),
    "unknown people": session("", '[[trial]]\nname = "one"\npersons = ["nobody"]'),
    "calibration of itself": session('calibration = "session.toml"', drop="calibration"),
    "unknown options": session("", '[[trial]]\nname = "one"\n[trial.pose]\nfoo = 1'),
    "out as an option": session("", '[[trial]]\nname = "one"\n[trial.pose]\nout = "../elsewhere"'),
}.items():
    strange(RUN, named=f"session: {name}")(change)


@strange(
    RUN,
    (*RUN[:3], "trials", *RUN[4:]),
    (*RUN[:3], "trials/one", *RUN[4:]),
    (*RUN[:3], "session.toml", *RUN[4:]),
    (*RUN[:3], ".", *RUN[4:]),
    named="session: results where",
)
def _nothing(folder: Path) -> None:
    pass


@strange(RUN, named="session: a trial twice by a link")
def _linked_trial(folder: Path) -> None:
    (folder / "trials/three").symlink_to("one")
    (folder / "trials/four").symlink_to("four")


def recipe(change: Callable[[str], str]) -> Change:
    return text_of("recipe.toml", change)


for name, (old, new) in {
    "a billion seconds": ("seconds = 0.27", "seconds = 1e9"),
    "no seconds": ("seconds = 0.27", "seconds = 0"),
    "huge images": ("size_px = [80, 60]", "size_px = [90000, 90000]"),
    "images of one pixel": ("size_px = [80, 60]", "size_px = [1, 1]"),
    "odd images": ("size_px = [80, 60]", "size_px = [81, 61]"),
    "an actor outside": ("start_m = [-0.3, 0.1]", "start_m = [30, 0.1]"),
    "a giant": ("height_m = 1.76", "height_m = 17.6"),
    "a fast one": ("speed_m_s = 1.15", "speed_m_s = 300"),
    "a name elsewhere": ('name = "mini"', 'name = "../../mini"'),
    "a seed below nothing": ("seed = 3", "seed = -3"),
    "fps 1e5": ("fps = 15", "fps = 100000"),
    "an unknown motion": ('motion = "walk"', 'motion = "/dev/zero"'),
    "a room like a box": ("size_m = [4.2, 4.0, 2.6]", "size_m = [0.1, 0.1, 0.1]"),
    "a thousand actors": ("[[actor]]", "[[actor]]\nheight_m = 1.7\nmotion = \"walk\"\n" * 300 + "[[actor]]"),
}.items():  # fmt: skip

    def _swap(text: str, old: str = old, new: str = new) -> str:
        assert old in text
        return text.replace(old, new, 1)

    strange(SYNTH, named=f"recipe: {name}")(recipe(_swap))

for name, text in {
    "unknown": "[annealed]\nlayer = 2\n", "another table": "layers = 2\n", "half a particle": "[annealed]\nparticles = 0.5\n", "no particle": "[annealed]\nparticles = 0\n",
    "less than none": "[annealed]\nlayers = -2\n", "much": "[annealed]\nlayers = 1000000\nparticles = 1000000\n", "nan": "[annealed]\nsurvival_rate = nan\n",
}.items():  # fmt: skip
    strange(POSE, named=f"settings: {name}")(text_of("settings.toml", lambda _, text=text: text))


# ---- results, and where they go


def out(words: tuple[str, ...], where: str) -> tuple[str, ...]:
    k = words.index("--out") + 1
    return (*words[:k], where, *words[k + 1 :])


PLACES = ("rec", "rec/new", "rec/videos", "rec/videos/cam_00.mp4", "rec/background/new", "rec/images/cam_02", ".", "/proc/new", "/dev/null", "a/b/c/d", "n" * 300, "/".join(["d" * 200] * 30),
          "naïve 🎥", "a\nb", "%d", "~", "loop", "nowhere", "locked", "result", "settings.toml")  # fmt: skip


@strange(
    *(out(TRACK, where) for where in PLACES),
    *(out(VIEW, where) for where in ("rec/calibration.toml", "rec", "loop", "v.xyz", "v", "rec/videos/cam_00.mp4", "locked/v.png")),
    named="out",
)
def _places(folder: Path) -> None:
    (folder / "loop").symlink_to("loop")
    (folder / "nowhere").symlink_to("/nowhere/at/all")
    (folder / "locked").mkdir(mode=0o555)


@strange(TRACK, out(TRACK, "new/x"), POSE, named="out is there, and full of others")
def _full(folder: Path) -> None:
    (folder / "new").mkdir()
    for name in ("tracks.csv", "joints.csv", "run.toml", "thesis.docx", "x"):
        (folder / "new" / name).write_text("mine\n")


@strange(("track", ".", "--out", "new", *QUICK), ("track", "rec/../rec/.", "--out", "new", "--voxel", "0.1", *QUICK), ("track", "rec/videos", "--out", "new", *QUICK),
         ("track", "rec/calibration.toml", "--out", "new", *QUICK), ("track", "link", "--out", "new", "--voxel", "0.1", *QUICK), ("track", "a b\n%d", "--out", "new", "--voxel", "0.1", *QUICK),
         ("check", "link"), ("check", ""), ("check", "a b\n%d"), ("evaluate", "rec", "result"), ("evaluate", "rec", "rec"), ("evaluate", "result", "result"), ("export", "rec", "--to", "trc"),
         ("view", "rec", "rec", "--out", "v.png"), ("angles", "rec"), ("cite", "rec"), ("pose", "rec", "--out", "new", "--tracks", "rec/calibration.toml", *QUICK),
         ("pose", "rec", "--out", "new", "--tracks", "result", *QUICK), ("pose", "rec", "--out", "new", "--like", "result", *QUICK),
         ("pose", "rec", "--out", "new", "--like", "rec/recording.toml", *QUICK), (*POSE, "--seed", "-1"), (*POSE, "--seed", "9" * 40), (*TRACK, "--frames", "0"),
         (*TRACK, "--start", "-1"), (*TRACK, "--cameras", ""), (*TRACK, "--cameras", "cam_00", "cam_00", "cam_01"), (*TRACK, "--voxel", "0"), (*TRACK, "--voxel", "nan"),
         (*TRACK, "--voxel", "1e-5"), (*TRACK, "--workers", "1000000"), named="words")  # fmt: skip
def _words(folder: Path) -> None:
    (folder / "link").symlink_to("rec")
    shutil.copytree(folder / "rec", folder / "a b\n%d")


def table(change: Callable[[list[list[str]]], list[list[str]]], pattern: str) -> Change:
    def other(text: str) -> str:
        rows = [line.split(",") for line in text.splitlines()]
        return "\n".join(",".join(row) for row in [rows[0], *change(rows[1:])]) + "\n"

    return text_of(pattern, other)


def _times_1000(rows: list[list[str]]) -> list[list[str]]:
    return [[*row[:3], *(f"{float(value) * 1000:.3f}" if value else "" for value in row[3:6]), *row[6:]] for row in rows]


for name, change in {
    "in mm": _times_1000,
    "begins with frame 1": lambda rows: [[str(int(row[0]) + 1), *row[1:]] for row in rows],
    "of persons with names": lambda rows: [[row[0], "Ann", *row[2:]] for row in rows],
    "twice": lambda rows: rows + rows,
    "backwards": lambda rows: rows[::-1],
    "no rows": lambda rows: [],
    "one row": lambda rows: rows[:1],
    "joints of another body": lambda rows: [[*row[:2], f"joint_{k}", *row[3:]] for k, row in enumerate(rows)],
    "of frames far away": lambda rows: [[str(int(row[0]) + 9_000_000), *row[1:]] for row in rows],
}.items():
    strange(EVALUATE, named=f"truth: {name}")(table(change, "rec/truth/joints.csv"))

    def _stranger(folder: Path, change: Callable = change) -> None:
        (folder / "result/run.toml").unlink()
        (folder / "result/pose.npz").unlink(missing_ok=True)
        table(change, "result/joints.csv")(folder)

    strange(EVALUATE, ANGLES, ("export", "result", "--to", "c3d"), named=f"joints of a stranger: {name}")(_stranger)


# ---- the process's surroundings


def environment(**values: str | None) -> Change:
    def do(_: Path) -> None:
        for key, value in values.items():
            os.environ.pop(key, None)
            if value is not None:
                os.environ[key] = value

    return do


def _closed(*descriptors: int) -> Change:
    def do(_: Path) -> None:
        for one in descriptors:
            os.close(one)
            setattr(sys, ("stdin", "stdout", "stderr")[one], None)  # as a process has it that was begun so

    return do


def _full_device(_: Path) -> None:
    os.dup2(os.open("/dev/full", os.O_WRONLY), 1)


def _broken_pipe(_: Path) -> None:
    read, write = os.pipe()
    os.close(read)
    os.dup2(write, 1)


def _limits(kind: int, value: int) -> Change:
    return lambda _: resource.setrlimit(kind, (value, value))


def _no_folder(folder: Path) -> None:
    os.mkdir(folder.parent / "in" / "gone")
    os.chdir(folder.parent / "in" / "gone")
    os.rmdir(folder.parent / "in" / "gone")


def _clock(step: Callable[[int], float]) -> Change:
    def do(_: Path) -> None:
        count, real = [0], time.time()

        def now() -> float:
            count[0] += 1
            return real + step(count[0])

        time.time = now
        time.monotonic = now
        time.perf_counter = now

    return do


def ascii_streams(_: Path) -> None:
    environment(LC_ALL="C", LANG="C", PYTHONIOENCODING="ascii", PYTHONUTF8="0")(_)
    sys.stdout.reconfigure(encoding="ascii", errors="strict")
    sys.stderr.reconfigure(encoding="ascii", errors="backslashreplace")


for name, before in {
    "locale C": ascii_streams,
    "no home, no temporary folder": environment(HOME=None, TMPDIR="/nowhere", XDG_CACHE_HOME="/dev/null"),
    "a terminal of one column": environment(COLUMNS="1", LINES="1", TERM="dumb"),
    "limits that are none": environment(HMC_MAX_IMAGE_MPIXEL="many", HMC_MAX_TABLE_MB="-1"),
    "no output": _closed(1),
    "nothing open": _closed(0, 1, 2),
    "output to a full device": _full_device,
    "output to nobody": _broken_pipe,
    "twelve files at once": _limits(resource.RLIMIT_NOFILE, 12),
    "files of 4 kB": _limits(resource.RLIMIT_FSIZE, 4096),
    "a clock that runs backwards": _clock(lambda k: -3600.0 * k),
    "a clock that leaps": _clock(lambda k: 1e6 * k),
}.items():
    strange(TRACK, EVALUATE, VIEW, named=name, before=before)(lambda _: None)
strange(
    ("check", "../rec"),
    ("track", "../rec", "--out", "../new", *QUICK),
    ("track", "rec", "--out", "new"),
    named="a folder that is gone",
    before=_no_folder,
)(lambda _: None)


@strange(CHECK, TRACK, POSE, EVALUATE, named="files of other times")
def _other_times(folder: Path) -> None:
    for k, file in enumerate(sorted((folder / "rec").rglob("*"))):
        if file.is_file():
            os.utime(file, ns=((-(10**18), 0, 4 * 10**18)[k % 3],) * 2)


@strange(CHECK, TRACK, POSE, EVALUATE, named="files that are only to be read")
def _read_only(folder: Path) -> None:
    for file in (folder / "rec").rglob("*"):
        file.chmod(0o444 if file.is_file() else 0o555)


@dataclass(frozen=True)
class Task:
    """What is strange, in which command."""

    names: tuple[str, ...]
    words: tuple[str, ...]


def tasks(pairs: int, seed: int) -> Iterator[Task]:
    """All single strange things, then pairs that are drawn."""
    rng, by_command = np.random.default_rng(seed), defaultdict[tuple[str, ...], list[str]](list)
    for name, one in STRANGE.items():
        for words in one.commands:
            by_command[words].append(name)
            yield Task((name,), words)
    several = [words for words, names in by_command.items() if len(names) > 8]
    for _ in range(pairs):
        words = several[int(rng.integers(len(several)))]
        one, other = rng.choice(len(by_command[words]), 2, replace=False)
        yield Task((by_command[words][one], by_command[words][other]), words)


FOLDERS = ("rec", "result", "trials", "session.toml", "settings.toml", "recipe.toml", "points.csv")


def run(base: Path, task: Task, number: int) -> Ending:
    """One of them; of a pair that cannot both be done to one recording, none."""
    with tempfile.TemporaryDirectory(prefix="strange-") as name:
        folder, what = _copied(base, Given(task.words, FOLDERS, ()), Path(name)), " + ".join(task.names)
        for one in task.names:
            try:
                STRANGE[one].change(folder)
            except (OSError, AssertionError, IndexError, ValueError) as error:
                if len(task.names) == 1:
                    raise
                return Ending("skipped", str(error), number, what, "", "", "", {}, frozenset())
        try:
            return judged(folder, task.words, number, what, "", [found for one in task.names if (found := STRANGE[one].before)])
        finally:
            for one in folder.rglob("*"):
                if one.is_dir() and not one.is_symlink():
                    one.chmod(0o755)


def main() -> None:
    """Count."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="pattern of names")
    parser.add_argument("--base", type=Path, help="where the miniature is made, and found again")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        base = build((args.base or Path(name) / "miniature").resolve())
        warm()
        counts, begun, whole = Counter[str](), time.monotonic(), dict[tuple[str, ...], Ending]()
        for number, task in enumerate(tasks(args.pairs, args.seed)):
            if not re.search(args.only, " + ".join(task.names)):
                continue
            if task.words not in whole:
                whole[task.words] = run(base, Task((), task.words), -1)
            one = run(base, task, number)
            if one.kind == "ok" and one.tables != whole[task.words].tables and one.said <= whole[task.words].said:
                one = replace(one, kind="silent")
            counts[one.kind] += 1
            same = "" if one.tables == whole[task.words].tables else "; other tables"
            new = " | ".join(sorted(one.said - whole[task.words].said))[:700] if one.kind == "ok" else one.text.strip()[-1500:]
            print(f"{one.kind} [{' + '.join(task.names)}] {' '.join(one.words.split()[:6])!r} ({one.why}{same}): {new}", flush=True)
        print(f"{sum(counts.values())} commands in {time.monotonic() - begun:.0f} s: {dict(counts)}")


if __name__ == "__main__":
    main()
