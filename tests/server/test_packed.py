"""Results put together from parts are what gzip would make of the whole."""

from __future__ import annotations

import gzip
import json

from hypothesis import given, settings
from hypothesis import strategies as st

from hexwrap_server.output.packed import Packed, document, packed_part, picked

objects = st.dictionaries(st.sampled_from("abcdef"), st.lists(st.floats(allow_nan=False)) | st.text())


@settings(deadline=None)
@given(objects, st.sets(st.sampled_from("abcdef")))
def test_parts_make_up_the_whole_and_are_picked_from_it(value: dict[str, object], wanted: set[str]) -> None:
    parts = {name: packed_part(name, json.dumps(part).encode()) for name, part in value.items()}
    packed = b"".join(document(parts))
    assert json.loads(gzip.decompress(packed)) == value
    some = picked(packed, wanted)
    if wanted <= value.keys():
        assert some is not None
        assert json.loads(gzip.decompress(b"".join(some))) == {name: value[name] for name in wanted}
    else:
        assert some is None


def test_a_part_that_is_not_compressed_reads_as_the_others() -> None:
    text = b'"b":"%s"' % (b"long" * 50_000)
    packed = document({"a": packed_part("a", b"1"), "b": Packed.stored(text), "c": packed_part("c", b"2")})
    assert gzip.decompress(b"".join(packed)) == b'{"a":1,%s,"c":2}' % text
    some = picked(b"".join(packed), ["c", "b"])
    assert some is not None
    assert gzip.decompress(b"".join(some)) == b'{"c":2,%s}' % text


def test_nothing_is_picked_from_what_others_packed() -> None:
    assert picked(gzip.compress(b"{}"), []) is None
