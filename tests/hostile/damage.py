"""Damage to the content of a file, random with a seed."""

from collections.abc import Callable
from random import Random

Damage = Callable[[bytes, Random], bytes]


def flip(content: bytes, random: Random) -> bytes:
    changed = bytearray(content)
    changed[random.randrange(len(changed))] ^= 1 << random.randrange(8)
    return bytes(changed)


def cut(content: bytes, random: Random) -> bytes:
    return content[: random.randrange(len(content))]


def lose_line(content: bytes, random: Random) -> bytes:
    lines = content.splitlines(keepends=True)
    del lines[random.randrange(len(lines))]
    return b"".join(lines)


def double_line(content: bytes, random: Random) -> bytes:
    lines = content.splitlines(keepends=True)
    lines.insert(random.randrange(len(lines) + 1), random.choice(lines))
    return b"".join(lines)


def swap_lines(content: bytes, random: Random) -> bytes:
    lines = content.splitlines(keepends=True)
    i, j = random.randrange(len(lines)), random.randrange(len(lines))
    lines[i], lines[j] = lines[j], lines[i]
    return b"".join(lines)


def blank(content: bytes, random: Random) -> bytes:
    """Fill a block with zeros, as a file system may after a power failure."""
    start = random.randrange(len(content))
    end = min(len(content), start + random.randrange(1, 200))
    return content[:start] + bytes(end - start) + content[end:]


DAMAGES: tuple[Damage, ...] = (flip, flip, flip, cut, lose_line, double_line, swap_lines, blank)
