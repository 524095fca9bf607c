"""What FMUs may do: in words, and as the guard of a worker is told."""

import struct
from pathlib import Path

from falsifier.core.model import ModelInfo
from falsifier.fmu.description.model_description import Description
from falsifier.fmu.description.variables import Slot
from falsifier.fmu.process import encoding
from falsifier.fmu.process.rights import Rights, described, encoded, hidden_places, read_told
from falsifier.fmu.process.workplace import MORE, worker_environment

ALL = 15


def test_keys_are_hidden_by_every_path_that_leads_to_them(tmp_path: Path) -> None:
    elsewhere, home = tmp_path / "elsewhere", tmp_path / "home"
    elsewhere.mkdir()
    home.mkdir()
    (home / ".ssh").symlink_to(elsewhere)
    named = {"GOOGLE_APPLICATION_CREDENTIALS": str(tmp_path / "key.json"), "XDG_CONFIG_HOME": str(home)}
    hidden = hidden_places(named, [home], is_root=False)
    assert {str(home / ".ssh"), str(elsewhere), str(home / ".netrc"), str(tmp_path / "key.json")} <= {*hidden}
    assert str(home) not in hidden, "an FMU may need the rest of the home"
    assert "/etc/shadow" not in hidden
    assert "/etc/shadow" in hidden_places({}, [home], is_root=True)


def test_the_guard_is_told_paths_without_links(tmp_path: Path) -> None:
    (tmp_path / "logs").mkdir()
    (tmp_path / "link").symlink_to("logs")
    policy = Rights.of([f"write:{tmp_path / 'link'}", "programs"], ["network"])
    told = encoded(policy, [tmp_path], ["/hidden"], memory=7)
    assert int.from_bytes(told[:4], "little") == len(told) - 4
    real = str(tmp_path.resolve())
    assert told[4:].decode().split("\0") == [f"W{real}", f"W{real}/logs", "H/hidden", "P", "M7", ""]


def test_at_the_command_line_the_way_out_is_written_as_a_shell_takes_it(at_the_command_line: None) -> None:
    assert "`--allow 'write:/my logs'`" in read_told(b"w/my logs/x\0").refusals


def test_what_was_refused_is_told_with_the_way_out() -> None:
    told = read_told(b"w/etc/x\0w/etc/x\0x/bin/sh\0s\0")
    assert told.cause == "" and told.refusals.count("/etc/x") == 1
    for said in ("allow=['write:/etc']", "/bin/sh", "allow=['programs']", "signal"):
        assert said in told.refusals
    assert "allow=['write:/my logs']" in read_told(b"w/my logs/x\0").refusals
    # A file without a name in a folder that exists: advice for what is above would allow too much.
    assert "allow=['write:/usr']" in read_told(b"w/usr\0").refusals
    assert "more than 9 processes" in read_told(b"f9 processes\0").refusals
    assert "\x1b" not in read_told(b"w/\x1b[2J\xff\0").refusals
    assert read_told(b"r/bin/true\0").cause.endswith("/bin/true")
    assert read_told(b"") == read_told(b"?unknown\0")


def test_one_line_says_what_is_allowed_and_what_is_not_enforced() -> None:
    may, may_not = described(Rights(), ALL).split("may not")
    assert "network" in may and "programs" in may_not and "enforce" not in may_not
    rights = Rights((Path("/data/logs"),), programs=True, network=False)
    may, may_not = described(rights, ALL).split("may not")
    assert "/data/logs" in may and "programs" in may and "network" in may_not
    assert "other known places of keys" in may_not, "what may be changed may be read"
    may, may_not = described(Rights(readable=(Path("/home/me/.config"),)), ALL).split("may not")
    assert "read /home/me/.config" in may and "other known places of keys" in may_not
    _, filtered = described(Rights(), ALL - 4 - 8).split("not enforce")
    assert "change their settings" in filtered and "files" not in filtered, "no filter of system calls"
    _, nothing = described(Rights(network=False), 0).split("not enforce")
    for lacking in ("files", "keys", "processes", "connections", "programs"):
        assert lacking in nothing


GIVEN = {
    "PATH": "/bin",
    "PYTHONPATH": "/packages",
    "LC_ALL": "de_DE.UTF-8",
    "LM_LICENSE_FILE": "27000@server",
    "OPENAI_API_KEY": "a key",
    "MY_MODEL_DATA": "/data",
    "TMPDIR": "/elsewhere",
    "OMP_NUM_THREADS": "8",
}


def test_fmus_see_what_libraries_need_and_nothing_else() -> None:
    seen = worker_environment(GIVEN, Path("/work"))
    kept = ("PATH", "PYTHONPATH", "LC_ALL", "LM_LICENSE_FILE")
    assert {name: seen.pop(name) for name in kept} == {name: GIVEN[name] for name in kept}
    assert seen.pop("OMP_NUM_THREADS") == "1"
    assert {seen.pop(name) for name in ("TMPDIR", "TEMP", "TMP")} == {"/work"}
    assert seen.keys() <= {"OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"}


def test_further_variables_are_passed_on_by_name_but_no_keys() -> None:
    seen = worker_environment({**GIVEN, MORE: "MY_MODEL_DATA, OPENAI_API_KEY"}, Path("/work"))
    assert seen["MY_MODEL_DATA"] == "/data" and "OPENAI_API_KEY" not in seen


def test_a_negated_alias_has_the_other_sign() -> None:
    info = ModelInfo("M", fmi_version="1.0")
    slots = {"a": Slot(0, "Real"), "b": Slot(0, "Real", negated=True)}
    table = encoding.ports(Description(info, "", {}, slots), ["a", "b"])
    assert struct.unpack("<qqqdqqqqdq", table[-80:])[3::5] == (1.0, -1.0)
