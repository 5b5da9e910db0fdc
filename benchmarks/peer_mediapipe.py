"""MediaPipe Pose over some videos, one after the other, in an environment of its own: prints frames and seconds. hmc is not imported.

    ENVIRONMENT/bin/python benchmarks/peer_mediapipe.py N VIDEO ...

It is what many take otherwise. Images alone: no triangulation, no filter, one person. Of versions before 0.10.22, which bring
their model with them; model_complexity 1 ("full"), tracking from frame to frame, as it comes.
"""

import sys
import time

import cv2
import mediapipe

frames = int(sys.argv[1])
begun, count = time.perf_counter(), 0
for path in sys.argv[2:]:
    video = cv2.VideoCapture(path)
    with mediapipe.solutions.pose.Pose() as pose:
        for _ in range(frames):
            there, image = video.read()
            if not there:
                break
            pose.process(cv2.cvtColor(image, cv2.COLOR_BGR2RGB))
            count += 1
print(count, time.perf_counter() - begun)
