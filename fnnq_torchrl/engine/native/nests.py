"""Order expressions and writes, and put them in loops over the axes that they depend on.

Each node (an expression or a write) is placed inside the loops of its own axes, no others. Loops
are nested in the same order everywhere. The program is built from its end. A node can be placed
once all its users are placed; it then comes right before them, in the open loop if possible. So it
is computed as late, and as near to its use, as possible. Nodes share a loop unless one needs a
number that another only has after the loop: the result of a reduction (a fold), or the number of
another iteration.

Some nodes are needed only by lanes in which a condition holds, such as the start of an episode. If
there are many of them, they are put into a branch, which the program skips if the condition holds
in no lane. A branch is a loop around nodes, too, but runs at most once.
"""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field
from math import gcd, prod

from .expressions import FUNCTIONS, Axis, Expression, Place, in_order

_WORTH_A_BRANCH = 100
"""The fewest operations in a branch: a branch that is predicted wrong costs some fifty."""


@dataclass(frozen=True, eq=False)
class Write:
    """An assignment to an element, or a family of elements, of a leaf (a tensor of the state).

    Attributes:
        leaf, place: the leaf's number and the element's place.
        value: the new number; with a source, the mask of the lanes to write.
        source: for a masked copy, the leaf whose new number at the same place is copied to the
            lanes in the mask; else None.
    """

    leaf: int
    place: Place
    value: Expression
    source: int | None = None


Node = Expression | Write


@dataclass(frozen=True)
class Branch:
    """The part of a step that only lanes need in which a condition holds.

    Attributes:
        mask: the condition.
    """

    mask: Expression


@dataclass(eq=False)
class Loop:
    """A loop over an axis, a branch, or the whole step.

    Attributes:
        axis: the loop's axis; for a branch, its condition; None for the whole step.
        body: the nodes and inner loops in order.
    """

    axis: Axis | Branch | None = None
    body: list["Node | Loop"] = field(default_factory=list)


@dataclass
class Nests:
    """The nodes of a step, placed in loops.

    Attributes:
        whole: the whole step.
        around: the loops around each node, from ``whole`` inwards.
        users: for each expression, the nodes that read it, each with the axes along which it reads
            numbers of other iterations.
        late: writes to leaves that nodes after them still read. They write to a buffer, which is
            copied to the leaf at the end of the step.
    """

    whole: Loop
    around: dict[Node, tuple[Loop, ...]]
    users: Mapping[Expression, Sequence[tuple[Node, frozenset[Axis]]]]
    late: list[Write]


def operands(node: Node) -> list[tuple[Expression, frozenset[Axis]]]:
    """Return what a node reads, each with the axes along which it reads across iterations."""
    if isinstance(node, Write):
        return _resolved(node.value)
    bound = frozenset[Axis](node.args[1] if node.op == "pick" else ())
    found = []
    for number, operand in enumerate(node.operands):
        others = bound if number == 0 else frozenset[Axis]()
        found += [(of, axes | others) for of, axes in _resolved(operand)]
    return found


def _resolved(operand: Expression) -> list[tuple[Expression, frozenset[Axis]]]:
    if operand.op == "at":
        family, moves = operand.args
        return [(family, frozenset(axis for axis, _ in moves))]
    return [(operand, frozenset[Axis]())]


def is_computed(value: Expression) -> bool:
    """Return whether an expression is an operation rather than an input or part of a family."""
    return value.op not in ("constant", "input", "table", "at")


def is_computed_anew(value: Expression) -> bool:
    """Return whether a family is so cheap that each loop computes it instead of reading an array.

    An example is the gradient of a weight that was read by its index: 1 at the index, else 0. It
    reads no leaf, since a write may have changed the leaf before a later loop.
    """
    return value.op in ("eq", "where") and all(
        operand.op == "table"
        or (is_computed_anew(operand) if operand.axes else operand.op != "input")
        for operand in value.operands
    )


def path(node: Node, rank: Mapping[Axis, int]) -> tuple[Axis, ...]:
    """Return the axes of the loops that must be around a node, from the outermost inwards."""
    if isinstance(node, Write):
        own = frozenset(axis for axis, _ in node.place.strides)
        axes = node.value.axes | own if node.source is None else frozenset[Axis]()
    elif node.op == "fold":
        axes = node.operands[0].axes | {node.args[1]}
    elif node.op == "pack":
        axes = frozenset[Axis]().union(*(value.axes for value in node.operands))
    else:
        axes = node.axes
    return tuple(sorted(axes, key=lambda axis: rank[axis]))


def ranks(nodes: Iterable[Node]) -> dict[Axis, int]:
    """Return each axis's nesting depth; larger strides are further out, to read memory in order."""
    axes: dict[Axis, None] = {}
    outer: dict[Axis, Counter[Axis]] = defaultdict(Counter)
    for node in nodes:
        places = [node.place] if isinstance(node, Write) else []
        if isinstance(node, Expression):
            axes |= dict.fromkeys(sorted(node.axes, key=lambda axis: axis.number))
            if node.op == "fold":
                axes[node.args[1]] = None
            places += [node.args[1]] if node.op in ("input", "table") else []
        for place in places:
            axes |= dict.fromkeys(axis for axis, _ in place.strides)
            for inner, small in place.strides:
                for other, large in place.strides:
                    outer[inner][other] += (large > small) - (large < small)
    order: list[Axis] = []
    left = sorted(axes, key=lambda axis: axis.number)
    while left:
        first = min(left, key=lambda axis: sum(outer[axis][other] > 0 for other in left))
        order.append(first)
        left.remove(first)
    return {axis: number for number, axis in enumerate(order)}


