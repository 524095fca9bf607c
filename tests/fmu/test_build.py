import importlib.util
import re
import shutil
import zipfile
from pathlib import Path

import pytest

from falsifier.core.compiler import compiler
from falsifier.core.signals import Signal
from falsifier.errors import ModelError
from falsifier.fmu import FmuModel, read_info
from falsifier.fmu.build import compile_sources
from falsifier.fmu.description.archive import this_platform
from tests.fmu import fixtures
from tests.fmu.fixtures import ramp, run

needs_compiler = pytest.mark.skipif(
    not any(map(shutil.which, ("cc", "gcc", "clang"))) and importlib.util.find_spec("ziglang") is None,
    reason="no C compiler",
)


@needs_compiler
@pytest.mark.parametrize("name", ["Lag_2sources", "Lag_3sources"])
def test_sources_become_an_fmu_for_this_platform(tmp_path: Path, name: str) -> None:
    target = compile_sources(fixtures.path(name), tmp_path / "Lag.fmu")
    assert this_platform() in read_info(target).platforms
    built, known = FmuModel(target), fixtures.isolated(name.removesuffix("sources"))
    signals = {"u": ramp(1.0)}
    assert (
        run(built, ("y",), signals=signals)["y"].tolist() == run(known, ("y",), signals=signals)["y"].tolist()
    )
    built.close()


def test_an_fmu_without_sources_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"Lag_2\.fmu: contains no C sources"):
        compile_sources(fixtures.path("Lag_2"), tmp_path / "out.fmu")
    assert not list(tmp_path.iterdir())


def rearranged(tmp_path: Path, name: str, **files: str | None) -> Path:
    """A copy of a fixture with sources, some files added, replaced or (None) moved to subfolders."""
    target = tmp_path / f"{name}.fmu"
    with zipfile.ZipFile(fixtures.path(name)) as source, zipfile.ZipFile(target, "w") as made:
        for entry in source.namelist():
            key = entry.removeprefix("sources/").replace(".", "_")
            if key not in files:
                made.writestr(entry, source.read(entry))
        for key, text in files.items():
            if text is not None:
                made.writestr(f"sources/{key.rpartition('_')[0]}.{key.rpartition('_')[2]}", text)
    return target


def without_listing(path: Path) -> None:
    """Remove the list of source files from an FMI 2 description."""
    with zipfile.ZipFile(path) as source:
        content = {name: source.read(name) for name in source.namelist()}
    text = content["modelDescription.xml"].decode()
    shorter = re.sub(r"<SourceFiles>.*?</SourceFiles>", "", text, flags=re.DOTALL)
    assert shorter != text
    with zipfile.ZipFile(path, "w") as target:
        for name, data in content.items():
            target.writestr(name, shorter if name == "modelDescription.xml" else data)


def simulates_like_the_fixture(built: Path, fixture: str) -> bool:
    model, known = FmuModel(built), fixtures.isolated(fixture)
    signals = {"u": ramp(1.0)}
    runs = [run(m, ("y",), signals=signals)["y"].tolist() for m in (model, known)]
    model.close()
    return bool(runs[0] == runs[1])


@needs_compiler
@pytest.mark.parametrize(
    ("name", "file", "shell"), [("Lag_2sources", "all_c", "shell2.c"), ("Lag_3sources", "own_c", "shell3.c")]
)
def test_function_prefixes_of_the_sources_have_no_effect(
    tmp_path: Path, name: str, file: str, shell: str
) -> None:
    major = name[4]
    text = f'#define FMI{major}_FUNCTION_PREFIX Lag_\n#define MODEL "lag.h"\n#include "{shell}"\n'
    build_description = (
        '<fmiBuildDescription fmiVersion="3.0"><BuildConfiguration modelIdentifier="Lag">'
        '<SourceFileSet><SourceFile name="own.c"/></SourceFileSet></BuildConfiguration></fmiBuildDescription>'
    )
    extra = {"buildDescription_xml": build_description} if major == "3" else {}
    source = rearranged(tmp_path, name, **{file: text}, **extra)
    built = compile_sources(source, tmp_path / "out.fmu")
    assert simulates_like_the_fixture(built, name.removesuffix("sources"))


