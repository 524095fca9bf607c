import importlib.util
import re
import shutil
import sysconfig
import zipfile
from collections.abc import Mapping
from pathlib import Path

import pytest

from falsifier.core.compiler import compile_c, compiler
from falsifier.core.files import bundled
from falsifier.core.signals import Signal
from falsifier.errors import ModelError, SimulationError
from falsifier.fmu import FmuModel, read_info, rights_text
from falsifier.fmu.build import compile_sources
from falsifier.fmu.description.archive import read_entry, this_platform
from falsifier.fmu.process.start import _libraries
from tests.fixtures.archives import packed
from tests.fmu import fixtures
from tests.fmu.fixtures import ramp, run

needs_compiler = pytest.mark.skipif(
    not any(map(shutil.which, ("cc", "gcc", "clang"))) and importlib.util.find_spec("ziglang") is None,
    reason="no C compiler",
)


def test_an_fmu_without_sources_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"Lag_2\.fmu: contains no C sources"):
        compile_sources(fixtures.path("Lag_2"), tmp_path / "out.fmu")
    assert not list(tmp_path.iterdir())


def rearranged(tmp_path: Path, name: str, files: Mapping[str, str | None]) -> Path:
    """A copy of an FMU in which the text of some files is another one or (None) is missing."""
    target = tmp_path / "rearranged.fmu"
    with zipfile.ZipFile(fixtures.path(name)) as source:
        texts: dict[str, str | None] = {e: source.read(e).decode() for e in source.namelist()}
    return packed(target, {entry: text for entry, text in {**texts, **files}.items() if text is not None})


def text_of(name: str, entry: str) -> str:
    return read_entry(fixtures.path(name), entry).decode()


PREFIXED = '#define FMI{0}_FUNCTION_PREFIX Lag_\n#define MODEL "lag.h"\n#include "shell{0}.c"\n'
OWN = """<fmiBuildDescription fmiVersion="3.0"><BuildConfiguration modelIdentifier="Lag"><SourceFileSet>
<SourceFile name="own.c"/></SourceFileSet></BuildConfiguration></fmiBuildDescription>"""
DESCRIPTION, BUILD = "modelDescription.xml", "sources/buildDescription.xml"
ASKS = "#define _GNU_SOURCE 1\n#include <locale.h>\n#include <stdlib.h>\n"
ASKED = "double (*const used)(const char *, char **, locale_t) = strtod_l;\n"
# As PythonFMU links its library: it calls the Python of the process, which must be a shared library.
CALLS_PYTHON = PREFIXED.format(2)
if sysconfig.get_config_var("Py_ENABLE_SHARED"):
    CALLS_PYTHON += "const char *Py_GetVersion(void);\nconst char *(*const used)(void) = Py_GetVersion;\n"
UNLISTED = re.sub(
    r"<SourceFiles>.*?</SourceFiles>", "", text_of("Lag_2sources", DESCRIPTION), flags=re.DOTALL
)


@needs_compiler
@pytest.mark.parametrize(
    ("name", "files"),
    [
        ("Lag_2", {}),
        ("Lag_3", {}),
        ("Lag_2", {"sources/all.c": PREFIXED.format(2)}),
        ("Lag_3", {"sources/own.c": PREFIXED.format(3), BUILD: OWN}),
        # In a subfolder, without a list of files: what is included is not compiled twice.
        (
            "Lag_2",
            {
                DESCRIPTION: UNLISTED,
                "sources/all.c": None,
                "sources/model/all.c": '#define MODEL "lag.h"\n#include "../shell2.c"\n',
            },
        ),
        # The name in drafts of the standard.
        ("Lag_3", {BUILD: None, "sources/build_description.xml": text_of("Lag_3sources", BUILD)}),
        ("Lag_2", {"sources/all.c": ASKS + PREFIXED.format(2) + ASKED}),
        ("Lag_2", {"sources/all.c": CALLS_PYTHON, "resources/slavemodule.txt": ""}),
        ("Lag_2", {"sources/all.c": CALLS_PYTHON, "resources/00/resources/slavemodule.txt": ""}),
    ],
    ids=["FMI 2", "FMI 3", "prefix 2", "prefix 3", "subfolder", "draft", "GNU", "Python", "FMU of FMUs"],
)
def test_sources_become_a_working_fmu(tmp_path: Path, name: str, files: dict[str, str | None]) -> None:
    source = rearranged(tmp_path, f"{name}sources", files)
    target = compile_sources(source, tmp_path / "Lag.fmu")
    assert this_platform() in read_info(target).platforms
    models = FmuModel(target), fixtures.isolated(name)
    built, known = (run(model, ("y",), signals={"u": ramp(1.0)})["y"].tolist() for model in models)
    assert built == known


