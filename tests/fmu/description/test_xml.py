import pytest

from falsifier.errors import ModelError, SpecError
from falsifier.fmu.description import xml
from falsifier.fmu.description.xml import read_xml

LAUGHS = b"""<!DOCTYPE x [<!ENTITY a "ha"><!ENTITY b "&a;&a;">]><x>&b;</x>"""
OUTSIDE = b"""<!DOCTYPE x SYSTEM "file:///etc/passwd"><x/>"""


@pytest.mark.parametrize("text", [LAUGHS, OUTSIDE, OUTSIDE.decode().encode("utf-16")])
def test_document_types_are_refused(text: bytes) -> None:
    with pytest.raises(SpecError, match=r"part: refused because it declares a document type \(x\)"):
        read_xml(text, "part", SpecError)


@pytest.mark.parametrize(
    "text", [b"<a><b></a>", b"", b"<?xml version='1.0' encoding='no'?><a/>", b"<a>&x;</a>"]
)
def test_what_is_not_well_formed_is_named(text: bytes) -> None:
    with pytest.raises(SpecError, match="part: not well-formed XML"):
        read_xml(text, "part", SpecError)


def test_depth_and_size_have_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SpecError, match="nested more than 400 deep"):
        read_xml(b"<a>" * 500 + b"</a>" * 500, "part", SpecError)
    assert read_xml(b"<a>" * 300 + b"</a>" * 300, "part", SpecError).tag == "a"
    monkeypatch.setattr(xml, "_MAX_SIGNS", 3)
    with pytest.raises(ModelError, match="more than 3 tags"):
        read_xml(b"<a><b/><b/><b/></a>", "part", ModelError)
