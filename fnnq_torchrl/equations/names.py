"""The names of the variants, traces, step sizes, explorations and adaptive schemes, without torch.

Each name has an entry in a registry: :data:`.q_lambda.VARIANTS`, :data:`.traces.TRACES`,
:data:`.step_size.STEP_SIZES` and, with the policies, :data:`fnnq_torchrl.agent.policy.POLICIES`.
"""

VARIANTS = ("peng", "watkins", "naive", "sarsa", "expected_sarsa")
"""The variants of Q(λ), and the two of Sarsa(λ)."""

TRACES = ("output", "gradient", "replacing", "window", "clearing", "dutch")
"""The kinds of trace; the first two are two readings of step h in the paper's Table 1."""

BOOTSTRAPS = ("best", "chosen", "expected")
"""The values of the next state: Q of the best action, Q of the chosen action, or the mean of Q."""

STEP_SIZES = (
    "decay",
    "constant",
    "obgd",
    "alpha_bound",
    "idbd",
    "autostep",
    "tidbd",
    "auto_tidbd",
    "swift",
)
"""The rules for the step size."""

PER_WEIGHT = ("idbd", "autostep", "tidbd", "auto_tidbd", "swift")
"""The rules with a step size for each weight, made for a Q that is linear in its weights."""

EXPLORATIONS = {"epsilon_greedy": "epsilon", "boltzmann": "temperature", "noise": "noise_std"}
"""The names of the ways to explore, each with the configuration key of its amount."""

ADAPTIVE = ("none", "doya")
"""The schemes by which a run changes its own learning parameters."""

ADAPTIVE_PARAMETERS = ("alpha", "temperature", "gamma")
"""The parameters that such a scheme can change, by their keys in the configuration."""

BETAS = ("exponential", "affine")
"""The forms of the inverse temperature in :mod:`.meta_learning`."""

CLOCKS = ("steps", "situations")
"""The clocks of :mod:`.meta_learning`."""
