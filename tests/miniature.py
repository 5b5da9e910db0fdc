# ruff: noqa: E501
"""A recording, results, journals and settings so small that every command takes little: what is broken at random."""

from __future__ import annotations

import json
import os
import shutil
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from hmc.camera.model import project
from hmc.cli import main
from hmc.io.calibration import read_calibration

RECIPE = """name = "mini"
seed = 3
fps = 15
seconds = 0.27
background_frames = 3
silhouette_every = 1
[rig]
kind = "corners4"
size_px = [80, 60]
distorted = false
[room]
size_m = [4.2, 4.0, 2.6]
[[actor]]
height_m = 1.76
motion = "walk"
speed_m_s = 1.15
start_m = [-0.3, 0.1]
heading_deg = 5
"""
SETTINGS = "[annealed]\nlayers = 2\nparticles = 20\n"
#: Of the default preset, with which a start alone takes seconds.
CHEAP = """coarse_samples = 40
hull_points = 40
surface_samples = 40
fine_hull_points = 50
[annealed]
layers = 2
particles = 10
[refine]
iterations = 2
[search]
draws = 20
at_once = 1
[fit_body]
iterations = 1
"""
SESSION = """calibration = "rec/calibration.toml"
background = "rec/background"
trials = "trials/*"
[recording]
fps = 15.0
persons = 1
[pose]
method = "apf"
preset = "canton2009"
voxel = 0.1
track-voxel = 0.1
passes = 1
settings = "settings.toml"
"""


@dataclass(frozen=True)
class Given:
    """A command, which folders of the miniature it is given, which of their files may be broken, and how often it is taken in a round of all
    commands."""

    words: tuple[str, ...]
    folders: tuple[str, ...]
    broken: tuple[str, ...]
    often: int = 1


REC = ("rec/calibration.toml", "rec/recording.toml", "rec/videos/*", "rec/images/*/*", "rec/background/*", "rec/background/*/*", "rec/silhouettes/*/*",
       "rec/keypoints/*", "rec/keypoints/*/*", "rec/times/*")  # fmt: skip
TRUTH = ("rec/truth/*",)
RESULT = ("result/*.csv", "result/pose.npz", "result/run.toml")
QUICK = ("--quiet", "--workers", "1")
VOXELS = ("--voxel", "0.1", "--track-voxel", "0.1", "--passes", "1")
COARSE = (*VOXELS, "--preset", "canton2009", "--settings", "settings.toml", *QUICK)
FULL = (*VOXELS, "--settings", "cheap.toml", *QUICK)
FORMATS = (
    "opencv_yml",
    "opencv_xml",
    "opencv_json",
    "easymocap",
    "panoptic",
    "projections",
    "cal",
    "qualisys",
    "vicon",
    "optitrack",
    "caliscope",
)