def arrange(writes: Sequence[Write], given: Set[Expression]) -> Nests:
    """Place writes and the expressions that they need, except those computed before the loop.

    Args:
        writes: the writes of a step.
        given: the expressions that are computed before the first step.
    """
    return _Arrangement(writes, given).nests


class _Arrangement:
    def __init__(self, writes: Sequence[Write], given: Set[Expression]) -> None:
        every = in_order(write.value for write in writes)
        order = [value for value in every if is_computed(value) and value not in given]
        nodes: list[Node] = [*order, *writes]
        self._order = {node: number for number, node in enumerate(nodes)}
        self._rank = ranks([*every, *writes])
        self._users: dict[Expression, list[tuple[Node, frozenset[Axis]]]] = defaultdict(list)
        self._reads: dict[Node, list[Expression]] = {}
        for node in self._order:
            reads = operands(node)
            self._reads[node] = [value for value, _ in reads if value in self._order]
            for value, moved in reads:
                self._users[value].append((node, moved))
        branches = _branches(order, self._users)
        self._paths: dict[Node, tuple[Axis | Branch, ...]] = {
            node: path(node, self._rank) for node in self._order
        }
        for value, branch in branches.items():  # the condition is computed before the branch
            self._paths[value] = (branch, *self._paths[value])
            self._reads[value].append(branch.mask)
            self._users[branch.mask].append((value, frozenset()))
        self._waiting = Counter[Node](dict.fromkeys(self._order, 0))
        for reads_of in self._reads.values():
            self._waiting.update(reads_of)
        self._free = {node: None for node in self._order if not self._waiting[node]}
        self._written: dict[int, list[Write]] = defaultdict(list)
        self._read: dict[int, list[Node]] = defaultdict(list)
        self.nests = Nests(Loop(), {}, self._users, [])
        self._fill((self.nests.whole,))
        _turn_round(self.nests.whole, self._order)

    def _fill(self, stack: tuple[Loop, ...]) -> None:
        """Place all nodes that fit in the innermost loop of a stack, and in new loops within it."""
        depth = len(stack) - 1
        while True:
            here = [node for node in self._free if len(self._paths[node]) == depth]
            here = [node for node in here if self._fits(node, stack)]
            for node in here:
                self._place(node, stack)
            if here:
                continue
            inner = [node for node in self._free if len(self._paths[node]) > depth]
            axes = {self._paths[node][depth]: None for node in inner if self._fits(node, stack)}
            if not axes:
                return
            loop = Loop(self._next(list(axes), depth, stack))
            stack[-1].body.append(loop)
            self._fill((*stack, loop))

    def _fits(self, node: Node, stack: tuple[Loop, ...]) -> bool:
        """Return whether a node may be placed next in these loops or in further loops inside."""
        axes = tuple(loop.axis for loop in stack[1:])
        if self._paths[node][: len(axes)] != axes:
            return False
        if isinstance(node, Write):
            return True
        fold = {node.args[1]} if node.op == "fold" else frozenset[Axis]()
        for user, moved in self._users[node]:
            both = shared(stack, self.nests.around[user])
            if any(loop.axis in moved or loop.axis in fold for loop in both):
                return False
        return not any(
            len(shared(stack, self.nests.around[write])) > 1 and not _apart(write.place, place)
            for leaf, place in _leaves(node)
            for write in self._written[leaf]
        )

    def _place(self, node: Node, stack: tuple[Loop, ...]) -> None:
        self.nests.around[node] = stack
        stack[-1].body.append(node)
        del self._free[node]
        if isinstance(node, Write):
            if self._read[node.leaf]:
                self.nests.late.append(node)
            else:
                self._written[node.leaf].append(node)
        for leaf, _ in _leaves(node):
            self._read[leaf].append(node)
        for value in self._reads[node]:
            self._waiting[value] -= 1
            if not self._waiting[value]:
                self._free[value] = None

    def _next(
        self, axes: Sequence[Axis | Branch], depth: int, stack: tuple[Loop, ...]
    ) -> Axis | Branch:
        """Choose the loop to open next: the one that gains least by waiting for the others."""
        if len(axes) == 1:
            return axes[0]
        prefix = tuple(loop.axis for loop in stack[1:])
        gains = {axis: self._gain((*prefix, axis)) for axis in axes}
        return min(
            axes,
            key=lambda axis: (gains[axis], self._rank[axis] if isinstance(axis, Axis) else -1),
        )

    def _gain(self, prefix: tuple[Axis | Branch | None, ...]) -> int:
        """Return how many more nodes a loop could hold if all other loops were placed first."""

        def inside(node: Node) -> bool:
            return self._paths[node][: len(prefix)] == prefix

        waiting = Counter[Node]()

        def spread(start: Iterable[Node], taken: set[Node], within: bool) -> set[Node]:
            found = set[Node]()
            stack = [node for node in start if inside(node) is within]
            while stack:
                node = stack.pop()
                if node in found:
                    continue
                found.add(node)
                for value in self._reads[node]:
                    waiting[value] += 1
                    if waiting[value] == self._waiting[value]:
                        freed.append(value)
                        if inside(value) is within and self._stays(value, found, within):
                            stack.append(value)
            return found

        freed: list[Node] = []
        now = len(spread(self._free, set(), True))
        waiting.clear()
        freed.clear()
        spread(self._free, set(), False)
        later = [*self._free, *freed]
        return len(spread(later, set(), True)) - now

    def _stays(self, value: Expression, loop: set[Node], within: bool) -> bool:
        """Return whether a value can be in the same loop as its users in that loop."""
        if not within:
            return True
        fold = {value.args[1]} if value.op == "fold" else frozenset[Axis]()
        outer = self._paths[value][0]
        return not any(
            user in loop and (outer in moved or outer in fold) for user, moved in self._users[value]
        )


