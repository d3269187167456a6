"""The answer of docs/adaptive.md: does a scheme free the user of choosing α?"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fnnq_torchrl.studies.reproduction.markdown import table
from fnnq_torchrl.training.pictures.words import value_words

from .comparison import Compared
from .scheme import Scheme, Unit


@dataclass(frozen=True)
class Task:
    """The scores of all schemes on one task.

    Attributes:
        name: the task in words.
        unit: the unit of the scores.
        reference: the scheme that the best ones are told beside, in words.
        schemes: the scores by the scheme's words.
    """

    name: str
    unit: Unit
    reference: str
    schemes: Mapping[str, Scheme]


def task_of(name: str, first: Mapping[str, Scheme], rules: Compared, true_online: Compared) -> Task:
    """Return a task of all its schemes.

    Args:
        name: the task in words.
        first: the schemes with one step size for all weights, by name.
        rules: the comparison of the rules with a step size for each weight.
        true_online: the comparison of Swift-Sarsa with true online Sarsa(λ).
    """
    both = {**first, **rules.schemes, **first}  # with the keys of the first one first
    schemes = {value_words(key): scheme for key, scheme in both.items()}
    for key, scheme in true_online.schemes.items():
        of_sarsa = key == true_online.reference
        schemes["true online Sarsa(λ)" if of_sarsa else value_words(key)] = scheme
    return Task(name, rules.unit, value_words(rules.reference), schemes)


def answer(tasks: Sequence[Task]) -> str:
    """Return a sentence on each task, and a table of the scores with and without tuning."""
    sentences = "".join(f"* **{task.name}.** {_sentence(task)}\n" for task in tasks)
    head = ["", *(f"{task.name}, {which}" for task in tasks for which in ("untuned", "tuned"))]
    names = dict.fromkeys(name for task in tasks for name in task.schemes)
    return f"{_in_short(tasks)}{sentences}\n{table(head, [_row(name, tasks) for name in names])}"


def _in_short(tasks: Sequence[Task]) -> str:
    """Return the schemes that score as much untuned as the reference does tuned."""
    told = []
    for task in tasks:
        enough = _tuned(task.schemes[task.reference]) - task.unit.matters
        free = [name for name, scheme in task.schemes.items() if _untuned(scheme) >= enough]
        told.append(f"{task.name}: {', '.join(free) or 'none'}")
    reference = " or ".join(dict.fromkeys(task.reference for task in tasks))
    return (
        f"* **In short.** Schemes that score as much with an untuned α as {reference} with the "
        f"best α: {'; '.join(told)}.\n"
    )


def _sentence(task: Task) -> str:
    untuned, tuned = ({key: of(each) for key, each in task.schemes.items()} for of in _SCORES)
    lost = {name: tuned[name] - untuned[name] for name in tuned}
    least = min(lost, key=lost.__getitem__)
    return (
        f"An untuned α does best with {_best(task, untuned)}, a tuned one with "
        f"{_best(task, tuned)}. Tuning matters least to {least}, by "
        f"{task.unit.text(lost[least])} {task.unit.name}; to {task.reference} by "
        f"{task.unit.text(lost[task.reference])}."
    )


def _best(task: Task, scores: Mapping[str, float]) -> str:
    """Return the scheme with the best score, beside the reference's score."""
    best = max(scores, key=scores.__getitem__)
    if best == task.reference:
        return f"{best} ({task.unit.text(scores[best])})"
    reference = f"{task.reference}: {task.unit.text(scores[task.reference])}"
    return f"{best} ({task.unit.text(scores[best])}; {reference})"


def _row(name: str, tasks: Sequence[Task]) -> list[str]:
    cells = [name]
    for task in tasks:
        scheme = task.schemes.get(name)
        cells += ["" if scheme is None else task.unit.text(of(scheme)) for of in _SCORES]
    return cells


def _untuned(scheme: Scheme) -> float:
    return float(scheme.over_alphas.mean())


def _tuned(scheme: Scheme) -> float:
    return float(scheme.at_best.mean())


_SCORES = (_untuned, _tuned)
