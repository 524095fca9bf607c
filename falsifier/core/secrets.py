"""Which options, variables and texts may hold secrets, and how these stay out of records and messages."""

import os
import re
from collections.abc import Iterable, Mapping
from typing import Any

# Options of litellm that carry or may carry a key.
_OPTION_NAMES = frozenset({"api_key", "headers", "extra_headers", "default_headers", "extra_body"})
_OPTION_NAME = re.compile(
    r"(^|_)(key|secret|password|credentials?|token|authorization|cookie)$", re.IGNORECASE
)
# FMUs may need variables of their exporting tool (licence server, runtime folder), so only variables whose
# name or value looks like a secret are removed.
_VARIABLE_NAME = re.compile(
    r"KEY|TOKEN|SECRET|PASS(?!IVE|AGE)|_PWD$|CREDENTIAL|AUTH|COOKIE|PRIVATE|BEARER|JWT|(^|_)PAT$"
    r"|^(AWS|AZURE|GOOGLE|OPENAI|ANTHROPIC|MISTRAL|GEMINI|COHERE|HF|GITHUB|GITLAB|VAULT|LITELLM|DATABASE)_",
    re.IGNORECASE,
)
# Shapes of well-known keys: OpenAI and providers with the same format, Hugging Face, Groq, xAI, NVIDIA,
# Perplexity, Google, GitHub, GitLab, Slack, AWS, Stripe, npm, PEM and PuTTY files, JSON web tokens.
_KEY_SHAPES = (
    r"(?<![a-zA-Z0-9])(?:sk|pk|rk)-[\w*-]{8,}",
    r"\b(?:hf|gsk|pplx|nvapi|xai)[-_][\w*-]{8,}",
    r"\bAIza[\w-]{20,}",
    r"\b(?:github_pat_|gh[opsur]_)\w{16,}",
    r"\bglpat-[\w-]{16,}",
    r"\bxox[abprs]-[\w-]{8,}",
    r"\b(?:AKIA|ASIA)[0-9A-Z]{12,}",
    r"\b(?:sk|rk)_(?:live|test)_\w{8,}",
    r"\bnpm_[a-zA-Z0-9]{30,}",
    r"-----BEGIN [A-Z ]*PRIVATE KEY(?: BLOCK)?-----",
    r"\bPuTTY-User-Key-File-\d",
    # Only where a word begins, so that time does not grow with the square of a text's length.
    r"(?<![\w-])eyJ[\w-]{10,}+\.[\w-]{10,}(?:\.[\w-]*)?",
)
# Passwords may contain an unescaped @ themselves.
_CREDENTIALS_IN_ADDRESS = r"(?<!mailto://)(?<=://)[^\s/?#'\"]+(?=@)"
_OWNER = r"(?:[\w.-]{0,40}?[_.-]|access|account|api|auth|client|private|secret|shared)?"
_NAMED = rf"(?:{_OWNER}(?:key|token|secret|passw(?:or)?d|pwd|sig|signature|auth|credentials?)|code)"
_NAMED_IN_QUERY = rf"(?i:[?&]{_NAMED}=)"
_LONG_KEY_IN_QUERY = rf"(?P<name>{_NAMED_IN_QUERY})[^\s&#'\"]{{6,}}"
_VALUE = re.compile("|".join((*_KEY_SHAPES, _CREDENTIALS_IN_ADDRESS, _LONG_KEY_IN_QUERY)))
# The same for an address alone: without a scheme too, and a password may contain a slash; a port is none.
_CREDENTIALS = re.compile(r"(?:.*?://)?(?:[^/?#]*@|[^/?#@:]*:(?!\d*(?:[/?#]|$))[^@]*@)")
_KEY_IN_QUERY = re.compile(rf"(?P<name>{_NAMED_IN_QUERY})(?P<key>[^\s&#'\"]+)")
# After the host; folders may begin like keys, such as hf-inference, but have no digits or are shorter.
_KEY_IN_PATH = re.compile("|".join(rf"(?<=[^/]/)(?=[^/]{{20}})(?=[^/]*\d){shape}" for shape in _KEY_SHAPES))
_IN_TEXT = re.compile(
    "|".join(
        (
            r"(?i:(?<=bearer ))[^\s'\",}]+",
            r"(?i:(?<=api[_-]key=))[^\s&'\"]+",
            _CREDENTIALS_IN_ADDRESS,
            *_KEY_SHAPES,
        )
    )
)
# A value given to something that is named like a secret, as in settings and scripts.
_ASSIGNED = re.compile(
    r"""(?ix) \b (?:\w*[_-])? (?:(?:client|shared)?secret|(?:shared)?access[_-]?key|(?:secret|account|api
    |private|encryption)[_-]?key|passwor[dt]|kennwort|passwd|passphrase|(?:auth|access|api|bearer|refresh)[_-]?token
    |credentials?|authorization) ["']? (?:\s*+ (?::?=|:) \s*+ | >) (?!mailto:)
    # A value that a program reads elsewhere is none: argv[1], os.environ, config.password.
    (?!(?:argv|args|options|params|config|settings|self|this|os|env|environ|process|getenv)\b\s*+(?:[.\[(]|->))
    ["']? [^\s"',;(){}<]{6,}"""
)
# The same without a sign: a macro, or a sentence.
_STATED = re.compile(
    r"""(?ix) \#[ ]*define[ ]+(?!instantiation_?token\b)\w*(?:passw(?:or)?d|secret|token|_key)
    \s+ ["'][^\s"']{6,}
    | \bpassword[ ]is \s+ ["']? (?=[^\s"']*\d) [^\s"',;(){}]{6,}"""
)
# A line of an environment file: names in capitals, nothing around the sign.
_ENVIRONMENT = re.compile(
    r"\s*(?:export\s+)?(?!INSTANTIATION_TOKEN=)[A-Z][A-Z0-9_]*(?:_KEY|TOKEN|SECRET|PASSWORD|PASSWD|_PASS|_PWD|_PAT)=[\"']?[^\s\"'(){};]{6,}"
)
_UNNAMED = (_VALUE, _ASSIGNED, _STATED)
# Whatever the patterns above find has one of these: a file of some MB is searched for them in much less time.
_LISTED_HINTS = """
    sk- pk- rk- hf gsk pplx nvapi xai aiza gho_ ghp_ ghs_ ghu_ ghr_ glpat- xox akia asia _live_ _test_ npm_
    key :// eyj secret pass kennwort token credential auth _pwd _pat pwd= sig= signature= code=
"""
_HINTS = tuple(_LISTED_HINTS.split())
# Environment variables whose values are removed from texts: fewer than those that are kept from FMUs, because
# the values of others, such as a region or a path, may be part of any text.
_KEY_VARIABLE = re.compile(
    r"(_KEY|TOKEN|SECRET|PASSWORD|PASSWD|PASSPHRASE|_PASS|_PWD|(^|_)PAT|JWT|BEARER)$", re.IGNORECASE
)
# Shorter values are more likely ordinary words; removing them would garble messages.
_SHORTEST = 6
_REDACTED = "[redacted]"