COMMANDS = [
    Given(("check", "rec", "--out", "check.png"), ("rec",), REC, 3),
    Given(("world", "rec", "--out", "world.png", "--dry-run"), ("rec",), REC, 1),
    Given(("world", "rec", "--out", "world.png", "--points", "points.csv"), ("rec", "points.csv"), ("points.csv", "points.csv", "rec/calibration.toml"), 1),
    Given(("sync", "rec", "--out", "sync.png", "--dry-run"), ("rec",), REC, 1),
    Given(("track", "rec", "--out", "new", "--voxel", "0.1", *QUICK), ("rec",), REC, 3),
    Given(("track", "rec", "--out", "new", "--cues", "keypoints", *QUICK), ("rec",), REC, 1),
    Given(("pose", "rec", "--out", "new", *COARSE), ("rec", "settings.toml"), (*REC, *("settings.toml",) * 4), 2),
    Given(("pose", "rec", "--out", "new", *FULL), ("rec", "cheap.toml"), (*REC, *("cheap.toml",) * 4), 1),
    Given(("pose", "rec", "--out", "new", "--cues", "keypoints", "--quiet"), ("rec",), REC, 1),
    Given(("pose", "rec", "--out", "new", "--tracks", "result/tracks.csv", *COARSE), ("rec", "result", "settings.toml"), ("result/tracks.csv",), 1),
    Given(("pose", "rec", "--out", "new", "--like", "result/run.toml", *QUICK), ("rec", "result", "settings.toml"), ("result/run.toml",), 1),
    Given(("pose", "rec", "--out", "result", *COARSE), ("rec", "result", "settings.toml"), RESULT, 1),
    Given(("track", "rec", "--out", "stopped_track", "--voxel", "0.1", *QUICK), ("rec", "stopped_track"), ("stopped_track/.*",), 3),
    Given(("pose", "rec", "--out", "stopped_pose", *COARSE), ("rec", "settings.toml", "stopped_pose"), ("stopped_pose/.*",), 2),
    Given(("evaluate", "result", "rec", "--angles", "--offsets", "--images", "--threshold", "auto"), ("rec", "result"), (*RESULT, *TRUTH, "rec/calibration.toml"), 5),
    Given(("view", "result", "rec", "--out", "v.png", "--no-voxels"), ("rec", "result"), (*RESULT, *REC), 2),
    Given(("view", "result", "rec", "--out", "v.html", "--quiet"), ("rec", "result"), (*RESULT, *REC), 1),
    *(Given(("export", "result", "--to", kind), ("result",), RESULT, 1) for kind in ("trc", "c3d", "bvh", "mot", "glb", "csv")),
    Given(("angles", "result"), ("result",), RESULT, 1),
    Given(("cite", "result"), ("result",), ("result/run.toml",), 1),
    Given(("run", "session.toml", "--out", "all", "--quiet", "--workers", "1"), ("rec", "trials", "session.toml", "settings.toml"), (*("session.toml",) * 3, "settings.toml", *REC, "trials/*/*/*"), 1),
    Given(("synth", "recipe.toml", "--out", "new", *QUICK), ("recipe.toml",), ("recipe.toml",), 2),
    Given(("experiments", "status", "--out", "experiments", "fig-3.3"), ("experiments",), ("experiments/**/*",), 1),
    Given(("experiments", "run", "fig-3.3", "--quick", "--quiet", "--workers", "1", "--out", "experiments"), ("experiments",), ("experiments/**/*",), 1),
    Given(("experiments", "report", "--out", "experiments"), ("experiments",), ("experiments/**/*",), 1),
    *(Given(("check", f"formats/{name}", "--out", "check.png"), (f"formats/{name}",), (f"formats/{name}/*.*",), 1) for name in FORMATS),
]  # fmt: skip


def build(folder: Path) -> Path:
    """Make the miniature; a folder where it was made before is left as it is."""
    if (folder / "whole").exists():
        return folder
    folder.mkdir(parents=True, exist_ok=True)
    here = Path.cwd()
    os.chdir(folder)
    try:
        for name, text in (
            ("recipe.toml", RECIPE),
            ("settings.toml", SETTINGS),
            ("cheap.toml", CHEAP),
            ("session.toml", SESSION),
        ):
            Path(name).write_text(text)
        _run("synth", "recipe.toml", "--out", "rec", *QUICK)
        _recording(Path("rec"))
        _floor_points(Path("points.csv"))
        for kind in FORMATS:
            _format(kind)
        for name in ("one", "two"):
            shutil.copytree("rec/videos", f"trials/{name}/videos")
            shutil.copytree("rec/images", f"trials/{name}/images")
        _run("pose", "rec", "--out", "result", *COARSE)
        _stopped("hmc.io.results.write_tracks", "track", "rec", "--out", "stopped_track", "--voxel", "0.1", *QUICK)
        _stopped("hmc.pose.chain.with_trust", "pose", "rec", "--out", "stopped_pose", *COARSE)
        _run("experiments", "run", "fig-3.3", "--quick", "--quiet", "--workers", "1", "--out", "experiments")
        Path("whole").write_text("")
    finally:
        os.chdir(here)
    return folder


def call(words: tuple[str, ...]) -> int:
    """A command of either program; its exit code."""
    if words[0] != "experiments":
        return main(words)
    from hmc.experiments.__main__ import main as experiments

    return experiments(words[1:])


def _run(*words: str) -> None:
    assert call(words) == 0, words


def _stopped(where: str, *words: str) -> None:
    """A command that is stopped where it calls a function."""
    from unittest import mock

    with mock.patch(where, side_effect=SystemExit), suppress(SystemExit):
        call(words)
        raise AssertionError("was not stopped")


