import torch

from fnnq_torchrl.engine.threads import threads_for


def test_small_tensors_get_one_thread_and_large_ones_all() -> None:
    before = torch.get_num_threads()
    try:
        torch.set_num_threads(2)
        with threads_for(32 * 21):
            assert torch.get_num_threads() == 1
        assert torch.get_num_threads() == 2
        with threads_for(2**20):
            assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(before)
