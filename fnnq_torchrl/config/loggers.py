"""The types and ranges of the loggers' settings, explained in ``conf/logger/``."""

from dataclasses import dataclass

from envs.core.parameters import Parameters, flag, matching, number, one_of, texts


@dataclass
class WandbConfig(Parameters):
    """The settings of Weights & Biases (`fnnq_torchrl.training.loggers.wandb`)."""

    per: str = one_of("job", "run", "sweep")
    mode: str = one_of("auto", "online", "offline", "disabled")
    project: str = matching(r"[^/\\#?%:]{0,128}", r"at most 128 characters other than / \ # ? % :")
    entity: str = matching(r"[^/\s]*", "the name of a team or a user")
    group: str = matching(r".{0,128}", "at most 128 characters")
    job_type: str = matching(r".{0,64}", "at most 64 characters")
    tags: list[str] = texts(most=64)
    timeout_s: float = number(above=0)


@dataclass
class TensorboardConfig(Parameters):
    """The settings of TensorBoard (`fnnq_torchrl.training.loggers.tensorboard`)."""

    directory: str = matching(r"(?!\.)[\w.-]+", "a name of letters, digits, _, - and dots")


@dataclass
class MlflowConfig(Parameters):
    """The settings of MLflow (`fnnq_torchrl.training.loggers.mlflow`)."""

    tracking_uri: str = matching(r"([\w+]+:\S+)?", "a URI, as https://host or sqlite:///path")
    experiment: str = matching(r".{0,250}", "at most 250 characters")
    timeout_s: float = number(above=0)


@dataclass
class LoggerConfig(Parameters):
    """The settings of the chosen loggers; None for a logger that isn't chosen."""

    video: bool = flag(default=False)  # as without loggers, in configurations of other jobs
    wandb: WandbConfig | None = None
    tensorboard: TensorboardConfig | None = None
    mlflow: MlflowConfig | None = None
