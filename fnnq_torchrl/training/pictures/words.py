"""The words for configuration keys and values, in figures and on pages."""

from typing import Any

_KEYS = {  # words and unit
    "lam": ("λ", ""),
    "alpha": ("α", ""),
    "alpha_decay": ("decay of α", ""),
    "kappa": ("κ", ""),
    "meta_step_size": ("meta step size", ""),
    "gamma": ("γ", ""),
    "epsilon": ("ε", ""),
    "temperature": ("temperature", ""),
    "noise_std": ("σ", ""),
    "env.speed_mps": ("V₀", "m/s"),
    "env.length": ("states", ""),
    "env.time_limit_steps": ("steps of an episode", ""),
    "env.bearing_noise_rad": ("sensor noise", "rad"),
    "action.candidates": ("candidate actions", ""),
    "value.width": ("second number of a label", ""),
    "value.layer_norm": ("layers normalised", ""),
    "window": ("steps", ""),
}
_VALUES = {
    "decay": "decaying α",
    "constant": "constant α",
    "obgd": "ObGD",
    "alpha_bound": "α bound",
    "idbd": "IDBD",
    "autostep": "Autostep",
    "tidbd": "TIDBD",
    "auto_tidbd": "AutoTIDBD",
    "swift": "Swift-Sarsa",
    "epsilon_greedy": "ε-greedy",
    "boltzmann": "Boltzmann",
    "noise": "additive noise",
    "peng": "Peng",
    "watkins": "Watkins",
    "naive": "naive",
    "window": "finite window",
    "output": "step h by output",
    "gradient": "step h by gradient",
    "replacing": "replacing trace",
    "sigma": "σ",
    "variance": "σ²",
}


def key_words(key: str) -> str:
    """Return the words for a key, with its unit, as for the label of an axis."""
    name, unit = _KEYS.get(key, (key, ""))
    return f"{name} ({unit})" if unit else name


def value_words(value: Any) -> str:
    """Return the words for a value, as for the tick of an axis."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float | int):
        return f"{value:g}"
    return _VALUES.get(value, str(value))


def setting_words(key: str, value: Any) -> str:
    """Return the words for a setting: ``V₀ = 0.3 m/s``, or ``Peng`` if the value says enough."""
    if isinstance(value, str) and key not in _KEYS:
        return value_words(value)
    name, unit = _KEYS.get(key, (key, ""))
    return f"{name} = {value_words(value)} {unit}".rstrip()
