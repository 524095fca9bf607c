import threading

from tests.engines.support import best_of


def test_annealing_is_scipys_and_ends_its_thread() -> None:
    assert best_of("annealing", simulations=150) < best_of("uniform", simulations=10)
    for thread in threading.enumerate():
        if thread.name == "annealing":
            thread.join(timeout=5)
    assert not [t for t in threading.enumerate() if t.name == "annealing"]
