"""Which way loads take through a mechanism: what a joint's load passes through, and what carries none at all.

Bodies that a loop welds together are one node. Joints and all other loops are edges. Branches that end nowhere, without
tool and loop, carry nothing but weight, and divert no load.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np


class LoadPaths:
    """The bodies of a tree, by their joints' ids (0: the base), and the loops between them.

    loops: pairs of bodies, and whether they are welded; tool: the body that the load acts on, or None; followers:
    joints and their leaders, which bear what these carry along themselves.
    """

    def __init__(
        self,
        parents: Sequence[int],
        loops: Iterable[tuple[int, int, bool]],
        tool: int | None,
        followers: Sequence[tuple[int, int]] = (),
    ):
        loops = list(loops)
        self._node = np.arange(len(parents))
        for first, second, welded in loops:
            if welded:
                self._node[self._node == self._node[first]] = self._node[second]
        self._parents = parents
        self._tool = None if tool is None else int(self._node[tool])
        self._base = int(self._node[0])
        joints = [(int(self._node[parents[joint]]), int(self._node[joint]), joint) for joint in range(1, len(parents))]
        closed = [
            (int(self._node[one]), int(self._node[other]), -1 - place)
            for place, (one, other, welded) in enumerate(loops)
            if not welded
        ]
        self._edges: dict[int, list[tuple[int, int]]] = {}
        for one, other, edge in (*joints, *closed):
            self._edges.setdefault(one, []).append((other, edge))
            self._edges.setdefault(other, []).append((one, edge))
        idle = self._pruned()
        for follower, leader in reversed(followers):
            idle -= set() if follower in idle else {leader}
        self.idle = idle

    def _pruned(self) -> frozenset[int]:
        """Remove branches that end nowhere; return their joints: they carry nothing of the tool's load."""
        edges = {node: list(near) for node, near in self._edges.items()}
        gone: set[int] = set()
        ends = [node for node in edges if len(edges[node]) == 1]
        while ends:
            node = ends.pop()
            if node in (self._tool, self._base) or len(edges[node]) != 1:
                continue
            other, edge = edges[node].pop()
            gone.add(edge)
            edges[other] = [near for near in edges[other] if near != (node, edge)]
            if len(edges[other]) == 1:
                ends.append(other)
        self._loaded = edges
        return frozenset(edge for edge in gone if edge > 0)

    def same(self, one: int, other: int) -> bool:
        """Return True for one body, or two that a loop welds together."""
        return bool(self._node[one] == self._node[other])

    def _way(self, joint: int) -> tuple[list[int], list[int]]:
        """Return the bodies that a joint's whole load passes through or ends in, in a row, and the joints between."""
        inner, inner_joints = self._followed(int(self._node[self._parents[joint]]), joint)
        outer, outer_joints = self._followed(int(self._node[joint]), joint)
        return [*reversed(inner), *outer], [*reversed(inner_joints), joint, *outer_joints]

    def _followed(self, node: int, edge: int) -> tuple[list[int], list[int]]:
        passed: list[int] = [node]
        edges: list[int] = []
        while node not in (self._tool, self._base):
            on = [near for near in self._loaded.get(node, ()) if near[1] != edge]
            if len(on) != 1 or on[0][0] in passed:
                break
            node, edge = on[0]
            passed.append(node)
            edges.append(edge)
        return passed, edges

    def reached(self, joint: int, body: int) -> bool:
        """Return True for a body that a joint's whole load passes through or ends in; for all where it carries none."""
        return joint in self.idle or int(self._node[body]) in self._way(joint)[0]

    def carries(self, joint: int, root: int, tip: int) -> bool:
        """Return True where a beam between two bodies carries the load of a joint, no more and no less."""
        return self.reached(joint, root) and self.reached(joint, tip)

    def ends(self, joint: int, inner: int, outer: int) -> list[tuple[list[int], int]]:
        """Return what acts before and beyond a beam that carries a joint's load, and what it passes first from there.

        inner, outer: the bodies of its ends, on the base's side of the joint and on the other. What is met is a joint
        by its id, a loop by -1 - its place, the load on the tool as 0; what is passed, too, and 0 where both ends are
        on one body.
        """
        bodies, joints = self._way(joint)
        at = [bodies.index(int(self._node[body])) for body in (inner, outer)]
        met = [
            [*(edge for _, edge in self._loaded.get(bodies[place], ())), *([0] if bodies[place] == self._tool else [])]
            for place in at
        ]
        if at[0] < at[1]:
            passed = [joints[at[0]], joints[at[1] - 1]]
            return [([edge for edge in edges if edge != one], one) for edges, one in zip(met, passed, strict=True)]
        # On one body: one of its ends faces the joint, the other all else.
        outward = at[0] <= joints.index(joint)
        faced = [joints[at[0]] if outward else joints[at[0] - 1]]
        others = [edge for edge in met[0] if edge not in faced]
        return [(others, 0), (faced, 0)] if outward else [(faced, 0), (others, 0)]

    def between(self, joint: int, one: int, other: int) -> list[int]:
        """Return the joints between two bodies that a joint's load passes through."""
        if joint in self.idle:
            return []
        bodies, joints = self._way(joint)
        first, last = sorted(bodies.index(int(self._node[body])) for body in (one, other))
        return [each for each in joints[first:last] if each > 0]