def _recording(folder: Path) -> None:
    """Two cameras as images; keypoints in three forms, and times."""
    names = read_calibration(folder).names
    for name in names[2:]:
        for kind, video in (("images", folder / "videos" / f"{name}.mp4"), ("background", folder / "background" / f"{name}.mp4")):
            capture, target = cv2.VideoCapture(str(video)), folder / kind / name
            target.mkdir(parents=True)
            for k in range(100):
                there, image = capture.read()
                if not there:
                    break
                cv2.imwrite(str(target / f"{k:06d}.png"), image)
            capture.release()
            video.unlink()
    rng = np.random.default_rng(0)
    people = [[[*rng.uniform(10, 50, 2).round(2).tolist(), 0.9] for _ in range(25)] for _ in range(4)]
    (folder / "keypoints" / names[0]).mkdir(parents=True)
    for k, points in enumerate(people):
        flat = [value for point in points for value in point]
        (folder / "keypoints" / names[0] / f"{names[0]}_{k:012d}_keypoints.json").write_text(
            json.dumps({"people": [{"pose_keypoints_2d": flat}]})
        )
    frames = [{"frame": k, "people": [{"keypoints": points[:17]}]} for k, points in enumerate(people)]
    (folder / "keypoints" / f"{names[1]}.json").write_text(json.dumps({"frames": frames}))
    lines = [
        f"{k},0,{name},{x},{y},{c}"
        for k, points in enumerate(people)
        for name, (x, y, c) in zip(("nose", "left_hip", "right_hip", "left_knee"), points, strict=False)
    ]
    (folder / "keypoints" / f"{names[2]}.csv").write_text("\n".join(["frame,person,keypoint,x,y,confidence", *lines]) + "\n")
    (folder / "times").mkdir()
    for name in names:
        (folder / "times" / f"{name}.csv").write_text("frame,time_s\n" + "".join(f"{k},{k / 15:.4f}\n" for k in range(4)))


def _floor_points(path: Path) -> None:
    """Four points of the floor, marked in every image."""
    rows = ["point,camera,u,v,x,y,z"]
    for camera in read_calibration("rec"):
        for k, point in enumerate(((-0.5, -0.5, 0.0), (0.5, -0.5, 0.0), (0.5, 0.5, 0.0), (-0.5, 0.5, 0.0))):
            u, v = project(camera, np.array(point))[0].round(2).tolist()
            rows.append(f"{k},{camera.name},{u},{v},{point[0]},{point[1]},{point[2]}")
    path.write_text("\n".join(rows) + "\n")


