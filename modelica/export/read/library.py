"""Finds classes by name: packages on disk, enclosing classes, imports, inheritance."""

from __future__ import annotations

from pathlib import Path

from .classes import parse_file
from .syntax import Class, Component, ExportError, Modifier, Place

BUILTIN_TYPES = ("Real", "Integer", "Boolean", "String")


def load(path: Path) -> Class:
    """Load a package directory or a single file.

    Args:
        path: a directory with `package.mo`, or a `.mo` file.

    Returns:
        A nameless root class that contains the loaded classes.
    """
    root = Class("", "package", "", Place(path.name, 1))
    if path.is_dir():
        _directory(path, root, path.name)
    elif path.is_file():
        _file(path, root, path.name)
    else:
        raise ExportError(None, f"{path} does not exist; give a .mo file or a directory with a package.mo")
    return root


def _file(path: Path, owner: Class, shown: str) -> list[Class]:
    found = parse_file(path, shown)
    for item in found:
        item.parent = owner
        owner.classes[item.name] = item
    return found


def _directory(path: Path, owner: Class, shown: str) -> None:
    if not (path / "package.mo").is_file():
        raise ExportError(None, f"{path} has no package.mo; give a .mo file or a directory with one")
    package = _file(path / "package.mo", owner, f"{shown}/package.mo")[0]
    for entry in sorted(path.iterdir()):
        if entry.is_dir() and (entry / "package.mo").is_file():
            _directory(entry, package, f"{shown}/{entry.name}")
        elif entry.suffix == ".mo" and entry.name != "package.mo":
            _file(entry, package, f"{shown}/{entry.name}")


def base_classes(cls: Class) -> list[tuple[Class, Modifier]]:
    """Return the classes that `cls` extends, with their modifiers."""
    scope = cls.parent or cls
    return [(find_class(item.name, scope, item.place, cls), item.modifier) for item in cls.extends]


def member_class(cls: Class, name: str) -> Class | None:
    """Return a class that is defined in `cls` or inherited by it; None if there is none."""
    if name in cls.classes:
        return cls.classes[name]
    for base, _ in base_classes(cls):
        found = member_class(base, name)
        if found:
            return found
    return None


def member_component(cls: Class, name: str) -> tuple[Component, Class] | None:
    """Return a component of `cls` or its bases, and the class that declares it; None if there is none."""
    for component in cls.components:
        if component.name == name:
            return component, cls
    for base, _ in base_classes(cls):
        found = member_component(base, name)
        if found:
            return found
    return None


def _root(cls: Class) -> Class:
    while cls.parent:
        cls = cls.parent
    return cls


def absolute(name: str, root: Class) -> Class | None:
    """Return a class by its full name; None if there is none."""
    current: Class | None = root
    for part in name.split("."):
        current = member_class(current, part) if current else None
    return current


def find_class(name: str, scope: Class, place: Place, avoid: Class | None = None) -> Class:
    """Look up a class by the rules of Modelica.

    Raises:
        ExportError: if there is none.
    """
    found = lookup(name, scope, avoid)
    if found is None:
        raise ExportError(
            place, f"there is no class '{name}' here (the Modelica Standard Library is not available)"
        )
    return found


def lookup(name: str, scope: Class, avoid: Class | None = None) -> Class | None:
    """Look up a class; return None if there is none.

    Args:
        name: dotted name.
        scope: class in which the name is used.
        avoid: a class that extends a base class with its own name; it is not its own base class.
    """
    first, *rest = name.split(".")
    current: Class | None = _first(first, scope, avoid)
    for part in rest:
        current = member_class(current, part) if current else None
    return current


def _first(name: str, scope: Class, avoid: Class | None) -> Class | None:
    level: Class | None = scope
    while level is not None:
        if name in level.classes and level.classes[name] is not avoid:
            return level.classes[name]
        if level is not avoid:
            for base in level.extends:
                found = lookup(base.name, level.parent or level, level)
                inherited = member_class(found, name) if found else None
                if inherited:
                    return inherited
        for item in level.imports:
            if item.alias == name:
                return absolute(item.name, _root(scope))
            if item.alias == "*":
                package = absolute(item.name, _root(scope))
                if package is None:
                    raise ExportError(item.place, f"there is no package '{item.name}' to import")
                if name in package.classes:
                    return package.classes[name]
        level = level.parent
    return None


def enumeration(cls: Class | None) -> Class | None:
    """The enumeration that a class is or stands for, None for any other class."""
    while cls is not None and cls.alias_of:
        cls = lookup(cls.alias_of.name, cls.parent or cls)
    return cls if cls is not None and cls.literals else None


def find_constant(name: str, scope: Class) -> tuple[Component, Class] | None:
    """Return a component of an enclosing package or of a named one, such as `Data.gain` or `gain`."""
    *path, last = name.split(".")
    if path:
        owner = lookup(".".join(path), scope)
        if owner is None:
            return None
        return member_component(owner, last)
    level: Class | None = scope
    while level is not None:
        found = member_component(level, last)
        if found:
            return found
        for item in level.imports:
            package, _, member = item.name.rpartition(".")
            if item.alias == last and package:
                owner = absolute(package, _root(scope))
                return member_component(owner, member) if owner else None
            if item.alias == "*":
                owner = absolute(item.name, _root(scope))
                found = member_component(owner, last) if owner else None
                if found:
                    return found
        level = level.parent
    return None
