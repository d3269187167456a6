"""The text of docs/meta_learning.md. Every number of ours in it is computed from results."""

from collections.abc import Mapping

from fnnq_torchrl.studies.experiments import Experiment
from fnnq_torchrl.studies.reproduction.markdown import interval_words, table
from fnnq_torchrl.studies.reproduction.verdicts import MATTERS, compared_words, in_a_word
from fnnq_torchrl.studies.statistics import Interval, paired_difference
from fnnq_torchrl.training.results import CONFIDENCE

from .ball import PAPERS, Compared, Recovery, compare, mean, recoveries
from .ring import PUBLISHED, RUNS, Cell, Shares, agrees, read_shares, share

CHANGES: dict[str, dict[str, object]] = {
    "The wheels are swapped": {"env.swap_wheels": True},
    "The ball rolls 1.3 times as fast": {"env.changed_speed": 1.3},
}
"""The changes of the ball by their headings."""

_PAGE = """# Meta-learning: parameters that a run changes itself

The paper's conclusion names Doya's meta-learning as a candidate for choosing the learning
parameters, and leaves it for later. Here it is (`adaptive=doya`): each run perturbs its own α,
temperature T and γ at random, and keeps the perturbations that came with a rise of the mean
reward.

{conclusion}
`make adaptive` writes this page from result files. Only the published shares,
and those of a second program below the ring's table, were typed by hand.

## The scheme

    r̄ ← r̄ + (r − r̄)/τ₁,   r̿ ← r̿ + (r̄ − r̿)/τ₂
    b₀ ← b₀ + μ(r̄ − r̿)σ,   b = b₀ + σ;   σ ~ N(0, 1), drawn again after every 100 rewards
    α = 1/(1 + eᵇ),   γ = 1/(1 + e⁻ᵇ),   1/T = eᵇ (exponential) or max(b + 1, 0) (affine)

τ₁ = τ₂ = 100, μ = 0.2 (Schweighofer & Doya, Neural Networks 16, 2003). The equations and the
table below are those of a replication, a draft for ReScience of 2018 by Sarazin, Khamassi, Rano
and Girard, which isn't reviewed. The levels b are bounded by 30, so that every parameter stays
finite.

## On the ring

A ring of n states: a step to the right earns 1, a step to the left costs 1, but once a lap the
step to the left earns r₂. Going left all the way is best. A run has *solved* the task if its mean
reward r̿ exceeds 95 % of the best after step 1,000. The solution is *stable* unless r̿ later
falls below 75 % of the best and is above 95 % in less than 90 % of the later steps. That is the
rule of the replication's program; its text says *or* instead of *and*, and the last column
follows the text. Brackets are {confidence:g} % intervals (Wilson). *agrees*: the shares differ by
less than twice the standard error of their difference.

{ring}
{agreeing} of {cells} cells agree with the published shares.

**What explains the difference.** The replication's softmax overflows where Q/T exceeds 709, and
then picks left, whatever the values are. Ours doesn't overflow. Before the switch left is the
wrong side, and after it the right one. With an exponential 1/T the overflow happens in most runs,
with an affine one in a quarter of them. A separate program in C, written for this comparison, has
43.7 % stable solutions before the switch and 14.0 % after it, with an exponential 1/T and this
overflow (36.0 % and 13.7 % by the text's rule; published 35.3 % and 15.3 %). Without the overflow
it has 55.0 % and 6.0 %. With an affine 1/T the overflow changes its shares by 1 % or less. Each is
of 300 runs. The replication's agent returns to the start at the switch, and ours doesn't. That
changes little. So the exponential form adapts to the switch no better than the affine one: the
published advantage is the overflow's.

## On the ball

The task is the paper's. Each scheme starts from α between {lowest:g} and {highest:g}, evenly on a
logarithmic scale, with {runs:,} seeds each. *At its best α*: the first half of the seeds chooses
α, the second half gives the score. *Over all α*: the score of a user who doesn't tune α. By the
clock of *steps* the rewards are those of single steps, with the constants above. By the clock of
*situations* a situation's return counts as one reward, τ₁ = τ₂ = 10, and σ is drawn after every 5
situations. The meta-learners of all three parameters explore by Boltzmann's distribution from the
default temperature on; the others are ε-greedy. Scores are catches of five. Brackets are
{confidence:g} % bootstrap intervals (BCa); differences are between the same seeds. *More* and
*less* are by at least {matters} catches. *Slightly*: there is a difference, perhaps a smaller one.
*Same*: any difference is smaller. *Open*: more runs are needed to tell.

{ball}

![Learning curve, and the course of α, temperature and γ](figures/meta_learning.png)

## On a ball that changes

After {change_at} of {situations} situations the world changes, in tests too. The scores are means
over α = {alphas}, with {changing_runs:,} seeds each: over the last evaluations *before* the
change, *at the change* with what was learned before, over all evaluations *after* it, and over
the *last* ones. IDBD, Autostep, TIDBD, AutoTIDBD and Swift-Sarsa have a step size for each weight,
which starts at α ([adaptive.md](adaptive.md)). Swift-Sarsa learns on-policy, as true online
Sarsa(λ) does with a constant α; all others learn by Peng's Q(λ). λ is {lam:g}.

{changing}
![Scores around the change](figures/changing_ball.png)
"""


