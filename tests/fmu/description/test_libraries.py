import pytest

from falsifier.fmu.description import wine
from falsifier.fmu.description.archive import WINDOWS, library_file
from falsifier.fmu.description.libraries import find_libraries, misnamed_text, missing_binary_text

EXPECTED = library_file("2.0", "model")


def test_the_library_named_like_the_identifier_is_used() -> None:
    names = [EXPECTED.as_posix(), EXPECTED.with_name(f"helper{EXPECTED.suffix}").as_posix()]
    assert find_libraries(names, "2.0", {"co-simulation": "model"}) == ({"co-simulation": EXPECTED}, ())


def test_the_only_other_library_is_used_and_told_once() -> None:
    other = EXPECTED.with_name(f"other{EXPECTED.suffix}")
    identifiers = {"co-simulation": "model", "model-exchange": "model"}
    found, said = find_libraries([other.as_posix()], "2.0", identifiers)  # type: ignore[arg-type]
    assert set(found.values()) == {other}
    (text,) = said
    assert text.startswith(f"its library is called {other.name}, not {EXPECTED.name}; ")


def test_of_several_others_none_is_guessed() -> None:
    names = [EXPECTED.with_name(f"{name}{EXPECTED.suffix}").as_posix() for name in ("a", "b")]
    assert find_libraries(names, "2.0", {"co-simulation": "model"}) == ({}, ())


def test_libraries_of_another_platform_are_found_by_its_folder() -> None:
    names = ["binaries/win64/model.dll", "binaries/x86_64-windows/model.dll", "binaries/linux64/model.so"]
    for version, folder in (("2.0", "win64"), ("3.0", "x86_64-windows")):
        found, _ = find_libraries(names, version, {"co-simulation": "model"}, WINDOWS)
        assert found["co-simulation"].as_posix() == f"binaries/{folder}/model.dll"


def test_what_runs_through_wine_need_not_be_exported_again() -> None:
    alone = missing_binary_text("FMU", (WINDOWS,), has_sources=False, needs_wine=True)
    assert alone.endswith("only for x86_64-windows; that for Windows runs through Wine")
    assert missing_binary_text("FMU", (WINDOWS,), has_sources=False).endswith(
        "export it again for this platform"
    )


@pytest.fixture
def on_linux(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("falsifier.fmu.description.archive.this_platform", lambda: "x86_64-linux")


@pytest.mark.usefixtures("on_linux")
@pytest.mark.parametrize(
    ("platforms", "said"),
    [
        (("x86-windows",), "32-bit Windows cannot be run, because Wine is used for 64-bit Windows only"),
        (("x86_64-darwin", "aarch64-darwin"), "binaries for macOS run only there"),
        (("x86-linux", "x86-windows"), "a 32-bit binary cannot be loaded here"),
    ],
)
def test_each_kind_of_binary_that_does_not_help_is_told_why(platforms: tuple[str, ...], said: str) -> None:
    text = missing_binary_text("FMU", platforms, has_sources=False)
    assert text.startswith(f"no binary for x86_64-linux, only for {', '.join(platforms)}; ")
    assert said in text and text.count(";") == 2
    assert text.endswith(" or for 64-bit Windows") == ("x86-windows" in platforms)


@pytest.mark.usefixtures("on_linux")
def test_binaries_for_32_bit_windows_and_macos_are_both_told() -> None:
    text = missing_binary_text("FMU", ("x86-windows", "x86_64-darwin"), has_sources=False)
    assert "32-bit Windows" in text and "macOS" in text


@pytest.mark.usefixtures("on_linux")
def test_libraries_with_other_names_are_named() -> None:
    assert wine.can_run_windows()
    names = ["binaries/win64/b.dll", "binaries/win64/a.dll", "binaries/win64/a.lib", "binaries/win32/m.dll"]
    text = misnamed_text(names, "2.0", ["m", "m"])
    assert text.startswith("binaries/win64 contains a.dll, b.dll, but not m.dll, and ")
    both = [*names, "binaries/linux64/c.so", "binaries/linux64/d.so"]
    assert misnamed_text(both, "2.0", ["m", "n"]).startswith(
        "binaries/linux64 contains c.so, d.so, but not m.so or n.so, and "
    )
    assert misnamed_text(names[2:], "2.0", ["m"]) == ""
    assert misnamed_text([*names, "binaries/win64/m.dll"], "2.0", ["m"]) == ""
