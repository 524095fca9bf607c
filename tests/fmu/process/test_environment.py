"""What FMUs see of the environment."""

import struct
from pathlib import Path

from falsifier.core.model import ModelInfo
from falsifier.fmu.description import Description, Slot
from falsifier.fmu.process import encoding
from falsifier.fmu.process.program import MORE, worker_environment

GIVEN = {
    "PATH": "/bin",
    "LC_ALL": "de_DE.UTF-8",
    "LM_LICENSE_FILE": "27000@server",
    "OPENAI_API_KEY": "a key",
    "MY_MODEL_DATA": "/data",
    "TMPDIR": "/elsewhere",
    "OMP_NUM_THREADS": "8",
}


def test_fmus_see_what_libraries_need_and_nothing_else() -> None:
    seen = worker_environment(GIVEN, Path("/work"))
    kept = ("PATH", "LC_ALL", "LM_LICENSE_FILE")
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