def write_page(ring: Experiment, ball: Experiment, changing: Experiment) -> str:
    """Return the text of the page.

    Args:
        ring: the outcomes of ``+experiment=doya``.
        ball: the results of ``+experiment=meta_learning``.
        changing: the results of ``+experiment=changing_ball``.

    Raises:
        NoResults: if a scheme or a change is missing.
        OSError, ValueError: if a file can't be read.
    """
    shares, compared = read_shares(ring), compare(ball)
    found = {name: recoveries(changing, change) for name, change in CHANGES.items()}
    alphas, first = sorted(ball.values("alpha")), changing.jobs[0]
    return _PAGE.format(
        conclusion=_conclusion(shares, compared, found),
        confidence=100 * CONFIDENCE,
        ring=ring_table(shares),
        agreeing=sum(agrees(cell, each) for cell, each in shares.items()),
        cells=len(shares),
        lowest=alphas[0],
        highest=alphas[-1],
        runs=ball.runs,
        matters=MATTERS,
        ball=_ball_table(compared),
        change_at=first.settings["env.change_at"],
        situations=first.settings["situations"],
        alphas=", ".join(f"{alpha:g}" for alpha in sorted(changing.values("alpha"))),
        changing_runs=changing.runs,
        lam=first.settings["lam"],
        changing="\n".join(
            f"### {name}\n\n{_recovery_table(each)}" for name, each in found.items()
        ),
    )


def ring_table(shares: Mapping[Cell, Shares]) -> str:
    """Return the table of stable solutions, published and ours."""
    runs = min((each.solved.size for each in shares.values()), default=0)
    first = [f"ours, first {RUNS}"] if runs > RUNS else []
    head = ["", "1/T", "published", *first, f"ours, {runs:,} runs"]
    head += ["", "solved", "stable by the text"]
    return table(
        head, [_ring_row(cell, each, with_first=bool(first)) for cell, each in shares.items()]
    )


def _ring_row(cell: Cell, shares: Shares, *, with_first: bool) -> list[str]:
    """Return a cell's row, with a column of as many runs as were published if ``with_first``."""
    beta, gamma = cell.start
    name = f"{cell.states} states, 1/T₀ = {beta:g}, γ₀ = {gamma:g}"
    if cell.switches:
        name = f"switching, {'after' if cell.stage else 'before'}"
    return [
        name,
        cell.beta,
        f"{100 * PUBLISHED[cell]:.1f} %",
        *([f"{100 * shares.stable[:RUNS].mean():.1f} %"] if with_first else []),
        _percent(share(shares.stable)),
        "agrees" if agrees(cell, shares) else "**differs**",
        f"{100 * shares.solved.mean():.1f} %",
        f"{100 * shares.stable_by_text.mean():.1f} %",
    ]


