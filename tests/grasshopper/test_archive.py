"""The archive codec: what is written is read back, in all three clothes, and damage is told."""

import struct
import zlib
from uuid import UUID

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grasshopper import archive
from grasshopper.archive import ArchiveError, Chunk, Item

INT32 = st.integers(-(2**31), 2**31 - 1)
INT64 = st.integers(-(2**63), 2**63 - 1)
SINGLE = st.floats(width=32, allow_nan=False, allow_infinity=False)
DOUBLE = st.floats(allow_nan=False, allow_infinity=False)
# XML knows no control characters and turns a carriage return into a line feed.
TEXT = st.text(st.characters(exclude_categories=["Cs", "Cc", "Cn"]) | st.sampled_from("\n\täπ≤"))
NAME = st.text(st.characters(min_codepoint=48, max_codepoint=122, categories=["L", "N"]), min_size=1)

VALUES = {
    "gh_bool": st.booleans(),
    "gh_byte": st.integers(0, 255),
    "gh_int32": INT32,
    "gh_int64": INT64,
    "gh_single": SINGLE,
    "gh_double": DOUBLE,
    "gh_date": INT64,
    "gh_guid": st.uuids(),
    "gh_string": TEXT,
    "gh_bytearray": st.binary(),
    "gh_drawing_point": st.tuples(INT32, INT32),
    "gh_drawing_pointf": st.tuples(SINGLE, SINGLE),
    "gh_drawing_size": st.tuples(INT32, INT32),
    "gh_drawing_sizef": st.tuples(SINGLE, SINGLE),
    "gh_drawing_rectangle": st.tuples(INT32, INT32, INT32, INT32),
    "gh_drawing_rectanglef": st.tuples(SINGLE, SINGLE, SINGLE, SINGLE),
    "gh_drawing_color": st.tuples(*[st.integers(0, 255)] * 4),
    "gh_drawing_bitmap": st.binary(),
    "gh_version": st.tuples(INT32, INT32, INT32),
}


@st.composite
def items(draw: st.DrawFn) -> Item:
    kind = draw(st.sampled_from(sorted(VALUES)))
    return Item(draw(NAME), kind, draw(VALUES[kind]), draw(st.integers(-1, 40)))


CHUNKS = st.recursive(
    st.builds(Chunk, NAME, st.integers(-1, 9), st.lists(items(), max_size=4)),
    lambda inner: st.builds(
        Chunk, NAME, st.integers(-1, 9), st.lists(items(), max_size=3), st.lists(inner, max_size=3)
    ),
    max_leaves=6,
)


def test_every_type_is_tried() -> None:
    assert set(VALUES) == set(archive.TYPES)


@given(CHUNKS)
def test_binary_and_deflated_archives_come_back(chunk: Chunk) -> None:
    assert archive.from_binary(archive.to_binary(chunk)) == chunk
    assert archive.inflate(archive.deflate(chunk)) == chunk


@given(CHUNKS)
def test_xml_archives_come_back(chunk: Chunk) -> None:
    root = Chunk("Root", -1, chunk.items, chunk.chunks)
    assert archive.from_xml(archive.to_xml(root)) == root


@given(CHUNKS, st.data())
def test_a_cut_archive_is_refused(chunk: Chunk, data: st.DataObject) -> None:
    whole = archive.to_binary(chunk)
    cut = data.draw(st.integers(0, len(whole) - 1))
    with pytest.raises(ArchiveError):
        archive.from_binary(whole[:cut])


def test_bytes_follow_the_published_layout() -> None:
    guid = UUID("410755b1-224a-4c1e-a407-bf32fb45ea7e")
    chunk = Chunk("A").add("gh_guid", "Id", guid).add("gh_drawing_color", "C", (255, 1, 2, 3))
    assert archive.to_binary(chunk) == (
        b"\x01A" + struct.pack("<3i", -1, 2, 0)
        + b"\x01C" + struct.pack("<2i", -1, 36) + b"\x03\x02\x01\xff"
        + b"\x02Id" + struct.pack("<2i", -1, 9)
        + bytes.fromhex("b1550741 4a22 1e4c a407 bf32fb45ea7e".replace(" ", ""))
    )  # fmt: skip


def test_long_strings_carry_a_seven_bit_length() -> None:
    data = archive.to_binary(Chunk("x" * 300))
    assert data[:2] == bytes([300 & 0x7F | 0x80, 300 >> 7])


def test_damage_is_told() -> None:
    with pytest.raises(ArchiveError, match="no deflated archive"):
        archive.inflate(b"\xff\xff\xff")
    with pytest.raises(ArchiveError, match="3 bytes follow"):
        archive.from_binary(archive.to_binary(Chunk("A")) + b"abc")
    with pytest.raises(ArchiveError, match="type code 99"):
        archive.from_binary(b"\x01A" + struct.pack("<3i", -1, 1, 0) + b"\x01B" + struct.pack("<2i", -1, 99))
    with pytest.raises(ArchiveError, match="impossible length"):
        archive.from_binary(b"\xff" * 9)
    with pytest.raises(ArchiveError, match="-5 items"):
        archive.from_binary(b"\x01A" + struct.pack("<3i", -1, -5, 0))
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    with pytest.raises(ArchiveError, match="no deflated archive"):
        archive.inflate(packer.compress(b"\x01\xff" + bytes(12)) + packer.flush())


def test_damaged_xml_is_told() -> None:
    with pytest.raises(ArchiveError, match="no XML"):
        archive.from_xml("<Archive")
    with pytest.raises(ArchiveError, match="not 'Archive'"):
        archive.from_xml("<other/>")
    with pytest.raises(ArchiveError, match="gh_unheard"):
        archive.from_xml('<Archive><items><item name="a" type_name="gh_unheard"/></items></Archive>')


def test_chunks_are_found_by_path() -> None:
    root = Chunk("Root")
    root.child("Row", 1).add("gh_int32", "n", 7, index=2)
    assert root.find(("Row", 1))["n", 2] == 7
    with pytest.raises(KeyError):
        root.find("Row")
    with pytest.raises(KeyError):
        root.find(("Row", 1))["n"]
    assert [c.name for c in root.walk()] == ["Root", "Row"]
