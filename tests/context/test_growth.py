"""Time grows with the length of a file, not with its square, however the file is made.

Files of one and eight times a length are read: if time grew with the square, the ratio would be 64. What is
compared is processor time of this process; there is no limit in seconds.
"""

from collections.abc import Callable
from pathlib import Path
from time import process_time

import pytest

from falsifier.context.gather import gather
from tests.fixtures import simulink

LENGTH, TIMES, LARGEST_RATIO = 5_000, 8, 32
# In documents, code is nothing special.
DOCUMENTS = ("a word", "digits and dots", "words", "blanks", "lines", "brackets", "quotes", "tags",
             "hidden tags", "references", "passwords", "addresses")  # fmt: skip
BLOCK = (
    'Block {{\nBlockType {0}\nName "{1}"\n{2}\n}}\n'
    'Line {{\nSrcBlock "{3}"\nSrcPort 1\nDstBlock "{1}"\nDstPort 1\n}}\n'
)
TEXTS = {
    "a word": "a",
    "digits": "1",
    "digits and dots": "1.",
    "words": "a_",
    "blanks": " ",
    "lines": "\n ",
    "brackets": "(",
    "closed brackets": "[]",
    "braces": "{",
    "semicolons": ";",
    "signs": "u < ",
    "equals signs": "a = ",
    "quotes": "'\"",
    "comments": "/* ",
    "tags": "<a '",
    "hidden tags": "<!--<script>",
    "references": "&#9",
    "directives": "#define A \\\n",
    "passwords": "password ",
    "addresses": "://a",
    "conditions": "if (u > 1) y = 2; else ",
    "nested conditions": "if (u > 1) {",
    "classes": "model A Real y; ",
    "calls": "y = f(u); f(y);\n",
    "modifiers": "model M Real y(a = ",
}


def of_blocks(make: Callable[[int], str]) -> Callable[[int], str]:
    ports = BLOCK.format("Inport", "u", "", "u") + BLOCK.format("Outport", "y", "", "u")
    return lambda size: f'Model {{\nName "m"\nSystem {{\n{ports}{make(size)}}}\n}}\n'


DIAGRAMS = {
    "comparisons": of_blocks(
        lambda n: "".join(
            BLOCK.format("Reference", f"r{i}", f'relop ">"\nconst "{i}"', "u") for i in range(n // 99)
        )
    ),
    "tags": of_blocks(
        lambda n: "".join(
            BLOCK.format("Goto", f"g{i}", 'GotoTag "T"', "u")
            + BLOCK.format("From", f"f{i}", 'GotoTag "T"', "u")
            + f'Line {{\nSrcBlock "f{i}"\nSrcPort 1\nDstBlock "y"\nDstPort 1\n}}\n'
            for i in range(n // 250)
        )
    ),
    "pieces of text": of_blocks(lambda n: BLOCK.format("Gain", "g", 'Gain "1"\n' + '"23"\n' * (n // 5), "u")),
    "a number that is none": of_blocks(lambda n: BLOCK.format("Constant", "1" * n + "x", "", "u")),
    "transitions": lambda n: simulink.MDL.replace(
        "Stateflow {\n",
        "Stateflow {\n"
        + 'chart {\nid 7\nname "C"\n}\n'
        + "".join(
            f'transition {{\nid {i + 100}\nlabelString "[u > {i}]"\nchart 7\ndst {{\nid 2\n}}\n}}\n'
            for i in range(n // 80)
        ),
        1,
    ),
}


def took(path: Path, text: str) -> float:
    path.write_text(text)
    begin = process_time()
    gather([str(path)], [], seeds=["y"], signals=["y", "u"], checked=[str(path)], ranges={"u": (0.0, 10.0)})
    return process_time() - begin


def check(path: Path, make: Callable[[int], str]) -> None:
    took(path, make(LENGTH))  # what is done once
    ratios = (took(path, make(TIMES * LENGTH)) / took(path, make(LENGTH)) for _ in range(2))
    assert any(ratio < LARGEST_RATIO for ratio in ratios)  # once, unless something disturbed it


@pytest.mark.parametrize("end", (".c", ".mo"))
@pytest.mark.parametrize("piece", TEXTS.values(), ids=TEXTS.keys())
def test_sources_are_read_in_linear_time(tmp_path: Path, piece: str, end: str) -> None:
    # What follows keeps a search from ending early.
    check(tmp_path / f"a{end}", lambda size: piece * (size // len(piece)) + "x;\n y = u > 3;")


@pytest.mark.parametrize("end", (".md", ".html"))
@pytest.mark.parametrize("name", DOCUMENTS)
def test_documents_are_read_in_linear_time(tmp_path: Path, name: str, end: str) -> None:
    check(tmp_path / f"a{end}", lambda size: TEXTS[name] * (size // len(TEXTS[name])) + "x;\n y")


@pytest.mark.parametrize("make", DIAGRAMS.values(), ids=DIAGRAMS.keys())
def test_diagrams_are_read_in_linear_time(tmp_path: Path, make: Callable[[int], str]) -> None:
    check(tmp_path / "a.mdl", make)
