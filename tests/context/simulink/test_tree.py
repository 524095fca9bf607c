from falsifier.context.simulink.tree import Node

LEAF = Node("P", {"Name": "x"})
TREE = Node("Block", {"SID": "1"}, (Node("System", {}, (LEAF,)), Node("Line")))


def test_values_are_found_under_the_first_name_that_is_there() -> None:
    assert TREE.get("SSID", "SID") == "1"
    assert TREE.get("id") == ""


def test_sections_are_found_by_kind_and_walked_from_outside() -> None:
    assert TREE.first("System") is TREE.all("System")[0]
    assert TREE.first("Chart") is None
    assert [node.kind for node in TREE.walk()] == ["Block", "System", "P", "Line"]
