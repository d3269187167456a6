import torch

from fnnq_torchrl.engine.threads import subnormals_flushed, threads_for


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


def test_who_flushes_subnormals_anyway_goes_on_doing_so() -> None:
    torch.set_flush_denormal(True)
    try:
        with subnormals_flushed():
            pass
        assert (torch.full((8,), 2.0**-126) / 2 == 0).all()
    finally:
        torch.set_flush_denormal(False)
