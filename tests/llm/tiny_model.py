"""A language model with random weights, in the format of llama.cpp (GGUF, version 3).

One layer, one token per byte, 0.1 MB. It knows nothing and answers with printable rubbish: the first channel
of its state is the same for every token, so that the weights of this channel say how often each byte comes.
"""

import struct
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Value = str | int | float | Sequence[str] | Sequence[int] | Sequence[float]

# Codes of value types in GGUF.
_UINT32, _INT32, _FLOAT32, _STRING, _ARRAY = 4, 5, 6, 8, 9
_ALIGNMENT = 32

# Types of tokens in GGUF.
_UNKNOWN, _CONTROL, _BYTE = 2, 3, 6
_SPECIAL = ("<unk>", "<s>", "</s>")
_END = 2
FIRST_BYTE = len(_SPECIAL)

_WIDTH, _HEADS, _INNER = 32, 2, 64

_TEMPLATE = """\
{%- for message in messages -%}
{{ '<|' + message.role + '|>' }}{{ message.content or '' }}{{ '\n' }}
{%- endfor -%}
{{- '<|assistant|>' }}"""


def write_tiny_model(file: Path, *, context: int = 65_536, seed: int = 0) -> None:
    """Write a model with random weights, which claims to be trained for so many tokens of context."""
    tokens = [*_SPECIAL, *(f"<0x{byte:02X}>" for byte in range(256))]
    values: dict[str, Value] = {
        "general.architecture": "llama",
        "llama.context_length": context,
        "llama.embedding_length": _WIDTH,
        "llama.block_count": 1,
        "llama.feed_forward_length": _INNER,
        "llama.attention.head_count": _HEADS,
        "llama.attention.layer_norm_rms_epsilon": 1e-5,
        "llama.rope.dimension_count": _WIDTH // _HEADS,
        "tokenizer.ggml.model": "llama",
        "tokenizer.ggml.tokens": tokens,
        "tokenizer.ggml.scores": [0.0] * len(tokens),
        "tokenizer.ggml.token_type": [_UNKNOWN, _CONTROL, _CONTROL, *[_BYTE] * 256],
        "tokenizer.ggml.bos_token_id": 1,
        "tokenizer.ggml.eos_token_id": _END,
        "tokenizer.ggml.unknown_token_id": 0,
        "tokenizer.chat_template": _TEMPLATE,
    }
    _write_gguf(file, values, _weights(len(tokens), np.random.default_rng(seed)))


def _weights(tokens: int, rng: np.random.Generator) -> dict[str, NDArray[np.float32]]:
    def random(*shape: int) -> NDArray[np.float32]:
        return rng.normal(scale=0.2, size=shape).astype(np.float32)

    def within_state(*shape: int) -> NDArray[np.float32]:
        """Weights that leave the first channel as it is."""
        weights = random(*shape)
        weights[0] = 0.0
        return weights

    ones = np.ones(_WIDTH, np.float32)
    embedding, output = random(tokens, _WIDTH), random(tokens, _WIDTH)
    embedding[:, 0] = 10.0  # after normalisation about the square root of the width, whatever else there is
    output[:, 0] = _inclinations(tokens) / np.sqrt(_WIDTH)
    return {
        "token_embd.weight": embedding,
        "blk.0.attn_norm.weight": ones,
        "blk.0.attn_q.weight": random(_WIDTH, _WIDTH),
        "blk.0.attn_k.weight": random(_WIDTH, _WIDTH),
        "blk.0.attn_v.weight": random(_WIDTH, _WIDTH),
        "blk.0.attn_output.weight": within_state(_WIDTH, _WIDTH),
        "blk.0.ffn_norm.weight": ones,
        "blk.0.ffn_gate.weight": random(_INNER, _WIDTH),
        "blk.0.ffn_up.weight": random(_INNER, _WIDTH),
        "blk.0.ffn_down.weight": within_state(_WIDTH, _INNER),
        "output_norm.weight": ones,
        "output.weight": output,
    }


def _inclinations(tokens: int) -> NDArray[np.float32]:
    """How much each token is preferred; what ends a string, a list or the reply comes soon."""
    preferred = np.full(tokens, -20.0, np.float32)
    preferred[FIRST_BYTE + 0x20 : FIRST_BYTE + 0x7F] = 0.0
    preferred[[FIRST_BYTE + ord(c) for c in '"]},0123456789']] = 2.0
    preferred[FIRST_BYTE + ord("\\")] = -20.0
    preferred[_END] = 2.0
    return preferred


def _write_gguf(file: Path, values: Mapping[str, Value], tensors: Mapping[str, NDArray[np.float32]]) -> None:
    """Write values and tensors as GGUF: a head, then the aligned data of the tensors."""
    head = [b"GGUF", struct.pack("<IQQ", 3, len(tensors), len(values))]
    head += [_string(name) + _typed(value) for name, value in values.items()]
    data = b""
    for name, tensor in tensors.items():
        # Sizes are listed from the fastest index to the slowest; 0 is the type of 32-bit floats.
        shape = struct.pack(f"<I{tensor.ndim}Q", tensor.ndim, *reversed(tensor.shape))
        head.append(_string(name) + shape + struct.pack("<IQ", 0, len(data)))
        data += _aligned(tensor.astype("<f4").tobytes())
    file.write_bytes(_aligned(b"".join(head)) + data)


def _typed(value: Value) -> bytes:
    if isinstance(value, str):
        return struct.pack("<I", _STRING) + _string(value)
    if isinstance(value, float):
        return struct.pack("<If", _FLOAT32, value)
    if isinstance(value, int):
        return struct.pack("<II", _UINT32, value)
    head = struct.pack("<I", _ARRAY)
    if isinstance(value[0], str):
        return head + struct.pack("<IQ", _STRING, len(value)) + b"".join(_string(str(v)) for v in value)
    kind, letter = (_FLOAT32, "f") if isinstance(value[0], float) else (_INT32, "i")
    return head + struct.pack(f"<IQ{len(value)}{letter}", kind, len(value), *value)


def _string(text: str) -> bytes:
    encoded = text.encode()
    return struct.pack("<Q", len(encoded)) + encoded


def _aligned(data: bytes) -> bytes:
    return data + bytes(-len(data) % _ALIGNMENT)
