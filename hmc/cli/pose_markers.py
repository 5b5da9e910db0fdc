"""``hmc pose`` on markers: detections from a table, or from the images by the markers' color."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hmc.cli.common import progress
from hmc.io.files import real_path

__all__ = ["MARKERS_JOURNAL", "Markers", "add_marker_options", "read_markers", "refuse_markers"]

#: Found in the recording's folder where no option says otherwise.
DETECTIONS, LABELS = Path("markers/detections.csv"), Path("markers/labels.csv")
#: Detections of a run that is not finished.
MARKERS_JOURNAL = ".markers.journal"
#: Frames of the empty scene of which the median is taken.
BACKGROUND_FRAMES = 15


def add_marker_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this method."""
    group = parser.add_argument_group("with --method marker-apf")
    group.add_argument(
        "--detections",
        type=Path,
        metavar="FILE",
        help="2-D detections (frame, camera, u, v); default: markers/detections.csv of the recording",
    )
    group.add_argument(
        "--labels",
        type=Path,
        metavar="FILE",
        help="points on markers in some images (frame, camera, u, v), of which the markers' color is learnt to detect them in all "
        "images; default: markers/labels.csv of the recording",
    )
    group.add_argument(
        "--markers", choices=("skin", "joints"), default="skin", help="where detections lie: on the skin (default), or at the joint centres"
    )


@dataclass(frozen=True)
class Markers:
    """Where a run has its detections from.

    Parameters
    ----------
    recording : Recording
    used : Path
        The file of detections, or that of labelled points.
    ready : bool
        It is one of detections.
    markers : str
        Where they lie.
    """

    recording: Any
    used: Path
    ready: bool
    markers: str

    @property
    def parameters(self) -> dict[str, Any]:
        """What a run depends on."""
        from hmc.camera.marker_color import MarkerColorSettings

        where = {"detections": real_path(self.used)} if self.ready else {"labels": real_path(self.used), "color": MarkerColorSettings()}
        return {"markers": self.markers, **where}

    @property
    def source(self) -> dict[str, str]:
        """When the file last changed."""
        return {"markers_changed": str(self.used.stat().st_mtime_ns)}

    def table(self, args: argparse.Namespace, key: str, problems: list[str]):
        """The detections of the recording's selection; learnt and looked for in the images where there are only labels."""
        from hmc.camera.marker_color import MarkerColorSettings
        from hmc.errors import InputError
        from hmc.io.detections import write_detections

        if self.ready:
            table = _read(self.used, self.recording)
        else:
            table = _detect(args, self.recording, self.used, MarkerColorSettings(), args.out / MARKERS_JOURNAL, key, problems)
            write_detections(args.out / "detections.csv", table)
            # What was written is what is used, so that with --detections the file leads to the same poses.
            table = _read(args.out / "detections.csv", self.recording)
        if not len(table.frames):
            raise InputError(f"{self.used}: no marker in these frames; check the labelled points or the detections")
        return table

    def refuse_nothing(self, people) -> None:
        """Raise an InputError where no frame has a pose."""
        from hmc.errors import InputError

        if "fitted" not in people.status:
            raise InputError(
                f"{self.used}: in no frame do enough markers appear in enough views at places that agree; check the detections and the "
                "calibration"
            )


def refuse_markers(args: argparse.Namespace) -> None:
    """Raise an InputError where a method that looks at no markers is given a file of them."""
    from hmc.errors import InputError

    for option, given in (("--detections", args.detections), ("--labels", args.labels)):
        if given is not None:
            raise InputError(f"{option} is of --method marker-apf: give that too, or take it out")


def read_markers(args: argparse.Namespace, recording) -> Markers:
    """Where the options, or the recording's folder, have markers."""
    return Markers(recording, *_source(args, recording), args.markers)


def _source(args: argparse.Namespace, recording) -> tuple[Path, bool]:
    """The file of detections, or that of labelled points, and which of the two it is."""
    from hmc.errors import InputError

    if args.detections and args.labels:
        raise InputError("--detections and --labels: give one of them; with detections no color is learnt")
    for name, given in (("--detections", args.detections), ("--labels", args.labels)):
        if given and not given.is_file():
            raise InputError(f"{name} {given}: no such file")
        if given:
            return given, name == "--detections"
    for path in (DETECTIONS, LABELS):
        if (recording.path / path).is_file():
            return recording.path / path, path == DETECTIONS
    raise InputError(
        f"{recording.path}: has neither {DETECTIONS} nor {LABELS}; give --detections FILE (where markers were seen), or --labels FILE "
        "(some points on markers, to learn their color from): tables with the columns frame,camera,u,v"
    )


def _read(path: Path, recording):
    """The detections of the recording's selection."""
    from hmc.io.detections import DetectionTable, read_detections
    from hmc.io.places import places_of

    table = read_detections(path, [entry.name for entry in places_of(recording).read_entries()])
    chosen = (table.frames >= recording.start) & (table.frames < recording.start + recording.n_frames)
    return DetectionTable(table.frames[chosen], table.cameras[chosen], table.uv[chosen])


def _detect(args: argparse.Namespace, recording, labels: Path, settings, journal: Path, key: str, problems: list[str]):
    """Learn the color and detect in every image; what is done is kept in the journal."""
    import numpy as np

    from hmc.camera.marker_color import detect_markers, learn_marker_color
    from hmc.errors import InputError
    from hmc.io.detections import DetectionTable, read_detections
    from hmc.io.journal import append_journal, open_journal
    from hmc.io.recording import background_frames, iterate_frames, whole_recording

    whole = whole_recording(recording)
    points = read_detections(labels, whole.rig.names)
    samples = []
    for frame in np.unique(points.frames).tolist():
        if not 0 <= frame < whole.n_frames:
            raise InputError(f"{labels}: frame {frame} is not in the recording, which has {whole.n_frames} frames")
        (images,) = (one.images for one in iterate_frames(whole, first=frame, last=frame + 1))
        samples += [(image, uv) for image, uv in zip(images, points.in_frame(frame, whole.rig.names), strict=True) if image is not None]
    color = learn_marker_color(samples, settings)
    empty = []
    for camera in range(len(recording.rig)):
        without = list(background_frames(recording, camera, limit=BACKGROUND_FRAMES))
        empty.append(np.median(np.stack(without), axis=0).astype(np.uint8) if without else None)
    records = open_journal(journal, key, problems.append)
    first = recording.start + len(records)
    steps = iterate_frames(recording, first=first, on_problem=problems.append) if first < recording.start + recording.n_frames else iter(())
    for frame in progress(steps, recording.start + recording.n_frames - first, "markers", args.quiet):
        found = [
            np.zeros((0, 2)) if image is None else detect_markers(image, color, settings, back)
            for image, back in zip(frame.images, empty, strict=True)
        ]
        records.append({"frame": frame.index, "uv": [uv.tolist() for uv in found]})
        append_journal(journal, records[-1])
    rows = [(one["frame"], name, u, v) for one in records for name, uv in zip(recording.rig.names, one["uv"], strict=True) for u, v in uv]
    frames, cameras, u, v = zip(*rows, strict=True) if rows else ((), (), (), ())
    return DetectionTable(np.array(frames, int), np.array(cameras, str), np.array([u, v], float).T.reshape(-1, 2))
