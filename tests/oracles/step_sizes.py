"""Linear learners with a step size for each weight, written as their papers list them.

Each has ``weights`` and a ``step`` from features, a reward and the next features (zeros at an end).
The sources are in `equations.step_size`; its docstrings also tell where AutoTIDBD departs from the
paper's listing, in which this twin follows it. Swift is the listing of the paper, which goes on for
ever: an end is a step to features of zeros with a reward of 0, after which its traces are cleared.
"""

from collections.abc import Callable, Iterator, Sequence
from math import exp, log

from .peng import World, epsilon_greedy

Vector = Sequence[float]


def dot(x: Vector, y: Vector) -> float:
    return sum(a * b for a, b in zip(x, y, strict=True))


class IDBD:
    """IDBD (Sutton 1992), whose weights change along an accumulating trace if λ isn't 0."""

    def __init__(
        self, count: int, *, alpha: float, gamma: float, lam: float, meta_step_size: float
    ) -> None:
        self.weights = [0.0] * count
        self.beta, self.h, self.z = [log(alpha)] * count, [0.0] * count, [0.0] * count
        self.gamma, self.lam, self.theta = gamma, lam, meta_step_size

    def step(self, x: Vector, reward: float, after: Vector, done: bool) -> None:
        delta = reward + self.gamma * dot(self.weights, after) - dot(self.weights, x)
        for i in range(len(x)):
            self.z[i] = self.gamma * self.lam * self.z[i] + x[i]
            self.beta[i] += self.theta * delta * x[i] * self.h[i]
            alpha = exp(self.beta[i])
            self.weights[i] += alpha * delta * self.z[i]
            self.remember(i, alpha, delta, x[i])
        if done:
            self.z = [0.0] * len(x)

    def remember(self, i: int, alpha: float, delta: float, x: float) -> None:
        self.h[i] = self.h[i] * max(1 - alpha * x * x, 0) + alpha * delta * x


class TIDBD(IDBD):
    """TIDBD(λ) with the semi-gradient (Kearney et al. 2019)."""

    def remember(self, i: int, alpha: float, delta: float, x: float) -> None:
        self.h[i] = self.h[i] * max(1 - alpha * x * self.z[i], 0) + alpha * delta * self.z[i]


class Autostep:
    """Autostep (Mahmood et al. 2012, table 1), with a trace as :class:`IDBD` has one."""

    def __init__(
        self,
        count: int,
        *,
        alpha: float,
        gamma: float,
        lam: float,
        meta_step_size: float,
        tau: float,
    ) -> None:
        self.weights, self.alpha = [0.0] * count, [alpha] * count
        self.h, self.v, self.z = [0.0] * count, [0.0] * count, [0.0] * count
        self.gamma, self.lam, self.mu, self.tau = gamma, lam, meta_step_size, tau

    def step(self, x: Vector, reward: float, after: Vector, done: bool) -> None:
        delta = reward + self.gamma * dot(self.weights, after) - dot(self.weights, x)
        for i in range(len(x)):
            size = abs(delta * x[i] * self.h[i])
            self.v[i] = max(
                size, self.v[i] + self.alpha[i] * x[i] ** 2 * (size - self.v[i]) / self.tau
            )
            if self.v[i] != 0:
                self.alpha[i] *= exp(self.mu * delta * x[i] * self.h[i] / self.v[i])
        bound = max(sum(alpha * y**2 for alpha, y in zip(self.alpha, x, strict=True)), 1)
        for i in range(len(x)):
            self.alpha[i] /= bound
            self.z[i] = self.gamma * self.lam * self.z[i] + x[i]
            self.weights[i] += self.alpha[i] * delta * self.z[i]
            self.h[i] = self.h[i] * (1 - self.alpha[i] * x[i] ** 2) + self.alpha[i] * delta * x[i]
        if done:
            self.z = [0.0] * len(x)


class AutoTIDBD:
    """AutoTIDBD(λ) (Kearney et al. 2019, algorithm 6, as `equations.step_size` reads it)."""

    def __init__(
        self,
        count: int,
        *,
        alpha: float,
        gamma: float,
        lam: float,
        meta_step_size: float,
        tau: float,
    ) -> None:
        self.weights, self.beta = [0.0] * count, [log(alpha)] * count
        self.h, self.eta, self.z = [0.0] * count, [0.0] * count, [0.0] * count
        self.gamma, self.lam, self.theta, self.tau = gamma, lam, meta_step_size, tau

    def step(self, x: Vector, reward: float, after: Vector, done: bool) -> None:
        delta = reward + self.gamma * dot(self.weights, after) - dot(self.weights, x)
        d = [self.gamma * there - here for there, here in zip(after, x, strict=True)]
        for i in range(len(x)):
            self.z[i] = self.gamma * self.lam * self.z[i] + x[i]
            fade = exp(self.beta[i]) * d[i] * self.z[i] / self.tau
            self.eta[i] = max(
                abs(delta * d[i] * self.h[i]),
                self.eta[i] - fade * (abs(delta * x[i] * self.h[i]) - self.eta[i]),
            )
            if self.eta[i] > 0:
                self.beta[i] -= self.theta * delta * d[i] * self.h[i] / self.eta[i]
        effective = -sum(exp(b) * y * z for b, y, z in zip(self.beta, d, self.z, strict=True))
        for i in range(len(x)):
            self.beta[i] -= log(max(effective, 1))
            alpha = exp(self.beta[i])
            self.weights[i] += alpha * delta * self.z[i]
            self.h[i] = self.h[i] * max(1 + alpha * d[i] * self.z[i], 0)
            self.h[i] += alpha * delta * self.z[i]
        if done:
            self.z = [0.0] * len(x)


