"""Ways to change a file: damage, as disks and transfers do it, and a new file in the same format that cannot be right.

All draw from a generator, so that a seed and a number name a file.
    damaged(content, rng)           bits, bytes, pieces, numbers and sizes, without any checksum made anew
    rewritten_npz(content, rng)     a whole zip file of arrays whose headers, numbers or names are others
    rewritten_model(content, rng)   a whole safetensors file whose header or numbers are others, its checksum right
    rewritten_text(content, rng)    another value in a json object, or in a table, its checksum right
"""

from __future__ import annotations

import io
import json
import re
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

Change = Callable[[bytes, np.random.Generator], bytes]
Item = TypeVar("Item")

_NUMBERS = (b"0", b"-1", b"1", b"2", b"7", b"1e300", b"nan", b"99999999999", b"18446744073709551616", b"1" * 400)
_FIELDS = (0, 1, 8, 2**7, 2**15, 2**16 - 1, 2**31 - 1, 2**31, 2**32 - 1, 2**63, 2**64 - 1)
_DTYPES = ("|O", "<f2", "<f4", ">f8", "<c16", "<M8[ns]", "<U3", "<U99999999", "<f3", "|V8", "<i8", "|b1", "<f16", "|S8")
_SHAPES = ("()", "(0,)", "(0, 2)", "(0, 10000000000)", "(3,)", "(-1, 2)", "(10000000000, 2)", "(1, 1, 1)", "(2.5, 2)")
_HEADERS = (b"(" * 9000, b"{" * 200, b"[" * 9000 + b"]" * 9000, b"'", b"__import__('os')", b"{'descr': (", b"\\", b"0x")
_TEXTS = ("[" * 100_000, "{", "[]", "null", '{"hidden": [100000, 100000]}', '"' + "x" * 1000, "1" * 5000, "NaN", "-0.0")
_VALUES = (np.nan, np.inf, -np.inf, 1e300, -1.0, 0.0, 1e-320, 2.0**62)


def pick(items: Sequence[Item], rng: np.random.Generator) -> Item:
    """One of them, all equally likely."""
    return items[int(rng.integers(len(items)))]


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """One to three changes of the bytes."""
    for _ in range(rng.integers(1, 4)):
        content = pick(_DAMAGE, rng)(content, rng)
    return content