# Names that gcc reads as options, and two that are not in sources/.
@needs_compiler
@pytest.mark.parametrize(
    ("listed", "files", "said"),
    [
        ("@more.c", {"sources/@more.c": "", "sources/more.c": "-DMODEL_IS_GIVEN"}, ""),
        ("-DNOTHING.c", {"sources/-DNOTHING.c": "#error compiled"}, "compiled"),
        ("../outside.c", {"outside.c": ""}, "outside sources/"),
        ("/etc/hostname", {}, "outside sources/"),
    ],
)
def test_names_of_source_files_are_no_options_and_lead_nowhere_else(
    tmp_path: Path, listed: str, files: dict[str, str], said: str
) -> None:
    described = text_of("Lag_2sources", DESCRIPTION)
    described = described.replace("<SourceFiles>", f'<SourceFiles><File name="{listed}"/>')
    model = "#ifdef MODEL_IS_GIVEN\n#error an option\n#endif\n" + text_of("Lag_2sources", "sources/all.c")
    source = rearranged(tmp_path, "Lag_2sources", {DESCRIPTION: described, "sources/all.c": model, **files})
    if said:
        with pytest.raises(ModelError, match=said):
            compile_sources(source, tmp_path / "out.fmu")
    else:
        compile_sources(source, tmp_path / "out.fmu")
    assert (tmp_path / "out.fmu").exists() == (not said)


@needs_compiler
def test_sources_that_declare_the_standards_types_on_their_own_are_compiled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = bundled("fmus") / "AT.fmu"
    with zipfile.ZipFile(known) as fmu:
        kept = {name: fmu.read(name) for name in fmu.namelist() if not name.startswith("binaries/")}
    source = packed(tmp_path / "AT.fmu", kept)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("tempfile.tempdir", ".")  # as of TMPDIR
    target = compile_sources(source, tmp_path / "out.fmu")
    inputs = {"throttle": Signal((0.0, 1.0), (100.0, 0.0), "linear")}
    found = [run(FmuModel(path), ("speed",), signals=inputs)["speed"] for path in (known, target)]
    assert found[0].max() > 0 and found[1] == pytest.approx(found[0])


UNRESOLVED = """#define MODEL "lag.h"
void gone(void);
__attribute__((constructor)) static void at_load(void) { gone(); }
#include "shell2.c"
"""
MANY = "\n".join(f"int f{k}(void) {{ return missing{k}; }}" for k in range(50))


@needs_compiler
@pytest.mark.parametrize(
    ("text", "message", "lines"),
    [
        (UNRESOLVED, "the sources compile, but the result cannot be used: (?s:.*)gone", None),
        (MANY, "50 errors, the first:", 6),
        (None, r"source files all\.c are missing", 1),
    ],
    ids=["unresolved", "many errors", "missing"],
)
def test_sources_that_make_no_fmu_are_told_and_nothing_is_written(
    tmp_path: Path, text: str | None, message: str, lines: int | None
) -> None:
    source = rearranged(tmp_path, "Lag_2sources", {"sources/all.c": text})
    with pytest.raises(ModelError, match=message) as caught:
        compile_sources(source, tmp_path / "out.fmu")
    assert lines in (None, len(str(caught.value).splitlines()))
    assert list(tmp_path.iterdir()) == [source]


@needs_compiler
def test_a_macro_without_a_name_is_an_error_of_the_fmu(tmp_path: Path) -> None:
    described = text_of("Lag_3sources", BUILD).replace(
        'PreprocessorDefinition name="MODEL"', "PreprocessorDefinition"
    )
    with pytest.raises(ModelError, match="rearranged"):
        compile_sources(rearranged(tmp_path, "Lag_3sources", {BUILD: described}), tmp_path / "out.fmu")


def test_no_compiler_says_how_to_get_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda _name: None)
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)
    with pytest.raises(ModelError, match="pip install ziglang"):
        compiler()


@needs_compiler
def test_what_is_wrong_in_a_source_of_another_encoding_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.c").write_bytes(b"int a = unknown; /* gr\xf6\xdfe */")
    with pytest.raises(ModelError, match=r"(?s)do not compile.*unknown"):
        compile_c(tmp_path, tmp_path, ["-c", "a.c"])


