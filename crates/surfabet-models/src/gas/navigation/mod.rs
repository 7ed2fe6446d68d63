//! Where a robot can stand on a map, and the ways between these places: the use that the paper's conclusion names.
//!
//! Nodes are points of the neurons' discs, closer than neurons are, so that a passage need not have a neuron in its middle:
//! those on ground that is flat enough, with nothing in the upright cylinder of the robot above them. Two that lie side by
//! side are joined where the robot can move straight from one to the other, and so are those on both sides of a gap in the
//! ground that is narrower than half of the robot's radius: the shadow of a table leg. There are no nodes where the map has
//! no ground.
//!
//! | file | computes |
//! |---|---|
//! | `robot` | the size of a robot, and what it can climb |
//! | `clearance` | whether anything is in the way |

mod clearance;
mod robot;

use crate::gas::constants::LEAST_INSIDE;
use surfabet_base::parallel;
use surfabet_geom::{KdTree, Neighbor, Progress};

use self::clearance::Clearance;
pub use self::robot::Robot;
use super::adjacency::Adjacency;
use super::model::GasModel;
use super::surface::topology::{ShortestPaths, components};
use crate::error::{Error, Result};
use crate::vector::distance;

/// Nodes that one task joins.
const NODES_PER_TASK: usize = 64;

/// The places where a robot can stand, joined where it can go from one to the next; immutable.
#[derive(Debug, Clone)]
pub struct NavigationGraph {
    robot: Robot,
    origin: [f64; 3],
    /// The neuron nearest to every node.
    neurons: Vec<u32>,
    /// The ground under the nodes, metres about the origin.
    positions: Vec<[f32; 3]>,
    edges: Vec<[u32; 2]>,
    adjacency: Adjacency,
    /// The nodes by place; `None` without any.
    tree: Option<KdTree>,
}

impl GasModel {
    /// The places where a robot can stand, and the straight ways between them. `up` is the direction against gravity, of any
    /// length.
    ///
    /// The result depends on the model and the robot alone, not on the number of threads.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for a robot or a direction outside of their domains, [`Error::TooManyPoints`] for a
    /// robot that is tiny on this map, [`Error::Cancelled`].
    pub fn navigation(
        &self,
        robot: Robot,
        up: [f64; 3],
        progress: &dyn Progress,
    ) -> Result<NavigationGraph> {
        robot.check()?;
        let clearance = Clearance::of(self, robot, up, progress)?;
        let standing = parallel::try_map_chunks(
            clearance.surface(),
            NODES_PER_TASK,
            |surface| -> Result<Vec<[f32; 3]>> {
                progress.check()?;
                let stands = |at: [f32; 3]| clearance.is_free(at, at);
                let ground = surface.iter().filter(|s| clearance.is_level(s.normal));
                Ok(ground.map(|s| s.position).filter(|&at| stands(at)).collect())
            },
        )?;
        let positions = standing.concat();
        progress.update("finding places to stand", 1.0);
        let tree = if positions.is_empty() { None } else { Some(KdTree::new(&positions)?) };
        let edges = match &tree {
            Some(tree) => ways(&positions, tree, &clearance, progress)?,
            None => Vec::new(),
        };
        progress.update("finding ways", 1.0);
        let neurons = KdTree::new(&self.positions())?.nearest_batch(&positions, progress)?;
        Ok(NavigationGraph {
            robot,
            origin: self.origin(),
            neurons: neurons.iter().map(|n| n.index() as u32).collect(),
            adjacency: Adjacency::new(positions.len(), &edges),
            positions,
            edges,
            tree,
        })
    }
}

/// The pairs of nodes that lie side by side, or across a narrow gap, between which the robot can move; the smaller number
/// first, ascending.
fn ways(
    positions: &[[f32; 3]],
    tree: &KdTree,
    clearance: &Clearance,
    progress: &dyn Progress,
) -> Result<Vec<[u32; 2]>> {
    let stride = clearance.stride() as f32;
    let sides = tree.within_batch(positions, stride, progress)?;
    let is_at_border = |node: usize| sides.get(node).len() < LEAST_INSIDE;
    let of_node = |node: usize| {
        let mut further = Vec::new();
        let near = if is_at_border(node) {
            tree.within(positions[node], clearance.across_gap() as f32, &mut further);
            &further
        } else {
            sides.get(node)
        };
        let is_beside = |n: &&Neighbor| {
            n.squared_distance() <= stride * stride
                || is_at_border(n.index())
                    && clearance.is_narrow(positions[node], positions[n.index()])
        };
        let others = near.iter().filter(is_beside).map(|n| n.index()).filter(|&o| o > node);
        let mut others: Vec<usize> =
            others.filter(|&o| clearance.is_free(positions[node], positions[o])).collect();
        others.sort_unstable();
        others.into_iter().map(move |other| [node as u32, other as u32])
    };
    let nodes: Vec<usize> = (0..positions.len()).collect();
    let found =
        parallel::try_map_chunks(&nodes, NODES_PER_TASK, |chunk| -> Result<Vec<[u32; 2]>> {
            progress.check()?;
            Ok(chunk.iter().copied().flat_map(of_node).collect())
        })?;
    Ok(found.concat())
}

impl NavigationGraph {
    /// The robot that the graph is for.
    pub fn robot(&self) -> Robot {
        self.robot
    }

    /// World position that positions are about, metres.
    pub fn origin(&self) -> [f64; 3] {
        self.origin
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.neurons.len()
    }

    /// True where the robot can stand nowhere.
    pub fn is_empty(&self) -> bool {
        self.neurons.is_empty()
    }

    /// The neuron nearest to every node.
    pub fn neurons(&self) -> &[u32] {
        &self.neurons
    }

    /// The ground under the nodes, metres about the origin.
    pub fn positions(&self) -> &[[f32; 3]] {
        &self.positions
    }

    /// Pairs of joined nodes, the smaller number first, sorted.
    pub fn edges(&self) -> &[[u32; 2]] {
        &self.edges
    }

    /// Connected component of every node: numbers from zero, in the order of the components' first nodes.
    pub fn components(&self) -> Vec<u32> {
        components(&self.adjacency)
    }

    /// The nodes of the shortest path between the nodes nearest to two points of the world; `None` where none leads from one
    /// to the other.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for a point that is further from all nodes than the robot is high.
    pub fn path(&self, start: [f64; 3], goal: [f64; 3]) -> Result<Option<Vec<u32>>> {
        let [start, goal] = [("start", start), ("goal", goal)].map(|end| self.node_at(end));
        let paths = ShortestPaths::from(start?, &self.adjacency, &self.positions);
        Ok(paths.to(goal?))
    }

    /// The node nearest to a point of the world that an argument gives.
    fn node_at(&self, (argument, point): (&'static str, [f64; 3])) -> Result<usize> {
        let local = std::array::from_fn(|a| (point[a] - self.origin[a]) as f32);
        let is_finite = local.iter().all(|c: &f32| c.is_finite());
        let nearest = self.tree.as_ref().filter(|_| is_finite).and_then(|t| t.nearest(local));
        let near = nearest.map(|n| n.index()).filter(|&node| {
            let node = self.positions[node].map(f64::from);
            distance(node, local.map(f64::from)) <= self.robot.height
        });
        near.ok_or_else(|| {
            let what =
                format!("within {} m of a place where the robot can stand", self.robot.height);
            Error::invalid(argument, format!("{point:?}"), what)
        })
    }
}
