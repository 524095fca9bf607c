import os
from hashlib import sha256
from pathlib import Path

import pytest

from falsifier.context.gather import MAX_TOTAL, gather
from falsifier.context.values import Compared, Context
from falsifier.core.files import bundled
from falsifier.errors import SpecError
from tests.fixtures import simulink
from tests.fixtures.archives import packed

SIGNALS = ("trips", "temperature", "power", "limp", "disagreement")
LIMP = bundled("fmus").parent / "modelica" / "Faults" / "HeaterLimpHome.mo"


def read(*files: Path) -> Context:
    return gather(map(str, files), [], seeds=["trips"], signals=SIGNALS)


def test_thresholds_stand_with_their_signals(tmp_path: Path) -> None:
    context = read(LIMP, simulink.write_slx(tmp_path / "limphome.slx"))
    assert "disagreement > enterAbove (enterAbove = 6.8)" in context.of("disagreement")
    assert "disagreement > 6.8" in context.of("disagreement")
    assert "temperature >= 64" in context.of("temperature")
    assert "set by the chart Mode logic with the states Normal, Limp" in context.of("limp")[0]
    others = [c.text for c in context.comparisons if not c.signals]
    assert "pause * period >= settling (period = 0.1, settling = 1.5)" in others
    first, second = context.excerpts
    assert (first.form, first.sha256) == ("whole", sha256(LIMP.read_bytes()).hexdigest())
    assert second.form == "structure, as far as the requirement depends on it"


def test_a_source_of_one_component_is_found_by_the_names_of_a_system() -> None:
    signals = ["bath.trips", "bath.disagreement", "other.disagreement"]
    context = gather([str(LIMP)], [], seeds=["bath.trips"], signals=signals)
    assert context.of("bath.disagreement") == context.of("other.disagreement") != ()


def test_a_file_that_is_too_long_is_summarized(tmp_path: Path) -> None:
    path = tmp_path / "notes.md"
    path.write_text("# Title\n\nThe power is limited.\n\n" + "Many words. " * 2000)
    (excerpt,) = read(path).excerpts
    assert excerpt.form == "headings, and paragraphs that name a signal, because the rest is too long"
    assert excerpt.text == "# Title\n\nThe power is limited."


def test_a_file_that_is_named_in_two_ways_is_told_once(tmp_path: Path) -> None:
    path = tmp_path / "notes.md"
    path.write_text("The power is limited.")
    files = [str(path), f"{tmp_path}/../{tmp_path.name}/notes.md"]
    context = gather(files, [], seeds=["trips"], signals=SIGNALS)
    assert [each.path for each in context.excerpts] == [str(path)]


def test_of_a_long_table_the_lines_that_name_a_signal_are_told(tmp_path: Path) -> None:
    path = tmp_path / "levels.csv"
    path.write_text("name;level\n" + "other;1\n" * 2000 + "power;0.8\n" + "other;2\n" * 2000)
    (excerpt,) = read(path).excerpts
    assert excerpt.form == "lines that name a signal, because the rest is too long"
    assert excerpt.text == "power;0.8"


def test_comparisons_that_do_not_fit_are_counted(tmp_path: Path) -> None:
    path = tmp_path / "a.c"
    path.write_text("".join(f"if (power > {i}) return;\n" for i in range(100)))
    assert read(path).comparisons[-1] == Compared((), "... (40 more)")


def test_all_files_together_fit(tmp_path: Path) -> None:
    paths = [tmp_path / f"{i}.md" for i in range(4)]
    for path in paths:
        path.write_text(f"# {path.name}\n\n" + "Words. " * 1500)
    context = read(*paths)
    assert sum(len(e.text) for e in context.excerpts) <= MAX_TOTAL
    assert len(context.excerpts) == 4
    assert context.excerpts[-1].form == "whole"


def test_secrets_are_refused_with_file_and_line(tmp_path: Path) -> None:
    path = tmp_path / "notes.md"
    path.write_text("fine\nkey: sk-abcdefghijklmnop\n")
    with pytest.raises(SpecError, match=r"notes\.md: line 2 looks like a key") as error:
        read(path)
    assert "sk-" not in str(error.value)


def test_a_secret_in_a_part_of_a_simulink_file_names_the_part(tmp_path: Path) -> None:
    parts = simulink.newer_parts()
    parts["simulink/systems/system_4.xml"] = parts["simulink/systems/system_4.xml"].replace(
        'Name="Gain"', 'Name="Gain" note="sk-abcdefghijklmnop"'
    )
    with pytest.raises(SpecError, match=r"limphome\.slx: simulink/systems/system_4\.xml: line \d+ looks"):
        read(simulink.write_slx(tmp_path / "limphome.slx", parts))


def test_a_secret_behind_an_encoding_is_refused_as_well(tmp_path: Path) -> None:
    parts: dict[str, str | bytes] = dict(simulink.newer_parts())
    system = simulink.newer_parts()["simulink/systems/system_4.xml"]
    system = system.replace('Name="Proportional"', 'Name="sk-abcdefghijklmnop"')
    system = system.replace('encoding="utf-8"', 'encoding="utf-16"')
    parts["simulink/systems/system_4.xml"] = system.encode("utf-16")
    with pytest.raises(SpecError, match=r"limphome\.slx, as it is told: line \d+ looks like a key"):
        read(simulink.write_slx(tmp_path / "limphome.slx", parts))


