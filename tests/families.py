# ruff: noqa: E501
"""Ways in which a file can be broken: each takes a random generator and a path, and leaves something else there."""

from __future__ import annotations

import os
import re
import shutil
import socket
import struct
import zipfile
import zlib
from pathlib import Path

NUMBER = re.compile(rb"(?<![\w.])-?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?(?![\w.])")
STRANGE_NUMBERS = (b"nan", b"inf", b"-inf", b"-1", b"0", b"1e308", b"-1e308", b"99999999999999999999", b"1e999", b"9" * 5000, b'""', b"null", b"true", b"[]",
                   b"4294967296", b"1e-320", b"2147483648", b"{}", b"0.5", b"400000000")  # fmt: skip
TEXTS = {".toml", ".csv", ".json", ".yml", ".xml", ".cal", ".txt", ".xcp", ".mcal", ".journal", ".bvh", ".py"}
DEEP = 100_000


def is_text(path: Path) -> bool:
    """Whether text is in it; families of lines and numbers take others byte by byte."""
    return path.suffix in TEXTS


def flip_bytes(rng, path):
    data = bytearray(path.read_bytes())
    for _ in range(int(rng.integers(1, 9))):
        if data:
            data[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
    path.write_bytes(data)


def drop_bytes(rng, path):
    data = path.read_bytes()
    a, b = sorted(int(k) for k in rng.integers(0, len(data) + 1, 2))
    path.write_bytes(data[:a] + data[b:])


def truncated(rng, path):
    data = path.read_bytes()
    path.write_bytes(data[: int(rng.integers(len(data) + 1))])


def random_bytes(rng, path):
    data, n = path.read_bytes(), int(rng.integers(1, 200))
    at = int(rng.integers(len(data) + 1))
    path.write_bytes(data[:at] + rng.bytes(n) + data[at + n :])


def of_lines(change):
    def family(rng, path):
        lines = path.read_bytes().splitlines(keepends=True)
        if not is_text(path) or not lines:
            return drop_bytes(rng, path)
        return path.write_bytes(b"".join(change(rng, lines)))

    return family


def _dropped(rng, lines):
    k = int(rng.integers(len(lines)))
    return lines[:k] + lines[k + 1 :]


def _doubled(rng, lines):
    k = int(rng.integers(len(lines)))
    return lines[: k + 1] + lines[k:]


def _swapped(rng, lines):
    a, b = (int(k) for k in rng.integers(0, len(lines), 2))
    lines[a], lines[b] = lines[b], lines[a]
    return lines


def _cut_line(rng, lines):
    k = int(rng.integers(len(lines)))
    lines[k] = lines[k][: int(rng.integers(len(lines[k]) + 1))]
    return lines


def _replace_number(rng, path, by):
    data = path.read_bytes()
    found = list(NUMBER.finditer(data)) if is_text(path) else []
    if not found:
        return flip_bytes(rng, path)
    one = found[int(rng.integers(len(found)))]
    return path.write_bytes(data[: one.start()] + by(rng, one[0]) + data[one.end() :])


def digit(rng, path):
    def by(rng, text):
        k = int(rng.integers(len(text)))
        return text[:k] + str(int(rng.integers(10))).encode() + text[k + 1 :]

    _replace_number(rng, path, by)


def strange_number(rng, path):
    _replace_number(rng, path, lambda rng, text: STRANGE_NUMBERS[int(rng.integers(len(STRANGE_NUMBERS)))])


def removed_value(rng, path):
    _replace_number(rng, path, lambda rng, text: b"")


def text_for_number(rng, path):
    _replace_number(rng, path, lambda rng, text: b'"a"')


def empty(rng, path):
    path.write_bytes(b"")


def other_encoding(rng, path):
    data = path.read_bytes()
    codec = ("utf-16", "utf-16-be", "utf-32", "utf-7", "latin-1")[int(rng.integers(5))]
    path.write_bytes(("\u00e9" + data.decode("latin-1") if codec == "latin-1" else data.decode("latin-1")).encode(codec))


def other_type(rng, path):
    kinds = (b"\x89PNG\r\n\x1a\n" + rng.bytes(64), b"PK\x03\x04" + rng.bytes(64), b"%PDF-1.4\n" + rng.bytes(64), b"<html><body>404</body></html>", b"{}", b"[]",
             b"a = 1\n", b"a,b\n1,2\n", b"\xff\xd8\xff\xe0" + rng.bytes(64), b"null", b"%YAML:1.0\n---\na: 1\n", b"\0" * 4096)  # fmt: skip
    path.write_bytes(kinds[int(rng.integers(len(kinds)))])


def directory(rng, path):
    path.unlink()
    path.mkdir()


def missing(rng, path):
    path.unlink()


def no_permission(rng, path):
    """Of no use to who may do anything; then a link to nowhere is as good."""
    if os.geteuid():
        path.chmod(0)
    else:
        path.unlink()
        path.symlink_to("/nowhere/at/all")


def fifo(rng, path):
    path.unlink()
    if rng.integers(2):
        os.mkfifo(path)
    else:
        here = os.getcwd()
        os.chdir(path.parent)  # a socket's path must be short
        with socket.socket(socket.AF_UNIX) as one:
            one.bind(path.name)
        os.chdir(here)


def link_loop(rng, path):
    path.unlink()
    path.symlink_to(path.name)


def device(rng, path):
    path.unlink()
    path.symlink_to(("/dev/zero", "/dev/null", "/dev/full")[int(rng.integers(3))])


def deep_nesting(rng, path):
    kind, n = path.suffix, (DEEP, 2000)[int(rng.integers(2))]
    if kind in (".xml", ".xcp", ".mcal", ".txt"):
        data = "<opencv_storage>" + "<a>" * n + "</a>" * n + "</opencv_storage>"
    elif kind == ".yml":
        data = "%YAML:1.0\n---\na: " + ("[" * n + "]" * n, "{a: " * n + "}" * n)[int(rng.integers(2))] + "\n"
    elif kind == ".toml":
        data = ("a = " + "[" * n + "]" * n, "[" + "a." * n + "a]\nb = 1", "a = " + "{a=" * n + "1" + "}" * n)[int(rng.integers(3))] + "\n"
    else:
        data = ("[" * n + "]" * n, '{"a":' * n + "1" + "}" * n)[int(rng.integers(2))] + "\n"
    path.write_text(data)


def huge_count(rng, path):
    """Much in little: a table, a picture, an archive that says it is huge, or is."""
    kind = path.suffix
    if kind == ".npz":
        with zipfile.ZipFile(path) as archive:
            parts = {name: archive.read(name) for name in archive.namelist()}
        name = sorted(parts)[int(rng.integers(len(parts)))]
        header = (
            f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({(400_000_000, 10**15)[int(rng.integers(2))]},), }}".ljust(117) + "\n"
        )
        parts[name] = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode()
        if rng.integers(2):
            parts[name] += bytes(300_000_000)
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for one, data in parts.items():
                archive.writestr(one, data)
    elif kind == ".png":
        side = (8_000, 30_000, 100_000)[int(rng.integers(3))]
        path.write_bytes(_white_png(side))
    elif kind in (".yml", ".xml") and rng.integers(2):
        path.write_bytes(re.sub(rb"(rows|cols|size)([:>]\s*)\d+", lambda m: m[1] + m[2] + b"2000000000", path.read_bytes()))
    elif is_text(path):
        data = path.read_bytes()
        lines = data.splitlines(keepends=True) or [b"\n"]
        one = lines[int(rng.integers(len(lines)))]
        n = 60_000_000 // max(len(one), 1)
        path.write_bytes(data + one * n if rng.integers(2) else data + b" " * 60_000_000)
    else:
        with open(path, "ab") as file:
            file.truncate(3 * 2**30)  # sparse


