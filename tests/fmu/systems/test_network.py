from falsifier.fmu.systems.network import Place
from tests.fmu.small_systems import loop


def test_positions_of_the_order_have_names_and_nonsense_has_none() -> None:
    network = loop().network
    assert [network.stepped(k) for k in (0, 1, 2, -1)] == ["plant", "pi", "", ""]
    assert network.title(Place(1, "measured")) == "pi.measured"
