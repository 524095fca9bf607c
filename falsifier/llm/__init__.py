"""Language models: typed prompts, typed replies, and one narrow door to every provider.

A chat is anything with ``complete(request) -> reply``. ``connect`` makes one from an LLM's name out of small
wrappers, each with one concern::

    CachedChat      valid replies on disk                         cache
    RecordedChat    a journal's replies first                     replay
    RetryingChat    patience, shared between runs                 retry
    LadderChat      the way of asking for JSON that works here    ladder
    LiteLLMChat     one request, one answer or one clear error    client

``ScriptedChat`` plays a script instead. ``converse`` asks until a reply is valid; ``prompts`` says what is
told and ``replies`` what is read. Nothing here knows what searches.
"""