def _white_png(side: int) -> bytes:
    """A picture of one color and so many pixels square, in few bytes, row after row."""

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    deflate, row = zlib.compressobj(9), b"\0" + b"\xff" * ((side + 7) // 8)
    rows = min(side, 8_000)  # the rest is missing: what is decoded first is the header
    data = b"".join(deflate.compress(row) for _ in range(rows)) + deflate.flush()
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", struct.pack(">IIBBBBB", side, side, 1, 0, 0, 0, 0))
        + chunk(b"IDAT", data)
        + chunk(b"IEND", b"")
    )


def strange_neighbors(rng, path):
    """Other files beside it, with names that are hard to read."""
    names = (".hidden", "a b.png", "99999999999999999999.png", "-1.png", "\u202e.json", "x" * 200, "cam_99.mp4", "000000 (1).png", "new\nline.csv", "calibration.xml",
             "intri.yml", "keypoints.json", "Thumbs.db", "1e9.json", "000001.jpg", "cam_00.csv")  # fmt: skip
    for _ in range(int(rng.integers(1, 4))):
        other = path.parent / names[int(rng.integers(len(names)))]
        if not other.exists():
            other.write_bytes((b"", path.read_bytes(), rng.bytes(50))[int(rng.integers(3))])


def other_name(rng, path):
    names = (
        f"{path.stem} {path.suffix}",
        f" {path.name}",
        path.name.upper(),
        f"99999999999999999999{path.suffix}",
        f"{path.name}.bak",
        "100000000.png",
        "-5.png",
    )
    path.rename(path.parent / names[int(rng.integers(len(names)))])


