"""People live: a recording's videos at their own speed, or webcams, through a session; tells who is there, and how many frames it dropped.

    python docs/live.py out/demo --fps 5
    python docs/live.py my_rig --webcams 0 1 2 3 --fps 5 --picture out/live.jpg

For webcams the folder has the calibration, in the devices' order, and the room has to be empty for the first two seconds.
"""

import argparse
import time
from itertools import chain, islice
from pathlib import Path

import cv2
import numpy as np

import hmc
from hmc.io.calibration import read_calibration
from hmc.io.recording import background_frames, iterate_frames
from hmc.landmarks import landmark_index
from hmc.view.overlay import draw_label, draw_sticks

HEAD, EMPTY_FRAMES = landmark_index("head_top"), 60


def played(recording, speed):
    """The frames of a recording, each at its time."""
    begun = time.monotonic()
    for frame in iterate_frames(recording):
        time.sleep(max(0.0, begun + (frame.index - recording.start) / (recording.fps * speed) - time.monotonic()))
        yield frame.images


def filmed(devices):
    """The frames of webcams: taken of all as near to one moment as may be, then decoded; None of one that has none."""
    captures = [cv2.VideoCapture(device) for device in devices]
    while True:
        grabbed = [capture.grab() for capture in captures]
        yield [capture.retrieve()[1] if there else None for capture, there in zip(captures, grabbed, strict=True)]


def draw(path, camera, image, found):
    """One camera's image with everybody in it."""
    picture = np.zeros((*camera.size[::-1], 3), np.uint8) if image is None else image.copy()
    for number, person in found.people.items():
        if person.latest is not None:
            draw_sticks(picture, camera, person.latest, number)
    draw_label(picture, f"frame {found.index}: {len(found.people)} there", (8, 20))
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), picture)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recording", type=Path)
    parser.add_argument("--cameras", type=lambda text: text.split(","), metavar="A,B,...", help="those of the recording (default: all)")
    parser.add_argument("--fps", type=float, help="steps a second; fewer than can be kept up with (default: the cameras')")
    parser.add_argument("--wait", type=float, default=4.0, help="seconds that frames may wait while a first pose is found")
    parser.add_argument("--speed", type=float, default=1.0, help="of playing; 1 is real")
    parser.add_argument("--repeat", type=int, default=1, help="play the recording so many times")
    parser.add_argument("--voxel", type=float, default=0.03, help="metres; 0.05 is quicker")
    parser.add_argument("--webcams", type=int, nargs="+", help="devices in place of the videos")
    parser.add_argument("--picture", type=Path, help="draw the newest frame of the first camera into this file")
    args = parser.parse_args()

    if args.webcams:
        rig, source, fps, room, persons = read_calibration(args.recording), filmed(args.webcams), 30.0, None, None
        background = [[image for image in images if image is not None] for images in zip(*islice(source, EMPTY_FRAMES), strict=True)]
    else:
        recording = hmc.open_recording(args.recording, cameras=args.cameras)
        rig, fps, room, persons = recording.rig, recording.fps, recording.room, recording.persons
        background = [background_frames(recording, camera) for camera in range(len(rig))]
        source = chain.from_iterable(played(recording, args.speed) for _ in range(args.repeat))
    session = hmc.Session(rig, background, args.fps or fps, room, persons=persons, voxel_size_m=args.voxel)
    print(f"first pose {session.first_delay_s:.1f} s after a person is there; from then on poses are {session.delay_s:.1f} s old at most")

    delays, worked = [], [time.process_time()]

    def show(found, images):
        worked.append(time.process_time())
        delays.extend(found.index - person.decided_frame for person in found.people.values() if person.decided_frame is not None)
        for number, person in found.people.items():
            x, y, _ = person.position
            head = "" if person.latest is None else f", head at {person.latest[HEAD, 2]:.2f} m"
            decided = "" if person.decided_frame is None else f"; decided up to frame {person.decided_frame}"
            print(f"frame {found.index}: person {number} at ({x:.2f}, {y:.2f}) m{head}{decided}")
        if args.picture is not None:
            draw(args.picture, rig[0], images[0], found)

    begun = time.monotonic()
    done = hmc.live(session, source, show, args.wait)
    print(f"{done.steps} steps, {done.steps / (time.monotonic() - begun):.1f} a second")
    if done.steps:
        each = np.diff(worked)
        print(f"a step takes {np.median(each):.2f} s of one processor on the median, {each.max():.1f} s at most")
    decided = f"poses {max(delays) / session.fps:.1f} s old at most" if delays else "no pose was decided"
    print(f"{done.dropped} frames dropped, {done.between} left out between steps; {decided}")


if __name__ == "__main__":
    main()
