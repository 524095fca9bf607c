from falsifier.llm.providers import first_mode


def test_grammars_that_break_gpt_oss_are_not_tried() -> None:
    assert first_mode("ollama_chat/gpt-oss:20b") == "prompt"
    assert first_mode("lm_studio/openai/gpt-oss-20b") == "prompt"
    assert first_mode("huggingface/openai/gpt-oss-20b") == "json_schema"
    assert first_mode("ollama_chat/qwen3") == "json_schema"