@pytest.mark.parametrize("text", ['["sk\\u002dabcdefghijklmnop"]', '["https:\\/\\/me:secret1@example.org"]'])
def test_escapes_of_json_hide_no_secret(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(SpecError, match=r"a\.json, as it is told: line 1 looks like a key"):
        read(tmp_path / "a.json")


def test_missing_and_binary_files_are_named(tmp_path: Path) -> None:
    (tmp_path / "loop.md").symlink_to("loop.md")
    for name in ("none", "loop"):
        with pytest.raises(SpecError, match=rf"{name}\.md: cannot be read"):
            read(tmp_path / f"{name}.md")
    (tmp_path / "a.bin").write_bytes(b"\0\1\2")
    with pytest.raises(SpecError, match=r"a\.bin: expected text or a Simulink file"):
        read(tmp_path / "a.bin")


def fmu_with(path: Path, **entries: bytes) -> Path:
    return packed(path, {f"documentation/{name}.md": content for name, content in entries.items()})


def test_binary_data_inside_an_fmu_is_left_out_with_a_note(tmp_path: Path) -> None:
    told = "trips count".encode("utf-16")
    fmu = fmu_with(tmp_path / "m.fmu", picture=b"\x7f\0", words=told)
    context = gather([], [fmu], seeds=["trips"], signals=SIGNALS)
    assert [e.text for e in context.excerpts] == ["trips count"]
    assert context.notes == ("context m.fmu: documentation/picture.md is left out, because it is not text",)


def test_a_secret_inside_an_fmu_says_how_to_do_without(tmp_path: Path) -> None:
    fmu = fmu_with(tmp_path / "m.fmu", notes=b"trips\npassword: operators know it")
    name = "m.fmu: documentation/notes.md"
    with pytest.raises(SpecError, match=rf"{name}: line 2 .*unpack the FMU.*checked:{name}"):
        gather([], [fmu], seeds=["trips"], signals=SIGNALS)
    context = gather([], [fmu], seeds=["trips"], signals=SIGNALS, checked=[name])
    assert "operator" in context.excerpts[0].text
    assert context.notes == (
        f"context {name}: line 2 looks like a key, token or password, and was allowed",
        f"context {name}, as it is told: line 2 looks like a key, token or password, and was allowed",
    )


def test_the_inside_of_an_fmu_is_told_as_far_as_it_concerns_the_signals() -> None:
    fmu = bundled("fmus") / "HeaterLimpHome.fmu"
    assert gather([], [fmu], seeds=["trips"], signals=SIGNALS) == Context()  # generated code with arrays


def test_only_files_are_read(tmp_path: Path) -> None:
    for name in (str(tmp_path), os.devnull):  # a device or pipe might never end
        with pytest.raises(SpecError, match="expected a file"):
            gather([name], [], seeds=(), signals=())


def test_folders_of_the_machine_are_recorded_and_not_told(tmp_path: Path) -> None:
    source = tmp_path / "a.mo"
    source.write_text("model A\n Real trips;\n input Real power;\nequation\n trips = power > 3;\nend A;\n")
    (broken := tmp_path / "b.mo").write_text("model B\n Real trips;\n")
    context = read(source, broken, simulink.write_slx(tmp_path / "limphome.slx"))
    assert [e.name for e in context.excerpts] == ["a.mo", "b.mo", "limphome.slx"]
    assert context.excerpts[0].path == str(source)
    assert not [e for e in context.excerpts if str(tmp_path) in e.text + e.form]
    assert not [c for c in context.comparisons if str(tmp_path) in c.text]


def test_comparisons_count_among_the_characters(tmp_path: Path) -> None:
    path, text = tmp_path / "a.c", "void step(M *m) {\n"
    for i in range(80):
        text += f"  if (m->power{'_long' * 20}{i} > {i}.25) m->trips = {i};\n"
    path.write_text(f"{text}}}\n")
    (tmp_path / "b.md").write_text("The power matters. " * 600)
    context = read(path, tmp_path / "b.md")
    size = sum(len(c.text) for c in context.comparisons[:-1])
    assert 5_000 < size <= 6_000
    assert size + sum(len(e.text) + len(e.name) + len(e.form) for e in context.excerpts) <= MAX_TOTAL


def test_levels_of_inputs_within_their_ranges_are_crossings(tmp_path: Path) -> None:
    path = tmp_path / "a.c"
    limits = "".join(f"if (m->power > {i}) m->trips = {i};\n" for i in range(1, 90))
    path.write_text(f"void step(M *m) {{ {limits} if (m->power + m->limp > 0.5) m->trips = 0; }}")
    ranges = {"plant.power": (3.0, 50.0), "limp": (0.0, 9.0)}
    read_only = gather([str(path)], [], seeds=(), signals=(), ranges=ranges, is_told=False)
    assert read_only == Context(crossings=read_only.crossings)
    assert [(c.signal, c.value) for c in read_only.crossings] == [("plant.power", i) for i in range(3, 27)]
