"""Specs that several tests load."""

from pathlib import Path

from falsifier.core.files import bundled
from falsifier.problem.loading import load_problem
from falsifier.problem.problem import Problem
from tests.fmu.fixtures import path as fmu_path

AT = bundled("fmus") / "AT.fmu"
GOOD = """
[model]
fmu = "AT.fmu"
interface = "co-simulation"
[inputs.throttle]
control_points = 7
[inputs.brake]
value = 0
[parameters]
finalDrive = 3.0
rollingLoad.range = [30, 50]
[requirements.R]
formula = "G[0,20] (speed <= 120)"
"""


def spec(folder: Path, text: str) -> str:
    (folder / "my.toml").write_text(text)
    return str(folder / "my.toml")


ECHO = """
[model]
fmu = "{fmu}"
stop_time = 1.0
output_interval = 0.1
[inputs]
{inputs}
[requirements.R]
formula = "G (out_Int8 <= 1000)"
"""


def echo(tmp_path: Path, inputs: str) -> Problem:
    path = tmp_path / "echo.toml"
    path.write_text(ECHO.format(fmu=fmu_path("Echo_3").as_posix(), inputs=inputs))
    return load_problem(str(path))