@needs_compiler
@pytest.mark.skipif(this_platform() != "x86_64-linux", reason="the library of the test is for Linux")
def test_libraries_beside_that_of_an_fmu_are_found_but_none_that_its_process_needs(tmp_path: Path) -> None:
    place, bad = "binaries/linux64/", ("libm.so.6", "libpthread.so.0")
    (tmp_path / "stub.c").write_text("int unused;")
    files: dict[str, str | bytes] = {place + name: "no library: it cannot be loaded" for name in bad}
    for name in ("libhelper.so", bad[1]):
        (tmp_path / name).write_bytes(read_entry(fixtures.path("Lag_2"), f"{place}Lag.so"))
    needed = ["-L.", "-Wl,--no-as-needed", "-l:libhelper.so", f"-l:{bad[1]}", "-o", "Lag.so"]
    compile_c(tmp_path, tmp_path, ["-shared", "-fPIC", str(tmp_path / "stub.c"), *needed])
    files |= {place + name: (tmp_path / name).read_bytes() for name in ("Lag.so", "libhelper.so")}
    files["modelDescription.xml"] = read_entry(fixtures.path("Lag_2"), "modelDescription.xml")
    models = FmuModel(packed(tmp_path / "a.fmu", files)), fixtures.isolated("Lag_2")
    found, known = (run(model, ("y",), signals={"u": ramp(1.0)})["y"].tolist() for model in models)
    assert found == known
    (folder := tmp_path / "0" / place).mkdir(parents=True)
    for names in (("Lag.so", "liba.so"), ("libb.so",)):  # the second one by an FMU that runs
        for name in names:
            (folder / name).touch()
        assert {file.name for file in _libraries(tmp_path)} == {"Lag.so", "liba.so"}


# Long enough not to be repeated to find out how the next simulation may start.
SLOW_AND_ONCE = """#define _GNU_SOURCE
#include <stdlib.h>
#include <time.h>
static void crash_twice(void) { static int made; if (made++) abort(); }
static void sleep_a_bit(void) { nanosleep(&(struct timespec){0, 600000000}, NULL); }
"""


@needs_compiler
def test_a_second_instance_that_crashes_is_not_tried_again_after_long_simulations(tmp_path: Path) -> None:
    shell = text_of("Lag_2sources", "sources/shell2.c")
    for after, call in (("Instance *m = create();", "crash_twice();"), ("m->time = time;", "sleep_a_bit();")):
        shell = shell.replace(after, f"{call} {after}", 1)
    source = rearranged(tmp_path, "Lag_2sources", {"sources/shell2.c": SLOW_AND_ONCE + shell})
    model = FmuModel(compile_sources(source, tmp_path / "out.fmu"))
    for _ in range(2):
        run(model, ("x",), interval=0.5)
    (found,) = fixtures.runners(model)
    assert found.untrusted == ("reset", "state", "instance")


@needs_compiler
def test_a_value_that_is_set_no_more_is_not_kept_by_a_reset(tmp_path: Path) -> None:
    reset = "const double gain = ((Instance *)c)->v[GAIN]; restart(c); ((Instance *)c)->v[GAIN] = gain;"
    shell = text_of("Lag_2sources", "sources/shell2.c").replace("restart(c);", reset, 1)
    source = rearranged(tmp_path, "Lag_2sources", {"sources/shell2.c": shell})
    model = FmuModel(compile_sources(source, tmp_path / "out.fmu"))
    given: tuple[dict[str, float], ...] = ({}, {}, {"gain": 3.0}, {})
    ends = [run(model, ("y",), signals={"u": ramp(1.0)}, parameters=each)["y"][-1] for each in given]
    assert ends == [ends[0], ends[0], 3.0 * ends[0], ends[0]] and fixtures.runner(model).reuse == "reset"


BECOMES = """
for (int k = 0; k < 40; k++) {
    char name[4096];
    snprintf(name, sizeof name, "PLACE/%d", k);
    open(name, O_WRONLY | O_CREAT, 0600);
}
execl("/bin/true", "true", (char *)0);
m->time = time;"""


@needs_compiler
def test_what_ended_a_process_is_told_after_much_that_was_refused(tmp_path: Path) -> None:
    if "not enforce" in rights_text():
        pytest.skip("this machine does not tell all that is refused")
    shell = text_of("Lag_2sources", "sources/shell2.c")
    shell = shell.replace("m->time = time;", BECOMES.replace("PLACE", str(tmp_path)), 1)
    shell = f"#include <fcntl.h>\n#include <unistd.h>\n{shell}"
    source = rearranged(tmp_path, "Lag_2sources", {"sources/shell2.c": shell})
    model = FmuModel(compile_sources(source, tmp_path / "out.fmu"), allow=("programs",))
    with pytest.raises(SimulationError, match="the FMU replaced its program by /bin/true; the FMU tried to"):
        run(model, ("x",))
