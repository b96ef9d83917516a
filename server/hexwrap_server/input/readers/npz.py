"""NumPy archives with the arrays ``vertices``, ``faces`` and, optionally, ``normals``."""

from __future__ import annotations

import io
import zipfile
from typing import Any

import numpy as np
from numpy.lib import format as npy

from hexwrap_server.errors import UnreadableFileError
from hexwrap_server.input.readers.found import FileContent, of_mesh
from hexwrap_solver.arrays import Ragged
from hexwrap_solver.surface import SentMesh

#: An archive that claims to unpack to more is refused, bytes.
LARGEST = 2_000_000_000


def read_npz(data: bytes) -> FileContent:
    """faces: (m, 3) or (m, 4); a quad whose last index repeats the one before, or is −1, is a triangle."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        if sum(member.file_size for member in archive.infolist()) > LARGEST:
            raise UnreadableFileError(
                f"The archive would unpack to more than {LARGEST} bytes: send a smaller one."
            )
        arrays = {
            name: _array(archive, f"{name}.npy")
            for name in ("vertices", "faces", "normals")
            if f"{name}.npy" in archive.namelist()
        }
    if not {"vertices", "faces"} <= arrays.keys():
        raise UnreadableFileError("The archive must hold the arrays 'vertices' and 'faces'.")
    normals = arrays.get("normals")
    return of_mesh(
        SentMesh(
            arrays["vertices"].astype(float),
            _rows(arrays["faces"]),
            None if normals is None else normals.astype(float),
        )
    )


def _array(archive: zipfile.ZipFile, name: str) -> np.ndarray[Any, np.dtype[Any]]:
    """One member, after its header's claim was compared with the bytes that are there."""
    size = archive.getinfo(name).file_size
    with archive.open(name) as stream:
        version = npy.read_magic(stream)
        read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, _, dtype = read_header(stream)
        header = stream.tell()
    if dtype.kind not in "iuf" or header + int(np.prod(shape, dtype=object)) * dtype.itemsize != size:
        raise UnreadableFileError(f"The array {name} is not a plain array of numbers, or is truncated.")
    with archive.open(name) as stream:
        return np.asarray(npy.read_array(stream, allow_pickle=False))


def _rows(faces: np.ndarray[Any, np.dtype[Any]]) -> Ragged:
    if faces.ndim != 2 or faces.dtype.kind not in "iu" or faces.shape[1] not in (3, 4):
        raise UnreadableFileError(
            f"The array 'faces' has the shape {faces.shape} and the type {faces.dtype}: rows of three or "
            "four integers are needed."
        )
    table = faces.astype(np.int64)
    if faces.dtype.kind == "u":
        table[faces == np.iinfo(faces.dtype).max] = -1  # the −1 of a type without a sign
    if table.shape[1] == 3:
        return Ragged.from_table(table)
    whole = (table[:, 3] >= 0) & (table[:, 3] != table[:, 2])
    keep = np.ones(table.shape, dtype=bool)
    keep[:, 3] = whole
    return Ragged.of(table[keep], 3 + whole)
