"""The simulated world. It knows nothing of learning.

:class:`envs.follow_ball.FollowBall` is the TorchRL environment. This file imports nothing, so that
a world's parameters (:mod:`envs.world`) can be checked without importing torch.
"""
