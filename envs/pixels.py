"""A transform that adds pictures of the worlds, for TorchRL's video recorder."""

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.data import Bounded, TensorSpec
from torchrl.envs import Transform

from envs.canvas import Canvas
from envs.drawing import shot_of


class Pixels(Transform):
    """Add the entry ``pixels``, a picture: uint8 ``[*batch_size, height, width, 3]``.

    Append it to an environment with ``TransformedEnv(env, Pixels())``. TorchRL's ``VideoRecorder``,
    appended next, reads ``pixels``. Each picture takes some hundredths of a second.

    Args:
        size_px: the width of a picture.
    """

    def __init__(self, size_px: int = 240) -> None:
        super().__init__(in_keys=[], out_keys=["pixels"])
        self._canvas = Canvas(size_px=size_px)
        self._shape: tuple[int, ...] | None = None

    def _call(self, next_tensordict: TensorDictBase) -> TensorDictBase:
        runs = next_tensordict.batch_size
        pictures = [self._draw(next_tensordict, run) for run in range(runs.numel())]
        return next_tensordict.set("pixels", torch.stack(pictures).view(*runs, *pictures[0].shape))

    def _reset(
        self, tensordict: TensorDictBase, tensordict_reset: TensorDictBase
    ) -> TensorDictBase:
        return self._call(tensordict_reset)

    def _draw(self, state: TensorDictBase, run: int) -> Tensor:
        return torch.from_numpy(self._canvas.draw([[shot_of(self.parent.base_env, state, run)]]))

    def transform_observation_spec(self, observation_spec: TensorSpec) -> TensorSpec:
        """Add the spec of ``pixels``; a picture is drawn to find its height."""
        env = self.parent.base_env
        shape = (*env.batch_size, *self._draw(env.fake_tensordict(), 0).shape)
        spec = Bounded(0, 255, shape, dtype=torch.uint8, device=observation_spec.device)
        observation_spec.set("pixels", spec)
        return observation_spec
