import pytest
from pydantic import ValidationError

from falsifier.search.request import LLMSettings


@pytest.mark.parametrize("option", ["api_key", "extra_body", "headers", "azure_ad_token"])
def test_options_that_may_hold_a_key_are_refused_and_not_shown(option: str) -> None:
    with pytest.raises(ValidationError, match="read from the environment") as caught:
        LLMSettings(name="openai/m", options={option: "the-secret"})
    assert "the-secret" not in str(caught.value)
