import os
import socket
import threading
from collections.abc import Iterator

import pytest

from falsifier.fmu.channel import (
    Closed,
    Reply,
    close_all,
    receive_reply,
    receive_request,
    send_reply,
    send_request,
    watch,
)
from tests.patience import HANG

Pair = tuple[socket.socket, socket.socket]


@pytest.fixture
def pair() -> Iterator[Pair]:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        yield ours, theirs


@pytest.mark.parametrize(
    "reply",
    [
        Reply(),
        Reply("failed", "diverged: größer", 1.25),
        Reply("timeout", "", 0.0, more=True),
        Reply("unusable", "x" * 300_000, leaving=True),
    ],
    ids=["ok", "failed", "more", "long"],
)
def test_replies_arrive_as_they_were_sent(pair: Pair, reply: Reply) -> None:
    sender = threading.Thread(target=send_reply, args=(pair[1], reply))  # a long one needs a reader
    sender.start()
    assert receive_reply(pair[0], HANG) == reply
    sender.join(HANG)


def test_what_cannot_be_encoded_arrives_all_the_same(pair: Pair) -> None:
    send_reply(pair[1], Reply("failed", "half a pair: \ud800"))
    assert receive_reply(pair[0], HANG).text == "half a pair: ?"


def test_requests_carry_open_files(pair: Pair) -> None:
    reading, writing = os.pipe()
    send_request(pair[0], 7, b"payload", (writing,))
    kind, payload, descriptors = receive_request(pair[1])
    assert (kind, payload, len(descriptors)) == (7, b"payload", 1)
    os.write(descriptors[0], b"through")
    close_all([*descriptors, writing])
    assert os.read(reading, 100) == b"through"
    assert os.read(reading, 100) == b"", "all ends for writing are closed"
    close_all([reading, reading])  # one that is closed already does not matter


def test_several_requests_keep_their_order_and_bounds(pair: Pair) -> None:
    for kind in range(3):
        send_request(pair[0], kind, bytes(kind))
    assert [receive_request(pair[1])[:2] for _ in range(3)] == [(0, b""), (1, b"\0"), (2, b"\0\0")]


def test_an_end_that_is_gone_is_told_apart_from_one_that_is_slow(pair: Pair) -> None:
    ours, theirs = pair
    with pytest.raises(TimeoutError):
        receive_reply(ours, 0.01)
    theirs.close()
    with pytest.raises(Closed):
        receive_reply(ours, HANG)
    with pytest.raises(Closed):
        receive_request(ours)
    with pytest.raises(Closed):
        send_request(ours, 1, bytes(1_000_000))
    send_reply(ours, Reply())


def test_half_a_message_is_none(pair: Pair) -> None:
    ours, theirs = pair
    theirs.sendall(b"\0\0\0")
    theirs.close()
    with pytest.raises(Closed):
        receive_reply(ours, HANG)


def test_watching_takes_nothing_and_ends_with_the_message_or_the_end(pair: Pair) -> None:
    ours, theirs = pair
    watch(ours, 0.001)
    send_reply(theirs, Reply(text="here"))
    watch(ours, HANG)
    assert receive_reply(ours, HANG).text == "here"
    theirs.close()
    watch(ours, HANG)
