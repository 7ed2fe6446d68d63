"""Growing neural gas: a map as neurons that spread over its surface and know who is next to them.

A scan becomes a number of neurons chosen beforehand, joined by edges where the surface goes on;
each knows colour, normal, how many points it stands for and how these spread.

Fritzke: A Growing Neural Gas Network Learns Topologies, NIPS 1995; used for maps by Morell,
Cazorla, Orts-Escolano and Garcia-Rodriguez: 3D Maps Representation Using GNG, 2014.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Literal, final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from surfabet import _core
from surfabet._checks import check_integer, check_number, check_vector
from surfabet._core import PointCloud
from surfabet._progress import Progress, progress_callback
from surfabet.meshes import Mesh
from surfabet.model import Model
from surfabet.navigation import NavigationGraph

__all__ = ["GasModel", "Neurons", "learn_gas"]


@dataclass(frozen=True, slots=True)
class Neurons:
    """All n neurons of a model as arrays, in the order of the file: along the topology."""

    positions: NDArray[np.float64]
    """World positions, (n, 3), metres."""
    normals: NDArray[np.float32]
    """Unit normals, (n, 3), towards where the surface was seen from if the scan knew; zero where
    unknown."""
    colors: NDArray[np.uint8] | None
    """Colours, (n, 3), 0 to 255; None without."""
    intensities: NDArray[np.float32] | None
    """Mean intensities, (n,), in the sensor's own unit; None without."""
    counts: NDArray[np.float64]
    """Points that each neuron stands for, (n,), to a quarter of a doubling."""
    radii: NDArray[np.float64]
    """Radius of the disc over which its points spread, (n,), metres."""
    thicknesses: NDArray[np.float64]
    """Standard deviation of its points across the disc, (n,), metres."""

    @property
    def densities(self) -> NDArray[np.float64]:
        """Points per square metre of surface, (n,); infinite where the disc has no area."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.counts / (np.pi * self.radii**2)

    def __len__(self) -> int:
        return len(self.positions)


@final
class GasModel(Model[_core.GasModel]):
    """A cloud as a gas of neurons with a topology; immutable.

    Made by `learn_gas`, `GasModel.update` and `surfabet.load`. It decodes to its neurons by
    default. At a given spacing every neuron's disc is filled as far as no other neuron is nearer,
    and so are edges between discs that do not meet.
    """

    __slots__ = ()

    def update(
        self,
        cloud: PointCloud,
        n_neurons: int | None = None,
        *,
        published: bool = False,
        patterns: int | None = None,
        polish: int = 10,
        epsilon_w: float = 0.2,
        epsilon_n: float = 0.006,
        alpha: float = 0.5,
        beta: float | None = None,
        max_age: int = 50,
        target_error: float | None = None,
        color_step: int = 8,
        attribute_step: float = 0.125,
        search: Literal["indexed", "brute-force"] = "indexed",
        keep_outliers: bool = False,
        random_state: int = 0,
        progress: Progress = None,
    ) -> GasModel:
        """Adds another scan of the same world: a larger model, this one stays as it is.

        Signals come from the new scan and from points spread over this model's discs, in proportion
        to the numbers of points of both, so that nothing is forgotten where the new scan does not
        reach and both are averaged where it does.

        Parameters
        ----------
        cloud
            The new scan, in the same world frame.
        n_neurons
            Number of neurons afterwards; by default the space that both occupy gets as many per
            volume as this model has.
        published
            The method as printed, without what was added to it: 300 `patterns` and a `beta` of
            0.005 where they are not given, and no `polish`. True or False; by default False.
        patterns
            Signals per inserted neuron (lambda, the paper's patterns). An integer from 1 to below
            2^32; by default 20, or 300 where no `polish` follows or growth ends by `target_error`.
        polish
            Rounds of k-means over all points after growth (none of the published steps). Each moves
            every neuron to the mean of its points, those of the first half also neurons that are
            hardly needed to where errors are large; then edges are learned anew. With 0 the network
            stays as it has grown. An integer from 0 to 10000; by default 10.
        epsilon_w
            Share of the way to the signal that the winner moves (epsilon_w, also epsilon_b). A
            number above 0 and at most 1; by default 0.2.
        epsilon_n
            Share of the way to the signal that the winner's neighbours move (epsilon_n). A number
            from 0 to 1; by default 0.006.
        alpha
            Factor of the errors of the two neurons that a new one is put between (alpha). A number
            above 0 and below 1; by default 0.5.
        beta
            Share of every error that is forgotten with each signal (beta, 1 - d). The published
            0.005 is for 100 neurons; with it a network of thousands remembers the errors of the
            last few hundred signals only, most neurons having had none of them. A number from 0 to
            0.5; by default 0.5 divided by the number of neurons, the same memory per neuron for any
            number; 0.005 in the published method.
        max_age
            Age above which an edge is removed (a_max). An integer from 1 to 2^30; by default 50.
        target_error
            Mean distance of signals to their winners at which the network stops growing before it
            has all its neurons. A number from 1e-9 to 1e9 metres; by default it grows until it has
            all its neurons.
        color_step
            Rounding of colours. An integer from 1 to 64 grey levels; by default 8.
        attribute_step
            Rounding of the mean intensities of neurons, as a share of their standard deviation. A
            number from 0.001 to 100 standard deviations; by default 0.125.
        search
            How winners are found. 'brute-force' gives the same network, slowly. 'indexed' or
            'brute-force'; by default indexed.
        keep_outliers
            Keeps points that are far from all others. Otherwise they are left out, and counted in
            the report: the network would put many of its neurons between a few of them and the
            scene. True or False; by default False.
        random_state
            Seed of the signals. An integer from 0 to below 2^64; by default 0.
        progress
            None, True for a bar on stderr, or a callable of stage and fraction.

        Raises
        ------
        InvalidInputError
            For an empty scan, fewer neurons than this model has, or options outside their range.
        """
        options = {
            "published": published,
            "patterns": patterns,
            "polish": polish,
            "epsilon_w": epsilon_w,
            "epsilon_n": epsilon_n,
            "alpha": alpha,
            "beta": beta,
            "max_age": max_age,
            "target_error": target_error,
            "color_step": color_step,
            "attribute_step": attribute_step,
            "search": search,
            "keep_outliers": keep_outliers,
            "random_state": random_state,
        }
        if n_neurons is not None:
            check_integer("n_neurons", n_neurons, 1)
        with progress_callback(progress) as callback:
            return GasModel(
                self._core.update(cloud, options, n_neurons=n_neurons, progress=callback)
            )

    def mesh(self) -> Mesh:
        """The induced triangulation: its vertices are the neurons, in their order.

        Anticlockwise seen from where the normals point to; no edge is passed twice in one
        direction. Holes of up to twelve edges are closed.
        """
        neurons = self.neurons
        return Mesh(neurons.positions, self._core.mesh(), neurons.colors)

    def export(self, path: str | os.PathLike[str]) -> int:
        """Writes `mesh()` to a file, `.ply`, `.obj` or `.glb`, and returns its size in bytes; see
        `Mesh.export`."""
        return self.mesh().export(path)

    def components(self) -> NDArray[np.uint32]:
        """Connected component of every neuron, (n,), numbered from zero."""
        return self._core.components()

    def geodesic_distances(self, source: int) -> NDArray[np.float64]:
        """Length of the shortest way along edges from one neuron to all, (n,), metres; infinite to
        other components."""
        check_integer("source", source, 0, len(self) - 1)
        return self._core.geodesic_distances(source)

    def geodesic_distance(self, source: int, target: int) -> float:
        """Length of the shortest way along edges between two neurons, metres, or infinity."""
        check_integer("target", target, 0, len(self) - 1)
        return float(self.geodesic_distances(source)[target])

    def navigation(
        self,
        *,
        radius: float = 0.25,
        height: float = 1.0,
        max_step: float = 0.05,
        max_slope: float = 15.0,
        up: ArrayLike = (0.0, 0.0, 1.0),
        progress: Progress = None,
    ) -> NavigationGraph:
        """Where a robot can stand on this map, and the ways between these places.

        Points of the neurons' discs, a sixth of the robot's radius apart, are such places where the
        ground is flat enough and nothing is in the upright cylinder of the robot above. Two that
        lie side by side, or across a gap in the ground of less than half the radius, are joined
        where the robot can move straight from one to the other. The same on any number of threads.

        After `update` with another scan, make the graph anew: it takes a fraction of the time of
        the update.

        Parameters
        ----------
        radius, height
            The cylinder that holds the robot, metres.
        max_step
            The largest step that it takes, metres; what is lower is no obstacle.
        max_slope
            The steepest ground that it drives on, degrees.
        up
            The direction against gravity, (3,), of any length.
        progress
            None, True for a bar on stderr, or a callable of stage and fraction.

        Raises
        ------
        InvalidInputError
            For sizes that are not positive, a step as high as the robot, a slope of 80 degrees and
            more, or a robot that is tiny on this map.
        """
        metres = "a positive number of metres"
        check_number("radius", radius, metres, above=0.0)
        check_number("height", height, metres, above=0.0)
        below_height = "a number of metres from 0 to below the height"
        check_number("max_step", max_step, below_height, least=0.0)
        degrees = "a number of degrees from 0 to below 80"
        check_number("max_slope", max_slope, degrees, least=0.0)
        with progress_callback(progress) as callback:
            graph = self._core.navigation(
                radius=radius,
                height=height,
                max_step=max_step,
                max_slope=max_slope,
                up=check_vector("up", up, "three numbers x, y, z"),
                progress=callback,
            )
        return NavigationGraph(graph.positions(), graph.neurons(), graph.edges(), graph)

    @property
    def neurons(self) -> Neurons:
        """All neurons as arrays."""
        return Neurons(
            positions=self._core.positions(),
            normals=self._core.normals(),
            colors=self._core.colors(),
            intensities=self._core.intensities(),
            counts=self._core.counts(),
            radii=self._core.radii(),
            thicknesses=self._core.thicknesses(),
        )

    @property
    def edges(self) -> NDArray[np.uint32]:
        """Pairs of joined neurons, (m, 2), the smaller number first, sorted."""
        return self._core.edges()

    @property
    def mean_error(self) -> float:
        """Mean distance of the input points to their nearest neurons, metres (ME of the paper)."""
        return self._core.mean_error

    @property
    def position_step(self) -> float:
        """Rounding of positions, metres."""
        return self._core.position_step

    def __repr__(self) -> str:
        return (
            f"GasModel({self.n_points} points as {len(self)} neurons with {len(self.edges)} edges, "
            f"mean error {self.mean_error:.3g} m" + (", coloured" if self.has_color else "") + ")"
        )


def learn_gas(
    cloud: PointCloud,
    *,
    quality: Literal["small", "balanced", "fine"] = "balanced",
    n_neurons: int | None = None,
    published: bool = False,
    patterns: int | None = None,
    polish: int = 10,
    epsilon_w: float = 0.2,
    epsilon_n: float = 0.006,
    alpha: float = 0.5,
    beta: float | None = None,
    max_age: int = 50,
    target_error: float | None = None,
    passes: float | None = None,
    position_step: float | None = None,
    color_step: int = 8,
    attribute_step: float = 0.125,
    search: Literal["indexed", "brute-force"] = "indexed",
    keep_outliers: bool = False,
    random_state: int = 0,
    progress: Progress = None,
) -> GasModel:
    """Learns a growing neural gas: as many neurons as asked for, spread over the scan.

    The ten steps are Fritzke's. Results depend on input, options and seed alone.

    Parameters
    ----------
    cloud
        The scan.
    quality
        Small files or fine detail. Sets `n_neurons`, unless that is given, to about half as many
        for 'small' and three times as many for 'fine'. 'small', 'balanced' or 'fine'; by default
        balanced.
    n_neurons
        Number of neurons at which the network stops growing. More than the points have places are
        not made. An integer from 2 to 2^26; by default one for each cell that holds points, its
        side twice the tolerance: two spacings, or three standard deviations of the noise.
    published
        The method as printed, without what was added to it: 300 `patterns` and a `beta` of 0.005
        where they are not given, and no `polish`. True or False; by default False.
    patterns
        Signals per inserted neuron (lambda, the paper's patterns). An integer from 1 to below 2^32;
        by default 20, or 300 where no `polish` follows or growth ends by `target_error`.
    polish
        Rounds of k-means over all points after growth (none of the published steps). Each moves
        every neuron to the mean of its points, those of the first half also neurons that are hardly
        needed to where errors are large; then edges are learned anew. With 0 the network stays as
        it has grown. An integer from 0 to 10000; by default 10.
    epsilon_w
        Share of the way to the signal that the winner moves (epsilon_w, also epsilon_b). A number
        above 0 and at most 1; by default 0.2.
    epsilon_n
        Share of the way to the signal that the winner's neighbours move (epsilon_n). A number from
        0 to 1; by default 0.006.
    alpha
        Factor of the errors of the two neurons that a new one is put between (alpha). A number
        above 0 and below 1; by default 0.5.
    beta
        Share of every error that is forgotten with each signal (beta, 1 - d). The published 0.005
        is for 100 neurons; with it a network of thousands remembers the errors of the last few
        hundred signals only, most neurons having had none of them. A number from 0 to 0.5; by
        default 0.5 divided by the number of neurons, the same memory per neuron for any number;
        0.005 in the published method.
    max_age
        Age above which an edge is removed (a_max). An integer from 1 to 2^30; by default 50.
    target_error
        Mean distance of signals to their winners at which the network stops growing before it has
        all its neurons. A number from 1e-9 to 1e9 metres; by default it grows until it has all its
        neurons.
    passes
        Number of signals as a multiple of the number of points. Learning ends there, whether or not
        the network has all its neurons. A number above 0 and at most 1e6; by default `patterns`
        signals per neuron.
    position_step
        Rounding of positions, taken to the next power of two below. A number from 1e-9 to 1e9
        metres; by default a sixteenth of the mean edge.
    color_step
        Rounding of colours. An integer from 1 to 64 grey levels; by default 8.
    attribute_step
        Rounding of the mean intensities of neurons, as a share of their standard deviation. A
        number from 0.001 to 100 standard deviations; by default 0.125.
    search
        How winners are found. 'brute-force' gives the same network, slowly. 'indexed' or
        'brute-force'; by default indexed.
    keep_outliers
        Keeps points that are far from all others. Otherwise they are left out, and counted in the
        report: the network would put many of its neurons between a few of them and the scene. True
        or False; by default False.
    random_state
        Seed of the signals. An integer from 0 to below 2^64; by default 0.
    progress
        None, True for a bar on stderr, or a callable of stage and fraction.

    Raises
    ------
    InvalidInputError
        For an empty scan, more neurons than places, or options outside their range.

    Examples
    --------
    >>> import numpy as np, surfabet as sb
    >>> points = np.random.default_rng(0).random((2000, 3)) * [1, 1, 0]
    >>> model = sb.learn_gas(sb.PointCloud(points), n_neurons=50)
    >>> len(model), model.components().max()
    (50, np.uint32(0))
    """
    options = {
        "quality": quality,
        "n_neurons": n_neurons,
        "published": published,
        "patterns": patterns,
        "polish": polish,
        "epsilon_w": epsilon_w,
        "epsilon_n": epsilon_n,
        "alpha": alpha,
        "beta": beta,
        "max_age": max_age,
        "target_error": target_error,
        "passes": passes,
        "position_step": position_step,
        "color_step": color_step,
        "attribute_step": attribute_step,
        "search": search,
        "keep_outliers": keep_outliers,
        "random_state": random_state,
    }
    with progress_callback(progress) as callback:
        return GasModel(_core.learn_gas(cloud, options, progress=callback))
