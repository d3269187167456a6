"""Any TorchRL environment as a world, one environment for each run."""

from envs.from_torchrl.schemas import TorchRLConfig
from envs.from_torchrl.single import TorchRLSingle, make
from envs.singles.world import Single, SinglesWorld


class TorchRLWorld(SinglesWorld):
    """A batch of environments of a TorchRL class.

    Arguments: see :class:`envs.core.pure.PureEnv`; the values of ``world`` are in
    ``conf/env/torchrl.yaml``.
    """

    schema = TorchRLConfig
    world: TorchRLConfig

    def make_single(self) -> Single:
        return TorchRLSingle(make(self.world.kind, self.world.arguments))