def _branches(
    order: Sequence[Expression],
    users: Mapping[Expression, Sequence[tuple[Node, frozenset[Axis]]]],
) -> dict[Expression, Branch]:
    """Return the branch of each expression that needn't be computed in every step.

    Args:
        order: all expressions, each after its operands.
        users: for each expression, the nodes that read it.
    """
    # The conditions that hold in every lane that needs the expression's number.
    conditions: dict[Node, frozenset[Expression]] = {}
    for value in reversed(order):
        needed = [
            conditions.get(user, frozenset()) | _chosen_by(user, value) for user, _ in users[value]
        ]
        conditions[value] = frozenset.intersection(*needed)
    costs = Counter[Expression]()
    for value in order:
        for mask in conditions[value]:
            costs[mask] += _cost(value)
    worth = [mask for mask in order if costs[mask] >= _WORTH_A_BRANCH and not conditions[mask]]
    branches = {}
    for value in order:
        if masks := [mask for mask in worth if mask in conditions[value]]:
            branches[value] = Branch(max(masks, key=lambda mask: costs[mask]))
    return branches


def _chosen_by(user: Node, value: Expression) -> frozenset[Expression]:
    """Return the condition under which a node needs a value, as a set of at most one."""
    if isinstance(user, Expression) and user.op == "where" and not user.axes:
        mask, chosen, other = (_resolved(operand)[0][0] for operand in user.operands)
        if chosen is value and value not in (mask, other) and is_computed(mask):
            return frozenset([mask])
    return frozenset()


def _cost(value: Expression) -> int:
    """Return about how many simple operations of a lane compute an expression."""
    return (10 if value.op in FUNCTIONS else 1) * prod(axis.size for axis in value.axes)


def _leaves(node: Node) -> list[tuple[int, Place]]:
    """Return the elements of leaves that a node reads, as (leaf, place)."""
    return [(of.args[0], of.args[1]) for of, _ in operands(node) if of.op == "input"]


def _apart(place: Place, other: Place) -> bool:
    """Return whether two families never share an element across different iterations."""
    if place.strides != other.strides:
        return False
    return place.base == other.base or bool(
        (place.base - other.base) % gcd(*(stride for _, stride in place.strides))
    )


def shared(some: Sequence[Loop], others: Sequence[Loop]) -> list[Loop]:
    """Return the loops that are in both stacks."""
    return [one for one, other in zip(some, others, strict=False) if one is other]


def _independent(nodes: Sequence[Node]) -> list[list[Node]]:
    """Split nodes of a loop into parts that share no values, so that few registers are enough.

    A part reads no element that another part writes.
    """
    parent: dict[object, object] = {}

    def root(key: object) -> object:
        while parent.setdefault(key, key) != key:
            key = parent[key]
        return key

    for node in nodes:
        read = [of for of, _ in operands(node) if of.axes and of.op != "table"]
        keys: list[object] = [of.args[:2] if of.op == "input" else of for of in read]
        if isinstance(node, Write):
            keys.append((node.leaf, node.place))
        for key in keys:
            parent[root(key)] = root(node)
    parts = defaultdict[object, list[Node]](list)
    for node in nodes:
        parts[root(node)].append(node)
    return [*parts.values()]


def _turn_round(loop: Loop, order: Mapping[Node, int]) -> None:
    """Reverse a loop that was built from its end; nodes between loops go in expression order."""
    body: list[Node | Loop] = []
    between: list[Node] = []
    for one in [*loop.body[::-1], Loop()]:
        if isinstance(one, Loop):
            parts = _independent(between) if isinstance(loop.axis, Axis) else [between]
            for part in parts:
                values = [node for node in part if isinstance(node, Expression)]
                values.sort(key=lambda value: order[value])
                body += values
                body += [node for node in part if isinstance(node, Write)]
            between = []
            _turn_round(one, order) if one.body else None
            body.append(one)
        else:
            between.append(one)
    loop.body = body[:-1]