def _percent(interval: Interval) -> str:
    value, low, high = (100 * each for each in interval)
    return f"{value:.1f} % [{low:.1f}, {high:.1f}]"


def _ball_table(compared: Mapping[str, Compared]) -> str:
    against = f"against {PAPERS}"
    head = ["", "best α", "there", against, "over all α", against, "spread", "diverged"]
    return table(head, [_ball_row(name, each) for name, each in compared.items()])


def _ball_row(name: str, compared: Compared) -> list[str]:
    scheme, papers = compared.scheme, name == PAPERS
    return [
        name,
        f"{scheme.best_alpha:g}",
        interval_words(mean(scheme.at_best)),
        "" if papers else compared_words(compared.at_best),
        interval_words(mean(scheme.over_alphas)),
        "" if papers else compared_words(compared.over_alphas),
        interval_words(scheme.spread),
        f"{sum(scheme.diverged.values()):,}",
    ]


def _scores(difference: Interval) -> str:
    """Return a sentence's predicate for a difference of scores."""
    word = in_a_word(difference)
    sentences = {
        "same": f"scores the same to within {MATTERS} catches",
        "open": "scores neither clearly more nor less",
    }
    return sentences.get(word, f"scores {word}")


def _recovery_table(found: Mapping[str, Recovery]) -> str:
    against = f"against {PAPERS}"
    head = ["", "before", "at the change", "after", against, "last", "diverged"]
    theirs = found[PAPERS]
    rows = []
    for name, each in found.items():
        difference = paired_difference(each.after, theirs.after).mean
        rows.append(
            [
                name,
                interval_words(mean(each.before)),
                f"{each.at_once.mean():.2f}",
                interval_words(mean(each.after)),
                "" if name == PAPERS else compared_words(difference),
                interval_words(mean(each.final)),
                f"{each.diverged:,}",
            ]
        )
    return table(head, rows)


def _conclusion(
    shares: Mapping[Cell, Shares],
    compared: Mapping[str, Compared],
    found: Mapping[str, Mapping[str, Recovery]],
) -> str:
    metas = {name: each for name, each in compared.items() if name.startswith("meta-learned")}
    best = max(metas, key=lambda name: metas[name].over_alphas.value)
    spreads = ", ".join(
        f"{each.scheme.spread.value:.2f} for {name}"
        for name, each in compared.items()
        if name in (PAPERS, "ObGD", best)
    )
    agreeing = sum(agrees(cell, each) for cell, each in shares.items())
    lines = [
        f"* **On the ring** {agreeing} of the replication's {len(shares)} shares of stable "
        "solutions agree with ours.",
        f"* **On the ball** the best of the meta-learners, {best}, "
        f"{_scores(metas[best].over_alphas)} over all starting values of α, compared with "
        f"the paper's {PAPERS}. If each has its best α, it {_scores(metas[best].at_best)}. "
        f"The difference between the best and the worst α is {spreads} (catches of five).",
    ]
    lines += [
        f"* **{name}** in the middle of learning. Mean scores afterwards, compared with {PAPERS} "
        f"({each[PAPERS].after.mean():.2f}): {_ranked(each)}."
        for name, each in found.items()
    ]
    return "".join(f"{line}\n" for line in lines)


def _ranked(found: Mapping[str, Recovery]) -> str:
    """Return the schemes by their score after a change, under the words of the comparison."""
    theirs = found[PAPERS]
    words: dict[str, list[str]] = {}
    for name in sorted(found, key=lambda name: -found[name].after.mean()):
        if name != PAPERS:
            word = in_a_word(paired_difference(found[name].after, theirs.after).mean)
            words.setdefault(word, []).append(f"{name} {found[name].after.mean():.2f}")
    return "; ".join(f"{word}: {', '.join(names)}" for word, names in words.items())
