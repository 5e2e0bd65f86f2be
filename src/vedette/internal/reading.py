"""Bounded readers for untrusted content: memory stays below a small multiple of the size of the input.

Every function raises `ValueError` for content that it refuses. The message fits after "it is damaged: ".
"""

import io
import json
import math
import os
import re
import stat
import zipfile
import zlib
from collections.abc import Container, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vedette.errors import InputError
from vedette.internal.text import shown

MOST_BYTES = 2**30  # of a file, or of its unpacked content: five times a run of 10,000 scans of 100 targets
_LONGEST_NUMBER = 300  # digits
_LONGEST_MESSAGE = 300  # characters of another library's message
_SURROGATE = re.compile(r"\\u[dD][89a-fA-F]")


def read_file(path: Path, most: int = MOST_BYTES) -> bytes:
    """Return the bytes of a regular file. Raises `OSError` if it cannot be read."""
    if not stat.S_ISREG(path.stat().st_mode):  # reading a pipe may wait for ever, and a device may have no end
        if path.is_dir():
            raise IsADirectoryError(21, "a folder")
        raise ValueError("it is no regular file")
    with path.open("rb") as file:
        content = file.read(min(os.fstat(file.fileno()).st_size, most) + 1)  # read allocates all it is asked for
        while len(content) <= most and (more := file.read(min(len(content), most) + 1)):  # the file grew meanwhile
            content += more
    if len(content) > most:
        raise ValueError(f"it has more than {most} bytes")
    return content


def unreadable(path: Path, what: str, error: OSError) -> InputError:
    """Return the error for a file that the operating system cannot read, where `what` was expected."""
    if isinstance(error, FileNotFoundError | NotADirectoryError):
        return InputError(f"{path}: no such file; expected {what}")
    return InputError(f"{path}: expected {what}; got {error.strerror or error}")


def read_text(path: Path, what: str, most: int) -> str:
    """Return the text of a UTF-8 file of at most `most` bytes. Messages call it `what`.

    Raises:
        InputError: the file cannot be read, is too large, or is not UTF-8 text.
    """
    try:
        return read_file(path, most).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: expected UTF-8 text; byte {error.start} is not") from None
    except OSError as error:
        raise unreadable(path, f"a {what}", error) from None
    except ValueError as error:
        raise InputError(f"{path}: expected a {what} of at most {most} bytes; {error}") from None


def parse_json(content: bytes | str) -> Any:
    """Return the data of JSON text. Numbers are finite, keys unique, and every text can be encoded again."""
    text = content.decode() if isinstance(content, bytes) else content
    try:
        data = json.loads(
            text, object_pairs_hook=_each_once, parse_constant=_no_constant, parse_float=_finite, parse_int=_whole
        )
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    if _SURROGATE.search(text):
        json.dumps(data, ensure_ascii=False).encode()  # raises for a lone surrogate
    return data


def _each_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    data: dict[str, Any] = {}
    for name, value in pairs:
        if name in data:
            raise ValueError(f"the key {shown(name)} stands there twice")
        data[name] = value
    return data


def _no_constant(name: str) -> Any:
    raise ValueError(f"{name} is no number")


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text[:40]} is too large a number")
    return number


def _whole(text: str) -> int:
    if len(text) > _LONGEST_NUMBER:
        raise ValueError(f"a number has {len(text)} digits")
    return int(text)


def inflate(packed: bytes, most: int = MOST_BYTES) -> bytes:
    """Return the content that zlib packed into these bytes. Nothing may follow it."""
    unpacking = zlib.decompressobj()
    try:
        content = unpacking.decompress(packed, most)
    except zlib.error as error:
        raise ValueError(str(error)) from None
    if unpacking.unconsumed_tail:
        raise ValueError(f"it unpacks to more than {most} bytes")
    if not unpacking.eof or unpacking.unused_data:
        raise ValueError("it is cut short, or something stands behind it")
    return content


def read_members(archive: bytes, wanted: Container[str] | None = None) -> dict[str, bytes]:
    """Return the members of an uncompressed zip archive by name, or only the `wanted` ones.

    Together they are no larger than the archive, as nothing is compressed. Raises `ValueError` for other bytes.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(archive)) as opened:
            infos = opened.infolist()
            size = sum(info.file_size for info in infos)
            if size > len(archive):
                raise ValueError(f"its {len(archive)} bytes would unpack to {size}")
            names = [info.filename for info in infos]
            members = {name: opened.read(name) for name in names if wanted is None or name in wanted}
    except Exception as error:  # damaged content can raise nearly any error
        raise ValueError(error_summary(error)) from error
    if len(set(names)) < len(names):
        raise ValueError("it has two members of one name")
    return members


def read_array(content: bytes) -> np.ndarray[Any, Any]:
    """The array of the bytes of an `.npy` file, never an object."""
    file = io.BytesIO(content)
    try:
        version = np.lib.format.read_magic(file)
        header = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}[version]
        shape, _, dtype = header(file)
        expected = math.prod(shape) * dtype.itemsize
        if (
            dtype.hasobject
            or dtype.itemsize == 0
            or min(shape, default=0) < 0
            or expected != len(content) - file.tell()
        ):
            raise ValueError(f"expected an array of {dtype} in shape {shape}; got {len(content) - file.tell()} bytes")
        file.seek(0)
        array: np.ndarray[Any, Any] = np.lib.format.read_array(file, allow_pickle=False)
    except Exception as error:  # damaged content can raise nearly any error
        raise ValueError(error_summary(error)) from error
    return array


def read_arrays(archive: bytes) -> Mapping[str, np.ndarray[Any, Any]]:
    """Return the arrays of an `.npz` file from its bytes."""
    arrays = {}
    for name, content in read_members(archive).items():
        try:
            arrays[name.removesuffix(".npy")] = read_array(content)
        except ValueError as error:
            raise ValueError(f"{shown(name)}: {error}") from error
    return arrays


def error_summary(error: object) -> str:
    """Return the message of another library's error on one line of bounded length."""
    text = " ".join(str(error).split()) or type(error).__name__
    return text if len(text) <= _LONGEST_MESSAGE else f"{text[:_LONGEST_MESSAGE]} ..."