class Swift:
    """SwiftTD (Javed et al. 2024) in the order of its listing."""

    def __init__(
        self,
        count: int,
        *,
        alpha: float,
        gamma: float,
        lam: float,
        meta_step_size: float,
        eta: float,
        eta_min: float,
        eta_decay: float,
    ) -> None:
        self.weights, self.beta = [0.0] * count, [log(alpha)] * count
        self.h, self.h_old, self.h_temp = [0.0] * count, [0.0] * count, [0.0] * count
        self.z, self.z_bar, self.z_delta = [0.0] * count, [0.0] * count, [0.0] * count
        self.p = [0.0] * count
        self.v_old = self.v_delta = 0.0
        self.gamma, self.lam, self.theta = gamma, lam, meta_step_size
        self.eta, self.eta_min, self.epsilon = eta, eta_min, eta_decay
        self.begun = False

    def step(self, x: Vector, reward: float, after: Vector, done: bool) -> None:
        if not self.begun:
            self.perceive(x, 0.0)
        self.begun = True
        if done:  # the start of the next episode is perceived when it is known
            self.learn(after, reward)
            for i in range(len(x)):
                self.z[i] = self.p[i] = self.z_bar[i] = 0.0
            self.begun = False
        else:
            self.perceive(after, reward)

    def perceive(self, x: Vector, reward: float) -> None:
        """Do one pass of the listing's loop."""
        value = dot(self.weights, x)
        change = self.learn(x, reward)
        self.v_delta = dot(change, x)
        rate = sum(exp(self.beta[i]) * x[i] ** 2 for i in range(len(x)))
        b = dot(self.z, x)
        for i in range(len(x)):
            if x[i] == 0:
                continue
            self.z_delta[i] = min(1, self.eta / rate) * exp(self.beta[i]) * x[i]
            self.z[i] += self.z_delta[i] * (1 - b)
            self.p[i] += self.h_old[i] * x[i]
            self.z_bar[i] += self.z_delta[i] * (1 - b - self.z_bar[i] * x[i])
            self.h_temp[i] = (
                self.h[i]
                - self.h_old[i] * x[i] * (self.z[i] - self.z_delta[i])
                - self.h[i] * self.z_delta[i] * x[i]
            )
            if rate > self.eta:
                self.h_temp[i] = self.h[i] = self.h_old[i] = self.z_bar[i] = 0.0
                self.beta[i] += log(self.epsilon) * x[i] ** 2
        self.v_old = value

    def learn(self, x: Vector, reward: float) -> list[float]:
        """Do the first half of a pass and return the change of the weights."""
        delta = reward + self.gamma * dot(self.weights, x) - self.v_old
        change = [0.0] * len(x)
        for i in range(len(x)):
            if self.z[i] == 0:
                continue
            change[i] = delta * self.z[i] - self.z_delta[i] * self.v_delta
            self.weights[i] += change[i]
            self.beta[i] += self.theta / exp(self.beta[i]) * (delta - self.v_delta) * self.p[i]
            self.beta[i] = min(max(self.beta[i], log(self.eta_min)), log(self.eta))
            self.h_old[i] = self.h[i]
            self.h[i] = self.h_temp[i] + delta * self.z_bar[i] - self.z_delta[i] * self.v_delta
            self.h_temp[i] = self.h[i]
            self.z_delta[i] = 0.0
            self.z[i] *= self.gamma * self.lam
            self.p[i] *= self.gamma * self.lam
            self.z_bar[i] *= self.gamma * self.lam
        return change


Twin = IDBD | Autostep | AutoTIDBD | Swift

TWINS: dict[str, Callable[..., Twin]] = {
    "idbd": IDBD,
    "autostep": Autostep,
    "tidbd": TIDBD,
    "auto_tidbd": AutoTIDBD,
    "swift": Swift,
}


def sarsa(
    world: World, states: int, actions: int, twin: Twin, epsilon: float
) -> Iterator[list[float]]:
    """Yield the table's values, in the order of the pairs, after each step of Sarsa(λ)."""

    def features(state: int, action: int) -> list[float]:
        return [float(i == state * actions + action) for i in range(states * actions)]

    def values(state: int) -> list[float]:
        return twin.weights[state * actions : (state + 1) * actions]

    episode = 0
    while True:
        state, chance = world.start(episode)
        action, step, done = epsilon_greedy(values(state), epsilon, chance), 0, False
        while not done:
            step += 1
            reward, after, terminated, done, _, chance = world.move(state, action, episode, step)
            next_action = epsilon_greedy(values(after), epsilon, chance)
            ahead = [0.0] * states * actions if terminated else features(after, next_action)
            twin.step(features(state, action), reward, ahead, done)
            yield [*twin.weights]
            state, action = after, next_action
        episode += 1
