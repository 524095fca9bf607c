"""Language models: typed prompts, typed replies and one interface to every provider.

A chat is any object with a name (``llm``), ``complete(request) -> reply`` and ``accepted``. ``connect`` makes
one from an LLM's name: a ``LiteLLMChat``, which asks one server and answers repeated requests from disk. A
run wraps it in a chat of its own, which plays back a journal's replies and keeps to the budget.
``ScriptedChat`` follows a script instead. ``converse`` repeats a question until the reply is valid.
``prompts`` builds what an LLM is sent, ``replies`` reads what it returns. Nothing in this package depends on
the engines or the search.
"""

from typing import Literal

# Names of the prompt variants that are used if none is named, without and with context files. What stands
# here is all that options of the command line need, so that --help imports nothing else.
DEFAULT_VARIANT, CONTEXT_VARIANT = "MP5", "MP6"
Effort = Literal["none", "minimal", "low", "medium", "high"]