@needs_compiler
def test_sources_that_declare_the_standards_types_on_their_own_are_compiled(tmp_path: Path) -> None:
    source = tmp_path / "AT.fmu"
    bundled = Path(__file__).parents[2] / "fmus" / "AT.fmu"
    with zipfile.ZipFile(bundled) as packed, zipfile.ZipFile(source, "w") as without_libraries:
        for entry in packed.namelist():
            if not entry.startswith("binaries/"):
                without_libraries.writestr(entry, packed.read(entry))
    compile_sources(source, tmp_path / "out.fmu")
    inputs = {"throttle": Signal((0.0, 1.0), (100.0, 0.0), "linear")}
    found = [
        run(FmuModel(path), ("speed",), signals=inputs)["speed"] for path in (bundled, tmp_path / "out.fmu")
    ]
    assert found[0].max() > 0 and found[1] == pytest.approx(found[0])


@needs_compiler
def test_sources_in_subfolders_are_found_and_included_ones_are_not_compiled_twice(tmp_path: Path) -> None:
    text = '#define MODEL "lag.h"\n#include "../shell2.c"\n'
    source = rearranged(tmp_path, "Lag_2sources", all_c=None, **{"model/all_c": text})
    without_listing(source)
    assert simulates_like_the_fixture(compile_sources(source, tmp_path / "out.fmu"), "Lag_2")


@needs_compiler
def test_the_drafts_name_of_the_build_description_counts_too(tmp_path: Path) -> None:
    with zipfile.ZipFile(fixtures.path("Lag_3sources")) as source:
        description = source.read("sources/buildDescription.xml").decode()
    other = rearranged(tmp_path, "Lag_3sources", buildDescription_xml=None, build_description_xml=description)
    assert simulates_like_the_fixture(compile_sources(other, tmp_path / "out.fmu"), "Lag_3")


@needs_compiler
def test_a_result_that_cannot_be_loaded_is_not_written(tmp_path: Path) -> None:
    text = '#define MODEL "lag.h"\nvoid gone(void);\n__attribute__((constructor)) static void at_load(void) '
    source = rearranged(tmp_path, "Lag_2sources", all_c=text + '{ gone(); }\n#include "shell2.c"\n')
    with pytest.raises(ModelError, match=r"the sources compile, but the result cannot be used: (?s:.*)gone"):
        compile_sources(source, tmp_path / "out.fmu")
    assert [p.name for p in tmp_path.iterdir()] == ["Lag_2sources.fmu"]


@needs_compiler
def test_many_errors_are_summed_up(tmp_path: Path) -> None:
    text = "\n".join(f"int f{k}(void) {{ return missing{k}; }}" for k in range(50))
    source = rearranged(tmp_path, "Lag_2sources", all_c=text)
    with pytest.raises(ModelError, match="50 errors, the first:") as caught:
        compile_sources(source, tmp_path / "out.fmu")
    assert len(str(caught.value).splitlines()) == 6


def test_missing_source_files_are_named(tmp_path: Path) -> None:
    partial = tmp_path / "partial.fmu"
    with zipfile.ZipFile(fixtures.path("Lag_2sources")) as source, zipfile.ZipFile(partial, "w") as target:
        for name in source.namelist():
            if name != "sources/all.c":
                target.writestr(name, source.read(name))
    with pytest.raises(ModelError, match=r"source files all\.c are missing"):
        compile_sources(partial, tmp_path / "out.fmu")


def test_no_compiler_says_how_to_get_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda _name: None)
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)
    with pytest.raises(ModelError, match="pip install ziglang"):
        compiler()