def is_secret_option(name: str) -> bool:
    """Whether an option of a language model's client may hold a secret.

    >>> is_secret_option("extra_body"), is_secret_option("azure_ad_token"), is_secret_option("max_tokens")
    (True, True, False)
    """
    return name in _OPTION_NAMES or bool(_OPTION_NAME.search(name))


def without_secrets(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options as they may be recorded, with every value that may be a secret replaced."""
    return {name: _REDACTED if is_secret_option(name) else value for name, value in options.items()}


def secrets_in(options: Mapping[str, Any]) -> list[str]:
    """Return the values of all options that may hold a secret, as strings for ``redact``."""
    found: list[str] = []
    for name, value in options.items():
        if is_secret_option(name):
            found += [str(v) for v in value.values()] if isinstance(value, Mapping) else [str(value)]
    return found


def holds_credentials(address: str) -> bool:
    """Whether an address contains a user name, a password or a key.

    >>> holds_credentials("http://me:word@host/v1"), holds_credentials("http://host:80/v1/@me")
    (True, False)
    """
    return bool(_CREDENTIALS.match(address) or _KEY_IN_QUERY.search(address) or _KEY_IN_PATH.search(address))


def without_credentials(address: str) -> str:
    """Return an address as it may be told: without a user name, a password, a query with a key, other keys.

    >>> without_credentials("http://me:word@host/v1"), without_credentials("http://host/v1?key=k")
    ('http://host/v1', 'http://host/v1')
    """
    plain = re.sub(r"(?<=://)[^\s/?#]+@", "", address, count=1)
    plain = re.sub(r"[?#].*", "", plain) if _KEY_IN_QUERY.search(plain) else plain
    return _KEY_IN_PATH.sub(_REDACTED, plain)


def redact(text: str, secrets: Iterable[str] = ()) -> str:
    """Return a message with secrets replaced: given ones, held ones and whatever looks like a known key."""
    text = re.sub(_LONG_KEY_IN_QUERY, rf"\g<name>{_REDACTED}", redact_held(text, secrets))
    return _IN_TEXT.sub(_REDACTED, text)


def redact_held(text: str, secrets: Iterable[str] = ()) -> str:
    """Return the text with only those secrets replaced that are given or in this process's environment.

    For replies of language models, whose words and names may look like keys without being any.
    """
    held = _held()
    held += [part for value in held for part in _credentials_in(value)]
    # Longest first: a secret that contains another one would otherwise be left in pieces.
    for secret in sorted({s.strip() for s in (*secrets, *held)}, key=len, reverse=True):
        if len(secret) >= _SHORTEST:
            text = text.replace(secret, _REDACTED)
    return text


def _held() -> list[str]:
    def is_secret(value: str) -> bool:  # an address may begin like a key
        return bool(_VALUE.search(value)) and ("://" not in value or holds_credentials(value))

    return [v for k, v in os.environ.items() if _KEY_VARIABLE.search(k) or is_secret(v)]


def _credentials_in(address: str) -> list[str]:
    """User name and password of an address together, the password alone, and the keys in its query."""
    found = [f[0] for f in re.finditer(_CREDENTIALS_IN_ADDRESS, address)]
    keys = [f["key"] for f in _KEY_IN_QUERY.finditer(address)]
    return [*found, *(each.partition(":")[2] for each in found), *keys]


def line_of_secret(text: str) -> int | None:
    """Return the number of the first line, from 1, that looks like a secret; None if none does.

    >>> line_of_secret("api_key = abcdef123"), line_of_secret("gain = 3")
    (1, None)
    """
    folded = text.casefold()
    hints = [hint for hint in _HINTS if hint in folded]
    # Lines as editors number them, not those of splitlines, which form feeds and others end as well.
    for number, line in enumerate(re.split("\r\n?|\n", text) if hints else (), start=1):
        folded = line.casefold()
        if any(hint in folded for hint in hints) and (
            any(pattern.search(line) for pattern in _UNNAMED) or _ENVIRONMENT.match(line)
        ):
            return number
    return None


def line_of_held_secret(text: str) -> int | None:
    """Return the first line, from 1, on which a secret of this process's environment begins, or None."""
    places = [text.find(value) for v in _held() if len(value := v.strip()) >= _SHORTEST]
    first = min((at for at in places if at >= 0), default=None)
    return None if first is None else text.count("\n", 0, first) + 1


def scrubbed(environment: Mapping[str, str]) -> dict[str, str]:
    """Return the environment without variables whose name or value looks like a secret."""
    return {
        name: value
        for name, value in environment.items()
        if not _VARIABLE_NAME.search(name) and not _VALUE.search(value)
    }