def twin(rng, path):
    """A copy of it, or of a neighbor's content, beside it under nearly its name: of a copy, a conversion, another system."""
    names = (f"{path.stem} (1){path.suffix}", f"{path.stem}{path.suffix.upper()}", f"{path.stem}.avi", f"{path.stem}.bmp", f"._{path.name}",
             f"{path.stem} - Copy{path.suffix}", f"{path.name}.bak", f"~${path.name}")  # fmt: skip
    others = [path, *(one for one in sorted(path.parent.iterdir()) if one.is_file() and one.suffix == path.suffix)]
    other = path.parent / names[int(rng.integers(len(names)))]
    if not other.exists():
        shutil.copyfile(others[int(rng.integers(len(others)))], other)


def no_text_as_name(rng, path):
    """A name of another system's encoding, which is no text here."""
    path.rename(os.fsdecode(bytes(path.parent / path.stem) + (b"\xff", b"\xe9")[int(rng.integers(2))] + os.fsencode(path.suffix)))


def list_of_files(rng, path):
    """Text that a decoder of videos takes for the names of others."""
    others = sorted(one.name for one in path.parent.iterdir() if one.is_file() and one != path) or ["x.mp4"]
    other = others[int(rng.integers(len(others)))]
    texts = (f"ffconcat version 1.0\nfile '{other}'\n", f"#EXTM3U\n#EXT-X-TARGETDURATION:9\n#EXTINF:9,\n{other}\n#EXT-X-ENDLIST\n")
    path.write_text(texts[int(rng.integers(len(texts)))])


def neighbor_in_place(rng, path):
    """The content of another file of the same tree."""
    others = [one for one in sorted(path.parent.parent.rglob("*")) if one.is_file() and one != path and one.stat().st_size < 10**7]
    if others:
        shutil.copyfile(others[int(rng.integers(len(others)))], path)


def entities(rng, path):
    bomb = "".join(f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 10))
    if path.suffix == ".yml":
        path.write_text("%YAML:1.0\n---\na: &a [1, 1]\n" + "".join(f"a{k}: &a{k} [*a, *a]\n" for k in range(9)))
    else:
        path.write_text(f'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a0 "aaaaaaaaaa">{bomb}]><opencv_storage>&a9;</opencv_storage>')


FAMILIES = {
    "flip bytes": flip_bytes, "drop bytes": drop_bytes, "truncate": truncated, "random bytes": random_bytes, "drop a line": of_lines(_dropped),
    "double a line": of_lines(_doubled), "swap lines": of_lines(_swapped), "cut a line": of_lines(_cut_line), "a digit": digit, "a strange number": strange_number,
    "no number": removed_value, "text for a number": text_for_number, "empty": empty, "another encoding": other_encoding, "another type": other_type,
    "a folder": directory, "missing": missing, "no permission": no_permission, "a pipe or socket": fifo, "a link to itself": link_loop, "a device": device,
    "deep nesting": deep_nesting, "huge": huge_count, "strange neighbors": strange_neighbors, "another name": other_name, "a neighbor's content": neighbor_in_place,
    "entities": entities, "a twin": twin, "a name that is no text": no_text_as_name, "a list of files": list_of_files,
}  # fmt: skip
