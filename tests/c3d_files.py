"""C3D files as the specification has them: header, parameters, frames of points and of analogue channels."""

import struct

import numpy as np

INTEL, DEC, MIPS = 84, 85, 86
BLOCK = 512


def write_c3d(path, labels, points, rate, processor=INTEL, scale=-1.0, missing=None, n_analog=0, units="mm", header=None, trial=None):
    """Points (n_frames, n_points, 3) in `units`; with a positive scale as integers of that many units.

    `header` and `trial` are the first and last frame by either, from 1; by default all frames, and no group TRIAL.
    """
    n_frames, n_points = points.shape[:2]
    order = ">" if processor == MIPS else "<"

    def floats(values):
        values = np.asarray(values, float)
        if processor != DEC:
            return values.astype(f"{order}f4").tobytes()
        halves = (values * 4).astype("<f4").view("<u2").reshape(-1, 2)
        return np.ascontiguousarray(halves[:, ::-1]).tobytes()

    def record(number, name, content):
        return struct.pack("2b", len(name), number) + name.encode() + struct.pack(f"{order}h", 2 + len(content)) + content

    def texts(values):
        width = max(map(len, values))
        return struct.pack("b3B", -1, 2, width, len(values)) + "".join(value.ljust(width) for value in values).encode() + b"\0"

    number = struct.pack("bB", 4, 0)
    records = [
        record(-1, "POINT", b"\0"),
        record(1, "USED", struct.pack("bB", 2, 0) + struct.pack(f"{order}h", n_points) + b"\0"),
        record(1, "SCALE", number + floats([scale]) + b"\0"),
        record(1, "RATE", number + floats([rate]) + b"\0"),
        record(1, "UNITS", struct.pack("b2B", -1, 1, len(units)) + units.encode() + b"\0"),
        record(1, "LABELS", texts(labels)),
    ]
    if trial is not None:
        words = [struct.pack("bBB", 2, 1, 2) + struct.pack(f"{order}2H", one % 65536, one // 65536) + b"\0" for one in trial]
        records += [record(-2, "TRIAL", b"\0"), record(2, "ACTUAL_START_FIELD", words[0]), record(2, "ACTUAL_END_FIELD", words[1])]
    parameters = b"".join(records) + b"\0\0"
    n_blocks = -(-(4 + len(parameters)) // BLOCK)
    start = 2 + n_blocks
    header = bytes([2, 0x50]) + struct.pack(f"{order}5H", n_points, n_analog, *(header or (1, n_frames)), 0) + floats([scale])
    header += struct.pack(f"{order}2H", start, 1) + floats([rate])
    section = bytes([1, 0x50, n_blocks, processor]) + parameters

    lost = np.zeros((n_frames, n_points), bool) if missing is None else missing
    frames = np.zeros((n_frames, 4 * n_points + n_analog))
    frames[:, : 4 * n_points] = np.concatenate([points / abs(scale), np.where(lost, -1.0, 0.0)[..., None]], -1).reshape(n_frames, -1)
    data = np.round(frames).astype(f"{order}i2").tobytes() if scale > 0 else floats(frames.ravel())
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(header.ljust(BLOCK, b"\0") + section.ljust(n_blocks * BLOCK, b"\0") + data.ljust(BLOCK, b"\0"))
