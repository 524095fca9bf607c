"""The model that a spec names: one FMU, or a system of several."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from falsifier import fmu
from falsifier.core.files import absent
from falsifier.core.model import Interface, Model, ModelInfo
from falsifier.errors import SpecError, in_section
from falsifier.problem.sections import ModelChanges, Simulation
from falsifier.problem.spec import Spec


def make_model(spec: Spec, layers: Sequence[ModelChanges], path: Path) -> Model:
    """Return the model of a spec.

    Layers override the spec, and later ones earlier ones. ``path`` is that of the spec file, for relative
    paths and error messages.

    Raises:
        SpecError: naming the file, the key and the remedy.
        ModelError: if an FMU cannot be read.
    """
    sections = [*reversed(layers), spec.model]
    logging = next((each.logging for each in sections if each.logging is not None), False)
    interface = next((each.interface for each in sections if each.interface), None)
    allow, deny = rights_of(path, sections[::-1])
    if spec.is_system:
        if interface == "model-exchange":
            raise SpecError(
                "components of a system have interfaces of their own; set components.NAME.interface and "
                "remove this key",
                key="model.interface",
            )
        return replace(make_system(spec, path, logging=logging), allow=allow, deny=deny)
    file = existing_fmu(path, spec.model.fmu or "")
    return fmu.FmuModel(
        file, interface=_interface(interface, fmu.read_info(file)), logging=logging, allow=allow, deny=deny
    )


def rights_of(path: Path | None, sections: Sequence[Simulation]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return what the FMUs may do and may not do, as these sections say together.

    ``path`` is that of the spec file, if there is one. SpecError naming what is unknown.
    """
    words = [word for section in sections for word in section.allow]
    allow = fmu.resolved(words, path.parent if path is not None else Path())
    deny = tuple(word for section in sections for word in section.deny)
    with in_section(*((str(path), "model") if path is not None else ())):
        fmu.Rights.of(allow, deny)
    return allow, deny


def make_system(spec: Spec, path: Path, *, logging: bool = False) -> fmu.System:
    """Return the system of a spec that has one.

    Raises:
        SpecError: naming the file, both ends of a connection that does not fit, and the remedy.
        ModelError: if an FMU cannot be read.
    """
    with in_section(str(path)):
        coupling = fmu.Coupling(**spec.coupling.model_dump())
        if spec.model.fmu is not None:
            package = fmu.read_package(existing_fmu(path, spec.model.fmu), coupling=coupling)
            return replace(package, logging=logging)
        components = {
            name: fmu.Component(
                existing_fmu(path, part.fmu, f"components.{name}.fmu"), part.step, part.interface
            )
            for name, part in spec.components.items()
        }
        connections = {
            target: fmu.Connection(each.source, each.factor, each.offset, each.extrapolation)
            for target, each in spec.connections.items()
        }
        return fmu.System(components, connections, coupling=coupling, name=path.stem, logging=logging)


def existing_fmu(path: Path, named: str, key: str = "model.fmu") -> Path:
    """Return the FMU that the spec at a path names at a key; SpecError if there is none."""
    if fmu.is_package(named) and key != "model.fmu":
        raise SpecError(
            "an SSP package cannot be a component; name it as fmu in [model], or its FMUs here", key=key
        )
    found = path.parent / named
    if not found.is_file():
        raise SpecError(f"{absent(found.resolve())}; give an FMU's path relative to the spec file", key=key)
    return found


def _interface(stated: Interface | None, info: ModelInfo) -> Interface:
    """Return the stated interface, if the FMU offers it, or the only one that it offers.

    If it offers none, FmuModel says so.
    """
    if not info.interfaces or (stated is None and len(info.interfaces) == 1):
        return info.default_interface
    if stated is None or stated not in info.interfaces:
        advice = "; set this key to one of them" if stated is None else f", not {stated}; change this key"
        raise SpecError(f"the FMU offers {' and '.join(info.interfaces)}{advice}", key="model.interface")
    return stated
