"""SSP files made by hand, by the standard: what tools write, and what is wrong with some."""

from pathlib import Path

from tests.fixtures.archives import packed
from tests.fmu.fixtures import path

NAMESPACES = " ".join(
    f'xmlns:{short}="http://ssp-standard.org/SSP1/SystemStructure{name}"'
    for short, name in (
        ("ssc", "Common"),
        ("ssd", "Description"),
        ("ssv", "ParameterValues"),
        ("ssm", "ParameterMapping"),
    )
)
PLANT = """<ssd:Component name="plant" source="resources/Plant_2.fmu"><ssd:Connectors>
  <ssd:Connector name="u" kind="input"><ssc:Real unit="m"/></ssd:Connector>
  <ssd:Connector name="y" kind="output"><ssc:Real unit="m"/></ssd:Connector>
  <ssd:Connector name="T" kind="parameter"><ssc:Real/></ssd:Connector>
</ssd:Connectors></ssd:Component>"""
PI = """<ssd:Component name="pi" source="resources/Gain_2.fmu" type="application/x-fmu-sharedlibrary">
<ssd:Connectors>
  <ssd:Connector name="r" kind="input"><ssc:Real/></ssd:Connector>
  <ssd:Connector name="measured" kind="input"><ssc:Real unit="m"/></ssd:Connector>
  <ssd:Connector name="y" kind="output"><ssc:Real/></ssd:Connector>
</ssd:Connectors></ssd:Component>"""
FEEDBACK = """
<ssd:Connection startElement="pi" startConnector="y" endElement="plant" endConnector="u"/>
<ssd:Connection startElement="pi" startConnector="measured" endElement="plant" endConnector="y"/>"""


def system(elements: str, connections: str = "", *, before: str = "", name: str = "root") -> str:
    """A System element."""
    wires = f"<ssd:Connections>{connections}</ssd:Connections>" if connections else ""
    return f'<ssd:System name="{name}">{before}<ssd:Elements>{elements}</ssd:Elements>{wires}</ssd:System>'


def structure(root: str, *, after: str = "", version: str = "1.0") -> str:
    """The text of SystemStructure.ssd."""
    return (
        f'<?xml version="1.0" encoding="UTF-8"?><ssd:SystemStructureDescription {NAMESPACES} '
        f'version="{version}" name="test">{root}{after}</ssd:SystemStructureDescription>'
    )


def values(*parameters: str) -> str:
    """A parameter set, each parameter as ``name type value [unit]``."""
    entries = ""
    for parameter in parameters:
        name, kind, value, *unit = parameter.split(" ")
        stated = f' unit="{unit[0]}"' if unit else ""
        entries += f'<ssv:Parameter name="{name}"><ssv:{kind} value="{value}"{stated}/></ssv:Parameter>'
    parameters_of = f"<ssv:Parameters>{entries}</ssv:Parameters>"
    return f'<ssv:ParameterSet {NAMESPACES} version="1.0" name="p">{parameters_of}</ssv:ParameterSet>'


def write(file: Path, ssd: str, *fmus: str, more: dict[str, str | bytes] | None = None) -> Path:
    """Write an .ssp, or an .ssd with its resources beside it."""
    resources: dict[str, str | bytes] = {f"resources/{n}.fmu": path(n).read_bytes() for n in fmus}
    resources |= more or {}
    if file.suffix == ".ssd":
        for name, content in {file.name: ssd, **resources}.items():
            target = file.parent / name
            target.parent.mkdir(exist_ok=True)
            target.write_bytes(content if isinstance(content, bytes) else content.encode())
        return file
    return packed(file, {"SystemStructure.ssd": ssd, **resources})
