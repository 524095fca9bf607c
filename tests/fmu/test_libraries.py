from falsifier.fmu.archive import WINDOWS, library_file
from falsifier.fmu.libraries import find_libraries, missing_binary_text

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
