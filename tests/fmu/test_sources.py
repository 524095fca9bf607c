from pathlib import Path

import pytest

from falsifier.errors import ModelError
from falsifier.fmu.sources import find_sources


def unpacked(folder: Path, **files: str) -> Path:
    (folder / "modelDescription.xml").write_text("<fmiModelDescription/>")
    for name, text in files.items():
        path = folder / "sources" / name.replace("__", "/").replace("_c", ".c").replace("_h", ".h")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return folder


def test_without_a_list_included_files_are_not_compiled_by_themselves(tmp_path: Path) -> None:
    folder = unpacked(tmp_path, all_c='#include "model/part.c"\n', model__part_c="", lib__x_c="", lib__x_h="")
    sources = find_sources(Path("my.fmu"), folder, 2, "my")
    assert sources.files == ("all.c", "lib/x.c")
    assert sources.includes == (".", "lib")


def test_a_configuration_for_another_library_or_platform_is_not_taken(tmp_path: Path) -> None:
    folder = unpacked(tmp_path, own_c="", other_c="", windows_c="")
    (folder / "sources" / "buildDescription.xml").write_text(
        """<fmiBuildDescription>
        <BuildConfiguration modelIdentifier="other"><SourceFileSet>
        <SourceFile name="other.c"/></SourceFileSet>
        </BuildConfiguration>
        <BuildConfiguration modelIdentifier="my" platform="x86_64-windows"><SourceFileSet>
        <SourceFile name="windows.c"/></SourceFileSet></BuildConfiguration>
        <BuildConfiguration modelIdentifier="my"><SourceFileSet><SourceFile name="own.c"/>
        <PreprocessorDefinition name="A" value="1"/><IncludeDirectory name="inc"/></SourceFileSet>
        </BuildConfiguration></fmiBuildDescription>"""
    )
    sources = find_sources(Path("my.fmu"), folder, 3, "my")
    assert (sources.files, sources.defines, sources.includes) == (("own.c",), {"A": "1"}, (".", "inc"))


def test_no_sources_are_an_error(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"my\.fmu: contains no C sources"):
        find_sources(Path("my.fmu"), unpacked(tmp_path), 2, "my")
