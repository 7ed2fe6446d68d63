"""Where a robot can stand on a map of neurons, and the ways between these places."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surfabet import _core
from surfabet._checks import check_vector

__all__ = ["NavigationGraph"]


@final
@dataclass(frozen=True, eq=False)
class NavigationGraph:
    """The places where a robot can stand, joined where it can go from one to the next; immutable.

    Made by `GasModel.navigation`.
    """

    positions: NDArray[np.float64]
    """The ground under the nodes in the world, (n, 3), metres."""
    neurons: NDArray[np.uint32]
    """The neuron nearest to every node, (n,)."""
    edges: NDArray[np.uint32]
    """Pairs of nodes between which the robot can move straight, (m, 2)."""
    _graph: _core.NavigationGraph

    def __len__(self) -> int:
        return len(self.positions)

    def __repr__(self) -> str:
        return f"NavigationGraph({len(self):,} nodes, {len(self.edges):,} edges)"

    def components(self) -> NDArray[np.uint32]:
        """Connected component of every node, (n,): numbers from zero.

        The robot can reach a node from another one where both have the same number.
        """
        return self._graph.components()

    def path(self, start: ArrayLike, goal: ArrayLike) -> NDArray[np.float64] | None:
        """The shortest path from node to node (Dijkstra's).

        Parameters
        ----------
        start, goal
            Points of the world, (3,), metres: the path goes between the nodes that are nearest.

        Returns
        -------
        ndarray or None
            Positions of the nodes along the path, (k, 3), metres; None where the robot cannot go
            from one to the other.

        Raises
        ------
        InvalidInputError
            For a point that is further from all nodes than the robot is high.
        """
        place = "three numbers x, y, z"
        nodes = self._graph.path(
            check_vector("start", start, place), check_vector("goal", goal, place)
        )
        return None if nodes is None else self.positions[nodes]
