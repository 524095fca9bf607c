from falsifier.llm.messages import ChatReply, Exchange
from tests.llm.support import PLAIN, ask_with_tools, calling


class TestRecords:
    """Nothing changes for those that know no tools."""

    def test_without_tools_no_field_of_theirs_is_written(self) -> None:
        exchange = Exchange(llm="m", messages=PLAIN.messages, reply=ChatReply(text="3"))
        assert "tool" not in exchange.model_dump_json() + PLAIN.model_dump_json()
        assert "echo" not in exchange.model_dump_json()

    def test_exchanges_with_calls_come_back_whole(self) -> None:
        _, _, exchanges = ask_with_tools(calling(1, 2), "3")
        assert [bool(e.reply and e.reply.tool_calls) for e in exchanges] == [True, False]
        assert [Exchange.model_validate_json(e.model_dump_json()) for e in exchanges] == exchanges
