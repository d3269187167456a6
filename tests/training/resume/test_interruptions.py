"""The moments at which a training is saved or ended."""

import errno
import os
import signal
import threading

import pytest
import torch
from tensordict import TensorDict

from fnnq_torchrl.training.resume.interruptions import Interrupted, Interruptions, Lost
from fnnq_torchrl.training.resume.keeper import HandsKeeper

pytestmark = pytest.mark.usefixtures("usual_signals")

FULL = OSError(errno.ENOSPC, "No space left on device", "training.pt")


class Clock:
    def __init__(self) -> None:
        self.seconds = 0.0

    def __call__(self) -> float:
        return self.seconds


def test_saving_is_due_at_intervals() -> None:
    clock = Clock()
    with Interruptions(10, clock) as work:
        for now, due in ((0, False), (9.9, False), (10, True), (12, True)):
            clock.seconds = now
            assert work.due() == due
        work.saved()
        for now, due in ((12, False), (21.9, False), (22, True)):
            clock.seconds = now
            assert work.due() == due


@pytest.mark.parametrize("name", ["SIGUSR1", "SIGUSR2"])
def test_a_warning_makes_it_due_and_the_work_goes_on(name: str) -> None:
    with Interruptions(1e9) as work:
        os.kill(os.getpid(), getattr(signal, name))
        assert work.due()
        assert not work.ending
        work.saved()
        assert not work.due()


@pytest.mark.parametrize(("name", "status"), [("SIGTERM", 143), ("SIGINT", 130), ("SIGHUP", 129)])
def test_an_order_to_end_is_obeyed_when_all_is_saved(name: str, status: int) -> None:
    with Interruptions(1e9) as work:
        os.kill(os.getpid(), getattr(signal, name))
        assert work.due()
        assert work.ending
        with pytest.raises(Interrupted, match=f"^{name}: .*saved$") as ended:
            work.saved()
    assert ended.value.status == status


def test_a_save_that_failed_is_due_again_after_the_interval() -> None:
    clock = Clock()
    with Interruptions(10, clock) as work:
        clock.seconds = 10
        work.failed(FULL)
        for now, due in ((10, False), (19.9, False), (20, True)):
            clock.seconds = now
            assert work.due() == due


@pytest.mark.parametrize("order", [False, True], ids=["", "SIGTERM"])
def test_the_keeper_tries_again_after_a_save_that_failed(order: bool) -> None:
    attempts = 0

    def save(hands: object) -> None:
        nonlocal attempts
        attempts += 1
        if attempts == 1:
            raise FULL

    clock = Clock()
    with Interruptions(10, clock) as work:
        keeper = HandsKeeper(work, save)
        nobody = torch.tensor([-1]), TensorDict(batch_size=[1])
        clock.seconds = 10
        keeper.visit(0, *nobody)
        keeper.visit(0, *nobody)
        assert attempts == 1
        if order:
            os.kill(os.getpid(), signal.SIGTERM)
            with pytest.raises(Interrupted, match="saved"):
                keeper.visit(0, *nobody)
        else:
            clock.seconds = 20
            keeper.visit(0, *nobody)
    assert attempts == 2


def test_a_save_that_failed_is_no_save_to_the_keeper() -> None:
    def save(hands: object) -> None:
        raise FULL

    with Interruptions(1e9) as work:
        keeper = HandsKeeper(work, save)
        os.kill(os.getpid(), signal.SIGTERM)
        with pytest.raises(Lost):
            keeper.visit(0, torch.tensor([-1]), TensorDict(batch_size=[1]))
        with pytest.raises(Lost):
            keeper.finish()


def test_an_order_to_end_is_obeyed_when_nothing_can_be_saved() -> None:
    with Interruptions(1e9) as work:
        os.kill(os.getpid(), signal.SIGTERM)
        with pytest.raises(Lost, match=r"^SIGTERM: .*lost: .*No space") as ended:
            work.failed(FULL)
    assert ended.value.status == 1


def test_the_second_order_is_obeyed_at_once() -> None:
    with Interruptions(1e9):
        os.kill(os.getpid(), signal.SIGINT)
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)


def test_signals_are_what_they_were_before() -> None:
    before = [signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT)]
    with Interruptions(1e9):
        assert signal.getsignal(signal.SIGTERM) != before[0]
    assert [signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGINT)] == before


@pytest.mark.parametrize("name", ["SIGTERM", "SIGINT"])
def test_an_order_that_the_process_was_started_to_ignore_stays_ignored(name: str) -> None:
    signal.signal(getattr(signal, name), signal.SIG_IGN)
    with Interruptions(1e9) as work:
        os.kill(os.getpid(), getattr(signal, name))
        assert not work.due()


def test_signals_that_somebody_answers_are_theirs() -> None:
    heard: list[int] = []
    signal.signal(signal.SIGUSR2, lambda number, frame: heard.append(number))
    with Interruptions(1e9) as work:
        os.kill(os.getpid(), signal.SIGUSR2)
        assert not work.due()
    assert heard == [signal.SIGUSR2]


@pytest.mark.parametrize("well", [True, False])
def test_whoever_asks_is_told_whether_it_is_saved(well: bool) -> None:
    with Interruptions(1e9) as work:
        assert not work.save_now(timeout_s=10)  # no work has begun

        def save_when_due() -> None:
            while not work.due():
                pass
            work.saved() if well else work.failed(FULL)

        thread = threading.Thread(target=save_when_due)
        with work.watched():
            thread.start()
            assert work.save_now(timeout_s=10) == well
            thread.join()
            assert not work.save_now(timeout_s=0)
