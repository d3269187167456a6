"""The names of the choices that the equations know. No torch here."""

VARIANTS = ("peng", "watkins", "naive")
"""Whose Q(λ) it is (`.q_lambda.Rule`)."""

TRACES = ("output", "gradient", "replacing", "window")
"""What the trace is; the first two are the readings of step h (`.q_lambda.Rule`)."""

STEP_SIZES = ("decay", "constant", "obgd", "alpha_bound")
"""How large a step is (`fnnq_torchrl.equations.step_size.StepSize`)."""

EXPLORATIONS = {"epsilon_greedy": "epsilon", "boltzmann": "temperature", "noise": "noise_std"}
"""The ways to explore, each with the key that says how much (`fnnq_torchrl.agent.policy`)."""