def _flipped(content: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(content)
    for place in rng.integers(len(content), size=rng.integers(1, 9)) if content else ():
        changed[place] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def _cut(content: bytes, rng: np.random.Generator) -> bytes:
    return content[: rng.integers(len(content) + 1)]


def _swapped(content: bytes, rng: np.random.Generator) -> bytes:
    a, b, c, d = np.sort(rng.integers(len(content) + 1, size=4))
    return content[:a] + content[c:d] + content[b:c] + content[a:b] + content[d:]


def _replaced(content: bytes, rng: np.random.Generator) -> bytes:
    """A piece is lost, doubled, or full of zeros or noise."""
    start = int(rng.integers(len(content) + 1))
    end = min(len(content), start + int(rng.integers(1, 65)))
    piece = content[start:end]
    return content[:start] + pick((b"", piece * 2, bytes(len(piece)), rng.bytes(len(piece))), rng) + content[end:]


def _other_number(content: bytes, rng: np.random.Generator) -> bytes:
    """Another number where there are digits in the text of a file; half of the time of the same length."""
    found = [match.span() for match in re.finditer(rb"-?[0-9]+(\.[0-9]+)?", content)]
    if not found:
        return content
    start, end = pick(found, rng)
    digits = b"".join(b"%d" % digit for digit in rng.integers(10, size=end - start))
    return content[:start] + pick((digits, pick(_NUMBERS, rng)), rng) + content[end:]


def _other_size(content: bytes, rng: np.random.Generator) -> bytes:
    """Another size, offset, method or checksum: in a record of a zip file, else at the start of the file."""
    places = [match.start() + int(rng.integers(4, 46)) for match in re.finditer(rb"PK[\1\3\5][\2\4\6]", content)]
    place = pick(places, rng) if places else int(rng.integers(9))
    size = pick((2, 4, 8), rng)
    field = (pick(_FIELDS, rng) % 256**size).to_bytes(size, "little")
    return content[:place] + field + content[place + size :]


_DAMAGE: tuple[Change, ...] = (_flipped, _cut, _swapped, _replaced, _other_number, _other_size)


def rewritten_npz(content: bytes, rng: np.random.Generator) -> bytes:
    """A zip file of arrays with right checksums, and one thing in it that is another."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name, other = pick(list(members), rng), pick(list(members), rng)
    match rng.integers(8):
        case 0:
            del members[name]
        case 1:
            members[name], members[other] = members[other], members[name]
        case 2:
            members[name] = damaged(members[name], rng)
        case 3 | 4:
            members[name] = _other_header(members[name], rng)
        case 5 | 6:
            members[name] = _other_value(members[name], rng)
        case _:
            members[name] = _zeros(pick((16, 60, 100), rng)) if rng.random() < 0.1 else rng.bytes(200)
    buffer = io.BytesIO()
    method = pick((zipfile.ZIP_STORED, *3 * (zipfile.ZIP_DEFLATED,), zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA), rng)
    with zipfile.ZipFile(buffer, "w", method) as archive:
        for each, value in members.items():
            archive.writestr(each, value, compresslevel=1)
    return _other_size(buffer.getvalue(), rng) if rng.random() < 0.2 else buffer.getvalue()


def _other_header(member: bytes, rng: np.random.Generator) -> bytes:
    """An npy file with another type or shape in its header, or with something else in the place of the header."""
    size = struct.unpack("<H", member[8:10])[0]
    text, data = member[10 : 10 + size], member[10 + size :]
    if rng.random() < 0.2:
        text = pick(_HEADERS, rng)
    if rng.random() < 0.6:
        text = re.sub(rb"'shape': \([^)]*\)", f"'shape': {pick(_SHAPES, rng)}".encode(), text)
    if rng.random() < 0.6:
        text = re.sub(rb"'descr': '[^']*'", f"'descr': '{pick(_DTYPES, rng)}'".encode(), text)
    return member[:8] + struct.pack("<H", len(text)) + text + data


def _other_value(member: bytes, rng: np.random.Generator) -> bytes:
    array = np.load(io.BytesIO(member))
    if array.size and array.dtype.kind in "iuf":
        array = array.astype(pick((array.dtype, array.dtype, np.float64, np.uint64), rng), casting="unsafe")
        with np.errstate(all="ignore"):
            array.flat[rng.integers(array.size)] = np.array(pick(_VALUES, rng)).astype(array.dtype)
    elif array.dtype.kind == "U":
        array = np.array("".join(map(chr, rng.integers(0xD7FF, size=rng.integers(50)))))
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


@cache
def _zeros(mebibytes: int) -> bytes:
    """A large array that packs into a thousandth."""
    buffer = io.BytesIO()
    np.save(buffer, np.zeros((mebibytes * 2**20 // 16, 2)))
    return buffer.getvalue()


def rewritten_model(content: bytes, rng: np.random.Generator) -> bytes:
    """A safetensors file in which the header is another, or numbers are, with the checksum that belongs to them."""
    size = int.from_bytes(content[:8], "little")
    header, data = json.loads(content[8 : 8 + size]), content[8 + size :]
    match rng.integers(4):
        case 0:
            return _other_tensors(header, content, rng)
        case 1:
            header["__metadata__"][pick(["version", "model", "sha256", "more"], rng)] = pick(_TEXTS, rng)
        case 2:
            said = json.loads(header["__metadata__"]["model"])
            said[pick(list(said), rng)] = pick(
                (0, -1, 2.5, True, None, "3", 10**15, [100_000, 100_000], [], [1] * 9999), rng
            )
            header["__metadata__"]["model"] = json.dumps(said)
        case _:
            tensor = header[pick([name for name in header if name != "__metadata__"], rng)]
            field = pick(("dtype", "shape", "data_offsets"), rng)
            others: dict[str, tuple[Any, ...]] = {
                "dtype": ("F64", "I32", "BF16", "F8_E4M3", "BOOL", "X"),
                "shape": ([], [0], [10**10], [2**63, 2], [-1], [1, 1, 1, 1]),
                "data_offsets": ([0, 0], [0, 2**63], [5, 1], [0, 4], [0]),
            }
            tensor[field] = pick(others[field], rng)
    text = json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + data


def _other_tensors(header: dict[str, Any], content: bytes, rng: np.random.Generator) -> bytes:
    from safetensors.torch import load

    from sgimd_torch.forward_model.stored import write_model

    state = load(content)
    values = state[pick(sorted(state), rng)].view(-1)
    floating = (float("nan"), float("inf"), -1.0, 0.0, 1e38, 1e-45)
    values[int(rng.integers(len(values)))] = pick(floating if values.is_floating_point() else (-1, 0, 2**62), rng)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.safetensors"
        write_model(path, json.loads(header["__metadata__"]["model"]), state)
        return path.read_bytes()


def rewritten_text(content: bytes, rng: np.random.Generator) -> bytes:
    """A json file with another value or text, or a table in which a field is another, its line's checksum right."""
    if content.startswith(b"{"):
        if rng.random() < 0.3:
            return pick(_TEXTS, rng).encode()
        said = json.loads(content)
        said[pick(list(said), rng)] = pick((0, -1, 1e300, True, None, "3", [], {}, [[[]]] * 99, "x" * 10_000), rng)
        return json.dumps(said).encode()
    header, *lines = content.splitlines()
    line = int(rng.integers(len(lines)))
    fields = lines[line].split(b",")[:-1]
    fields[int(rng.integers(len(fields)))] = pick(
        (*_NUMBERS, b"", b"x", b"-inf", b"\xff", b"R" * 99, b"R.999999.999999"), rng
    )
    body = b",".join(fields)
    lines[line] = body + b",%08x" % zlib.crc32(body)
    return b"\n".join((header, *lines, b""))