def _format(kind: str) -> None:
    """The recording's cameras in another format, with images of two frames."""
    folder, rig = Path("formats") / kind, read_calibration("rec")
    for camera in rig:
        (folder / "images" / camera.name).mkdir(parents=True)
        for k in range(2):
            cv2.imwrite(str(folder / "images" / camera.name / f"{k:06d}.png"), np.full((60, 80, 3), 60, np.uint8))
    if kind in ("opencv_yml", "opencv_xml", "opencv_json"):
        for camera in rig:
            storage = cv2.FileStorage(str(folder / f"{camera.name}.{kind[7:]}"), cv2.FILE_STORAGE_WRITE)
            for name, value in (
                ("camera_matrix", camera.matrix),
                ("distortion_coefficients", camera.distortions),
                ("rvec", cv2.Rodrigues(np.array(camera.rotation))[0]),
            ):
                storage.write(name, np.array(value))
            storage.write("tvec", np.array(camera.translation))
            storage.write("image_width", 80)
            storage.write("image_height", 60)
            storage.release()
        if kind == "opencv_json":
            for camera in rig:
                (folder / f"{camera.name}.json").rename(folder / f"{camera.name.replace('cam', 'cam')}.json")
    elif kind == "easymocap":
        for file, values in (("intri.yml", lambda c: {f"K_{c.name}": c.matrix, f"dist_{c.name}": c.distortions[None]}),
                             ("extri.yml", lambda c: {f"R_{c.name}": cv2.Rodrigues(np.array(c.rotation))[0], f"T_{c.name}": c.translation[:, None]})):  # fmt: skip
            storage = cv2.FileStorage(str(folder / file), cv2.FILE_STORAGE_WRITE)
            storage.startWriteStruct("names", cv2.FILE_NODE_SEQ)
            for camera in rig:
                storage.write("", camera.name)
            storage.endWriteStruct()
            for camera in rig:
                for name, value in values(camera).items():
                    storage.write(name, np.array(value))
            storage.release()
    elif kind == "panoptic":
        cameras = [{"name": c.name, "resolution": [80, 60], "K": c.matrix.tolist(), "distCoef": c.distortions.tolist(), "R": c.rotation.tolist(), "t": (c.translation[:, None] * 100).tolist()} for c in rig]  # fmt: skip
        (folder / "calibration.json").write_text(json.dumps({"cameras": cameras}, indent=1))
        (folder / "recording.toml").write_text('units = "cm"\n')
    elif kind == "projections":
        (folder / "projections.csv").write_text(
            "".join(f"{c.name}," + ",".join(map(repr, c.projection.ravel().tolist())) + "\n" for c in rig)
        )
    elif kind == "cal":
        for c in rig:
            values = [
                c.matrix[0, 0],
                c.matrix[1, 1],
                c.matrix[0, 2],
                c.matrix[1, 2],
                0,
                *c.distortions,
                *c.rotation.ravel(),
                *(c.translation * 1000),
            ]
            (folder / f"{c.name}.cal").write_text("\n".join(f"{float(value):.6f}" for value in values) + "\n")
    elif kind == "qualisys":
        blocks = [_theia(c) for c in rig]
        (folder / "rig.qca.txt").write_text("<calibration>\n" + "\n".join(blocks) + "\n</calibration>\n")
    elif kind == "vicon":
        cameras = [
            f'<Camera DEVICEID="{c.name}" TYPE="Vue_VIDEO" SENSOR_SIZE="80 60">\n<KeyFrames>\n<KeyFrame FOCAL_LENGTH="70" ORIENTATION="0 0 0 1"\n '
            'POSITION="1 2 3" PRINCIPAL_POINT="40 30" VICON_RADIAL2="Vicon3Parameter 40 30 1e-8 0 0"/>\n</KeyFrames>\n</Camera>' for c in rig
        ]  # fmt: skip
        (folder / "rig.xcp").write_text("<Cameras>\n" + "\n".join(cameras) + "\n</Cameras>\n")
    elif kind == "optitrack":
        cameras = [
            f'<Camera Serial="{c.name}">\n<Attributes ImagerPixelWidth="80" ImagerPixelHeight="60"/>\n<IntrinsicStandardCameraModel LensCenterX="40" LensCenterY="30" '
            'HorizontalFocalLength="70" VerticalFocalLength="70"\n k1="0" k2="0" k3="0" TangentialX="0" TangentialY="0"/>\n<Extrinsic X="1" Y="2" Z="3" '
            + " ".join(f'OrientMatrix{i}="{int(i in (0, 4, 8))}"' for i in range(9)) + "/>\n</Camera>" for c in rig
        ]  # fmt: skip
        (folder / "rig.mcal").write_text("<calibrationProfile>\n" + "\n".join(cameras) + "\n</calibrationProfile>\n")
    else:
        text = Path("rec/calibration.toml").read_text()
        (folder / "camera_array.toml").write_text(text.replace("[cam_", "[cameras.cam_"))


def _theia(c) -> str:
    rows = (
        " ".join(f'r{i + 1}{j + 1}="{c.rotation[i, j]!r}"' for i in range(3) for j in range(3)).replace("np.float64(", "").replace(")", "")
    )
    x, y, z = (c.translation * 1000).tolist()
    return (
        f'<camera serial="{c.name}">\n<transform x="{x}" y="{y}" z="{z}"\n {rows}/>\n<intrinsic sensorMinU="0" sensorMinV="0" sensorMaxU="80" sensorMaxV="60"\n '
        f'focalLengthU="{float(c.matrix[0, 0])}" focalLengthV="{float(c.matrix[1, 1])}" centerPointU="{float(c.matrix[0, 2])}" centerPointV="{float(c.matrix[1, 2])}"\n '
        'radialDistortion1="0" radialDistortion2="0" tangentalDistortion1="0" tangentalDistortion2="0"/>\n</camera>'
    )
