"""Running means of the reward, and the record of a solution, beside plain definitions of them."""

import numpy as np
import torch
from hypothesis import given
from hypothesis import strategies as st

from fnnq_torchrl.equations import reward_means
from fnnq_torchrl.equations.reward_means import Means, no_solution, running_means, watched


def test_the_long_mean_is_the_mean_of_the_new_short_one() -> None:
    means = Means(*torch.tensor([[0.0], [0.0]]))
    for reward, expected in ((8, (4, 1)), (0, (2, 1.25)), (0, (1, 1.1875))):
        means = running_means(means, torch.tensor([float(reward)]), 2, 4)
        assert (means.short.item(), means.long.item()) == expected


@given(shares=st.lists(st.sampled_from([0.2, 0.7, 0.8, 0.95, 0.96, 1.1]), min_size=1, max_size=30))
def test_the_record_is_what_its_fields_say(shares: list[float]) -> None:
    settling, reward_means.SETTLING_STEPS = reward_means.SETTLING_STEPS, 5
    try:
        record = no_solution(torch.zeros(1, dtype=torch.float64))
        for share in shares:
            record = watched(record, torch.tensor([share], dtype=torch.float64))
    finally:
        reward_means.SETTLING_STEPS = settling
    high = np.array(shares) > 0.95
    first = next((step for step in range(5, len(shares)) if high[step]), None)
    rest = [] if first is None else shares[first:]
    assert record.steps.item() == len(shares)
    assert record.solved.item() == (first is not None)
    assert record.lowest.item() == min(rest, default=np.inf)
    assert record.later.item() == len(rest)
    assert record.above.item() == sum(share > 0.95 for share in rest)
