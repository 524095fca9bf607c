"""What does it bring that searches record states and modes that are no outputs?

Three bundled FMUs, as an author exports them who states only what he requires: all outputs but those of the
formula become internal variables. Searched by the default engine, without them (``omit``) and with them. A
cell is as in ``bench.unseen``: mean simulations, a miss counted as the budget, and how many runs violated.

    python -m bench.hidden_outputs
"""

import argparse
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree

from bench.search import seeds_from
from bench.unseen import cell, own
from falsifier import load_problem
from falsifier.core.files import bundled
from tests.fmu.fixtures import altered

SYSTEMS = ("PulseMeter", "ChargerHandshake", "HeaterLimpHome")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=seeds_from, default=range(10), help="for example 0-9")
    parser.add_argument("--budget", type=int, default=300)
    options = parser.parse_args()
    print("| requirement | internal variables | without them | with them |\n|---|---|---|---|")
    with TemporaryDirectory() as folder:
        for name in SYSTEMS:
            target = f"{_hidden(name, Path(folder))}:{name}"
            names = load_problem(target).internals
            cells = []
            for omit in (names, ()):
                problem = load_problem(target, omit=omit)
                runs = [own(problem, "surrogate", seed=s, budget=options.budget) for s in options.seeds]
                cells.append(cell(runs))
            print(f"| {name} | {', '.join(names)} | {' | '.join(cells)} |", flush=True)


def _hidden(name: str, folder: Path) -> Path:
    """Write the FMU with one kind of outputs, and its spec, whose path is returned."""
    compared = load_problem(name).requirement.formula.signals

    def hide(description: bytes) -> bytes:
        root = ElementTree.fromstring(description)
        outputs = root.find("ModelStructure/Outputs")
        assert outputs is not None
        for index, variable in enumerate(root.iterfind("ModelVariables/ScalarVariable"), start=1):
            if variable.get("causality") == "output" and variable.get("name") not in compared:
                variable.set("causality", "local")
                for unknown in outputs.findall(f"Unknown[@index='{index}']"):
                    outputs.remove(unknown)
        return bytes(ElementTree.tostring(root, encoding="utf-8", xml_declaration=True))

    altered(bundled("fmus") / f"{name}.fmu", folder / f"{name}.fmu", hide, ending="modelDescription.xml")
    spec = folder / f"{name}.toml"
    text = (bundled("specs") / spec.name).read_text(encoding="utf-8")
    spec.write_text(text.replace(f"../fmus/{name}.fmu", f"{name}.fmu"), encoding="utf-8")
    return spec


if __name__ == "__main__":
    main()
