from falsifier.core.model import Experiment, ModelInfo, Variable
from falsifier.llm.formalizing import formalizing_messages
from falsifier.problem.templates import TEMPLATES

INFO = ModelInfo(
    "pump",
    description="A pump with a tank",
    variables=(
        Variable("mode", "enumeration", "input", "discrete", literals={"off": 0, "on": 1}),
        Variable("level", causality="output", unit="m", low=0.0, high=2.5, description="Level of the tank"),
        *(Variable(f"inner{k}") for k in range(200)),
    ),
)


def test_the_question_has_signals_language_templates_and_the_sentence() -> None:
    system, user = formalizing_messages("The tank never runs dry.", INFO, Experiment(20.0, 0.05, ("level",)))
    assert (system.role, user.role) == ("system", "user")
    for part in (
        "The model pump: A pump with a tank",
        "from 0 to T = 20 s and sampled every 0.05 s",
        "- level (output, real, in m, at least 0, at most 2.5): Level of the tank",
        "- mode (input, enumeration, at least 0, at most 1, 0 = off, 1 = on)",
        "and 82 more internal variables",
        "The requirement:\nThe tank never runs dry.",
        "G[a,b] (f)",
        *(f"- {name}: {template.summary}" for name, template in TEMPLATES.items()),
    ):
        assert part in user.content, part
