"""Results put together from parts are what gzip would make of the whole."""

from __future__ import annotations

import gzip
import json

from hypothesis import given, settings
from hypothesis import strategies as st

from hexwrap_server.output.packed import document, packed_part, picked

objects = st.dictionaries(st.sampled_from("abcdef"), st.lists(st.floats(allow_nan=False)) | st.text())


@settings(deadline=None)
@given(objects, st.sets(st.sampled_from("abcdef")))
def test_parts_make_up_the_whole_and_are_picked_from_it(value: dict[str, object], wanted: set[str]) -> None:
    packed = document({name: packed_part(name, json.dumps(part).encode()) for name, part in value.items()})
    assert json.loads(gzip.decompress(packed)) == value
    some = picked(packed, wanted)
    if wanted <= value.keys():
        assert some is not None
        assert json.loads(gzip.decompress(some)) == {name: value[name] for name in wanted}
    else:
        assert some is None


def test_nothing_is_picked_from_what_others_packed() -> None:
    assert picked(gzip.compress(b"{}"), []) is None
