"""The questions of a run: a constant part, the samples so far, and what is new.

Samples are told in order, each as it was told first, so that a question begins with the one before it and
providers can cache that. Only when the samples need too many tokens, many are shortened at once: first those
of the least weight and the oldest, down to a share that leaves room for the next ones.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from falsifier.core.candidate import Candidate
from falsifier.core.literals import one_line
from falsifier.core.words import counted, listed, shortened
from falsifier.errors import ChatError
from falsifier.evaluation.evaluate import Evaluation
from falsifier.evaluation.levels import Climb
from falsifier.llm.messages import Message
from falsifier.llm.prompts import published
from falsifier.llm.prompts.advice import on_first, on_next
from falsifier.llm.prompts.combinations import Combinations
from falsifier.llm.prompts.effects import Effects
from falsifier.llm.prompts.numbers import as_signals, number
from falsifier.llm.prompts.observations import ROBUSTNESS_DIGITS, Signs, observed
from falsifier.llm.prompts.reached import Reached, SampleProgress
from falsifier.llm.prompts.regularities import Regularities
from falsifier.llm.prompts.relations import Relations
from falsifier.llm.prompts.standing import formula_text, standing
from falsifier.llm.prompts.together import apart, came_nearer, recurring
from falsifier.llm.prompts.tried import Tried
from falsifier.llm.prompts.view import Variant, View
from falsifier.llm.usage import count_tokens
from falsifier.stl.margins import is_on_limit, margin_words, signed

# Fits LLMs with a context of 32k tokens and leaves room for reasoning.
MOST_PROMPT_TOKENS = 16_000
# What a prompt should need; samples get at least as much as the rest, if the limit allows it.
USUAL_PROMPT_TOKENS = 6_000
# Share of the tokens beside the constant part that samples may have, that they have once shortened, and that
# they may have if each is told in a line; the rest is for what is new.
_MOST_OF_SAMPLES, _SHORTENED, _MOST_OF_LINES = 0.7, 0.45, 0.6
# Characters of a rationale that are told back.
_LONGEST_WHY = 300
# Samples that are named as the best ones.
_NAMED = 3
_RUN = re.compile(r'"[^" ]+ x \d+"')
_PENDING = "Proposed and not simulated so far:"
_RUNS = '"0 x 187" among the values of a sample stands for 187 zeros.'
_LONGEST = (
    "{condition} was false longest in one piece for {longest}; {limit} s violate the requirement. That tells "
    "more than the robustness: look at how that piece began and ended."
)
_UNTRIED = "Not tried so far: {}. See what happens there, too."
_FLAT = (
    "The robustness is flat: it was {lowest} in all {count} samples{still}, so its value gives no direction."
)

# How much of a sample is told.
_FULL, _SHORT, _LINE = range(3)


@dataclass(slots=True)
class _Sample:
    """One sample as it is told, more or less of it."""

    number: int  # its place among all samples, from 1
    texts: tuple[str, str, str]  # what is told of it, by depth
    tokens: tuple[int, ...]  # of each of these
    depth: int  # which of them is told
    robustness: float | None  # None: there is no verdict
    progress: SampleProgress = field(default_factory=SampleProgress)
    is_first: bool = False  # whether it was the first to reach something
    signs: Signs = field(default_factory=Signs)


class Questions:
    """Makes the questions of one run from what it is told.

    ``start`` has the smallest and the largest value of each output at time 0, by name, as far as known;
    ``llm`` is the LLM whose tokens are counted.
    """

    def __init__(
        self,
        view: View,
        variant: Variant,
        *,
        start: Mapping[str, tuple[float, float]] | None = None,
        llm: str = "",
    ) -> None:
        self._view = view
        self._variant = variant
        self._start = dict(start or {}) if variant.has("circumstances") else {}
        self._count: Callable[[str], int] = lambda text: count_tokens(text, llm)
        self._fixed = self._count(self._standing(1))
        self._aim = min(MOST_PROMPT_TOKENS, max(USUAL_PROMPT_TOKENS, 2 * self._fixed))
        self._samples: list[_Sample] = []  # those that are told
        self._judged: list[_Sample] = []  # all with a verdict, by which own variants rank them
        self._told = self._omitted = 0
        self._inputs: dict[str, int] = {}
        self._reached = Reached(view)
        self._tried = Tried(view)
        self._patterns = (Relations(view), Regularities(view))
        self._combinations, self._effects = Combinations(view), Effects(view)
        self._recurring = recurring(view.requirement.formula)
        self._climb = Climb(view.counters, "sample")

    def tell(self, evaluation: Evaluation, *, doubt: str = "", why: str = "") -> None:
        """Add a sample.

        ``doubt`` says why a violation does not count; ``why`` is the LLM's rationale of its candidate.
        """
        self._told += 1
        if evaluation.verdict is None and not self._variant.has("failures"):
            return
        if self._variant.is_published:
            self._samples = [*self._samples, self._published(evaluation, doubt)][-published.MOST_SAMPLES :]
        else:
            sample = self._seen(evaluation, doubt, why)
            self._samples.append(sample)
            if sample.robustness is not None:
                self._judged.append(sample)
            if evaluation.trajectory is not None:  # the start values of a few points do not show everything
                at_start = evaluation.trajectory.at(0.0)
                for name in self._start.keys() & at_start.keys():
                    values = (*self._start[name], at_start[name])
                    self._start[name] = (min(values), max(values))
                for collected in (*self._patterns, self._combinations):
                    collected.add(evaluation.trajectory)
                self._effects.add(self._told, evaluation.candidate, evaluation.trajectory)
            self._shorten()

    def ask(
        self,
        count: int = 1,
        *,
        simulations: int | None = None,
        pending: Sequence[Candidate] = (),
        notes: Sequence[str] = (),
        lessons: str = "",
    ) -> tuple[Message, ...]:
        """Return the messages of the next question: the constant part, then what changes.

        ``count`` candidates are wanted, those ``pending`` have no evaluation yet. ``notes`` are lines about
        the search as a whole, from the engine that leads it, ``lessons`` what the LLM wrote down in its last
        reply. ``simulations`` is the maximum of the run; None: no limit, or unknown.

        Raises:
            ChatError: if the question is too long even without samples.
        """
        constant = self._standing(count)
        news = "\n\n".join(self._news(count, simulations, pending, notes, lessons))
        others = self._count(constant) + self._count(news)
        while (size := others + self._count(self._lasting())) > self._aim and self._samples:
            self._drop()
        if size > MOST_PROMPT_TOKENS:
            raise ChatError(
                f"the prompt needs {size} tokens without any history, but the limit is {MOST_PROMPT_TOKENS}: "
                "choose a plainer prompt variant"
            )
        lasting, latest = self._lasting(), self._latest()
        if size + self._count(latest) > MOST_PROMPT_TOKENS:
            latest = ""
        changing = "\n\n".join(part for part in (lasting, latest, news) if part)
        return (
            Message(role="system", content=constant, stable=len(constant)),
            Message(role="user", content=changing, stable=len(lasting)),
        )

    def _standing(self, count: int) -> str:
        if self._variant.is_published:
            return published.standing(self._view, self._variant, count=count)
        return standing(self._view, self._variant, count=count, start=self._start)

    def _lasting(self) -> str:
        if not self._samples:
            return ""
        left_out = f", {len(self._samples)} of {self._told}" if self._omitted else ""
        # The published prompts count the samples that they show, not all that there were.
        renumbers = self._variant.is_published
        numbered = ((n if renumbers else s.number, s) for n, s in enumerate(self._samples, start=1))
        told = (f"Sample {n}: {s.texts[s.depth]}" for n, s in numbered)
        order = f"Samples so far{left_out}, in the order in which they were simulated"
        more = "" if renumbers else "; more is told of those that were the best or the first somewhere"
        return "\n\n".join((f"{order}{more}:", *told))

    def _latest(self) -> str:
        """All else of the latest sample, if less was told of it."""
        if not self._samples or self._samples[-1].number != self._told:
            return ""
        sample = self._samples[-1]
        told = {line.partition(": ")[0] for line in sample.texts[sample.depth].splitlines()}
        more = [line for line in sample.texts[_FULL].splitlines() if line.partition(": ")[0] not in told]
        return "\n".join((f"More of sample {sample.number}:", *more)) if more else ""

    def _news(
        self,
        count: int,
        simulations: int | None,
        pending: Sequence[Candidate],
        notes: Sequence[str],
        lessons: str,
    ) -> Iterator[str]:
        wanted = f"{count} different samples" if count > 1 else "sample"
        budget = simulations if self._variant.has("circumstances") else None
        waiting = ["; ".join(self._chosen(c)) for c in pending]
        if not self._samples and not waiting and not notes:
            is_own, named = not self._variant.is_published, self._view.is_named
            first = f"{on_first(self._view.space, is_named=named)} " if is_own else ""
            if budget is not None:
                first += f"Nothing has been simulated yet; {counted(budget, 'simulation')} may be spent. "
            yield f"{first}Propose the first {wanted}."
            return
        yield from self._standings()
        yield from filter(None, (pattern.text for pattern in (*self._patterns, self._effects)))
        yield from notes
        if lessons and self._variant.has("lessons"):
            yield f"Your lessons so far: {lessons}"
        if waiting:
            yield "\n".join((_PENDING, *waiting))
        if self._judged:
            yield from self._advice()
        if _RUN.search(self._lasting()):
            yield _RUNS
        yield f"{self._left(budget)}Propose the next {wanted}. Do not repeat an earlier one."

    def _standings(self) -> Iterator[str]:
        """Which samples are the best; where robustness says little, what is missing and was not tried."""
        ranked, levels = self._best_first(), self._climb.levels
        if len(ranked) < 2:
            return
        # What decides is told once: here if it is flat because that never changes.
        decider = self._climb.decider if self._is_flat() else None
        still = decider.signals if decider and self._reached.same.issuperset(decider.signals) else ()
        if self._is_flat():
            unchanged = f", and {listed(still)} never changed" if still else ""
            lowest, count = signed(levels.lowest, 3), levels.simulations
            yield _FLAT.format(lowest=lowest, count=count, still=unchanged)
        if self._recurring and ranked[0].signs.failure:
            condition, limit = self._recurring.condition, self._recurring.length
            failed = [(s.number, s.signs.failure) for s in ranked[:_NAMED] if s.signs.failure]
            longest = [f"{number(length)} s in sample {n}" for n, length in failed]
            yield _LONGEST.format(
                condition=formula_text(condition), longest=", ".join(longest), limit=number(limit)
            )
        elif not self._is_flat():
            better = [s for s in ranked[:_NAMED] if s.robustness != ranked[-1].robustness]
            told = (f"{signed(s.robustness or 0.0, 3)} in sample {s.number}" for s in better)
            yield f"Lowest robustness so far: {', '.join(told)}."
        if together := apart({s.number: s.signs.closest for s in self._judged if s.signs.closest}):
            yield together
        if self._climb.is_told:
            few = [f"Few values of {levels.told('sample')}."] if levels.is_staircase else []
            yield from filter(None, ["\n".join((*few, *self._climb.lines[bool(still) :]))])
        if self._climb.is_told or self._is_flat() or self._is_stuck():
            untried = _UNTRIED.format(gaps) if (gaps := self._tried.gaps) else ""
            yield from filter(None, (self._reached.extent(still), untried, self._combinations.text))

    def _advice(self) -> Iterator[str]:
        """How to use the samples with a verdict, of which there are some."""
        is_flat, is_joint = self._is_flat(), any(s.signs.closest for s in self._judged)
        is_ranked_otherwise = is_flat or is_joint or self._best_first()[0].signs.failure > 0
        is_timed = not is_ranked_otherwise and any(s.signs.is_timed for s in self._judged)
        stuck = self._is_stuck()
        yield from on_next(self._view.space, is_timed=is_timed, is_flat=is_flat, is_stuck=stuck)

    def _is_stuck(self) -> bool:
        """Whether the last two samples were no better than those before, also in nothing that is needed."""
        before, last = self._judged[:-2], self._judged[-2:]
        if not before or self._best_first()[0] in last:
            return False
        return not came_nearer([s.signs.closest for s in last], [s.signs.closest for s in before])

    def _is_flat(self) -> bool:
        """Whether several samples had the same robustness, and none had another."""
        levels = self._climb.levels
        return levels.simulations > 1 and len(levels.found) == 1

    def _best_first(self) -> list[_Sample]:
        """Samples with a verdict by how long what must recur failed, if it did, and their robustness.

        Otherwise, where the robustness is flat, by how far their signals got.
        """
        if self._is_flat() and not any(s.signs.failure for s in self._judged):
            return sorted(self._judged, key=lambda s: self._reached.rank(s.progress), reverse=True)
        return sorted(self._judged, key=lambda s: (-s.signs.failure, s.robustness or 0.0, s.number))

    def _left(self, budget: int | None) -> str:
        if budget is None:
            return ""
        if self._told >= budget:
            return f"{counted(self._told, 'simulation')} spent. "
        return f"{self._told} of {counted(budget, 'simulation')} spent, {budget - self._told} left. "

    def _published(self, evaluation: Evaluation, doubt: str) -> _Sample:
        robustness, *facts = published.facts(self._view, self._variant, evaluation)
        text = _text(self._chosen(evaluation.candidate), robustness, doubt, *facts)
        return _Sample(self._told, (text,) * 3, (0, 0, 0), _FULL, evaluation.robustness)

    def _seen(self, evaluation: Evaluation, doubt: str, why: str) -> _Sample:
        """A sample of a variant of our own: how much of it is told depends on those before it only."""
        candidate, verdict = evaluation.candidate, evaluation.verdict
        inputs = self._chosen(candidate)
        self._tried.add(candidate)
        reason = shortened(" ".join(why.split()), _LONGEST_WHY)
        notes = [self._alike("; ".join(inputs)), f"chosen because: {reason}" if why else ""]
        if verdict is None:
            ended = one_line(f"no verdict, the simulation {evaluation.outcome}".rstrip(": "))
            text = _text(inputs, ended, *notes)
            return _Sample(self._told, (text,) * 3, (self._count(text),) * 3, _LINE, None)
        trajectory = evaluation.trajectory
        progress = SampleProgress.of(self._view, trajectory) if trajectory else SampleProgress()
        has_new = bool(self._reached.new_changes(progress))
        switches = self._reached.switches(progress, trajectory) if trajectory else ""
        news = self._reached.news(progress)
        self._climb.add(self._told, verdict, trajectory, self._view.requirement.formula.predicates)
        found = observed(self._view, evaluation)
        robustness = f"robustness {signed(verdict.robustness, ROBUSTNESS_DIGITS)}"
        if is_on_limit(verdict.robustness):
            robustness += f" ({margin_words(verdict.robustness, verdict.predicate)})"
        reached = f"the first to reach: {'; '.join(news)}" if news else ""
        head = (robustness, doubt, *notes, reached)
        changes = f"changes, with other signals then: {switches}" if switches else ""
        brief = inputs if why else as_signals(self._view, candidate, in_brief=True)
        texts = (
            _text(inputs, *head, changes, *found.full),
            _text(inputs, *head, changes if has_new else "", *found.short),
            _text(brief, *head, found.line),
        )
        best = min((s.robustness for s in self._judged if s.robustness is not None), default=None)
        is_first = has_new or bool(news)
        depth = _FULL if is_first or best is None or verdict.robustness < best else _SHORT
        tokens = tuple(map(self._count, texts))
        return _Sample(
            self._told,
            texts,
            tokens,
            depth,
            verdict.robustness,
            progress,
            is_first,
            found.signs,
        )

    def _alike(self, inputs: str) -> str:
        """That a sample is, or looks like, an earlier one, if it does: numbers are rounded."""
        earlier = self._inputs.setdefault(inputs, self._told)
        if earlier == self._told:
            return ""
        return (
            f"this is sample {earlier} again, or differs from it by less than is shown: numbers are rounded"
        )

    def _shorten(self) -> None:
        """Tell less of samples if all of them together are too long."""
        room = self._aim - self._fixed
        if self._size() <= _MOST_OF_SAMPLES * room:
            return
        for depth in (_SHORT, _LINE):
            for sample in self._lightest_first():
                if self._size() <= _SHORTENED * room:
                    return
                sample.depth = max(sample.depth, depth)
        if self._size() > _MOST_OF_LINES * room:
            while self._size() > _SHORTENED * room and len(self._samples) > 1:
                self._drop()

    def _drop(self) -> None:
        self._samples.remove(self._lightest_first()[0])
        self._omitted += 1

    def _size(self) -> int:
        return sum(s.tokens[s.depth] for s in self._samples)

    def _lightest_first(self) -> list[_Sample]:
        """The oldest ones first, then those that were first somewhere, and those as low as the best one.

        At the end those named as the best, and the latest one, which nothing has been learnt from yet.
        """
        best = self._best_first()[:_NAMED]
        weights = {s.number: _NAMED - place for place, s in enumerate(best)}

        def weight(sample: _Sample) -> tuple[bool, int, bool, bool, int]:
            is_lowest = bool(best) and sample.robustness == best[0].robustness
            named = weights.get(sample.number, 0)
            return sample is self._samples[-1], named, is_lowest, sample.is_first, sample.number

        return sorted(self._samples, key=weight)

    def _chosen(self, candidate: Candidate) -> tuple[str, ...]:
        if not self._variant.is_published:
            return as_signals(self._view, candidate)
        if not self._variant.has("names"):
            return published.as_point(self._view, candidate)
        return published.as_values(self._view, candidate)


def _text(inputs: Sequence[str], *lines: str) -> str:
    return "\n  ".join(("; ".join(inputs), *(line for line in lines if line)))
