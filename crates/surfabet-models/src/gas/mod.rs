//! Growing neural gas: a map as neurons that spread over its surface, joined by edges between neighbours on it.
//!
//! B. Fritzke: *A Growing Neural Gas Network Learns Topologies*, NIPS 1995, as used for maps by V. Morell,
//! M. Cazorla, S. Orts-Escolano, J. Garcia-Rodriguez: *3D Maps Representation Using GNG*, 2014. A cloud runs
//! through the files of this folder in this order:
//!
//! | file | step | paper |
//! |---|---|---|
//! | `options` | what to learn | |
//! | `learn` | the steps | |
//! | `network/signals` | points drawn at random | step 2 |
//! | `winners` | winner and second winner, exactly | step 3 |
//! | `network/edges` | edges with ages | steps 4, 7, 8 |
//! | `network/accumulated` | errors that decay, and the largest | steps 5, 9, 10 |
//! | `network` | the ten steps | 1995, section 2 |
//! | `network/growth` | from signal to signal until there is enough | stopping criterion |
//! | `ordered` | the points along a space-filling curve | |
//! | `polish` | k-means from the grown network, and its edges | ours, not in published mode |
//! | `finish`, `describe` | positions rounded; colour, normal, number of points, radius and thickness of every neuron | future work |
//! | `model`, `coding` | the result, in the integers that a file stores | |
//! | `decode` | back to a cloud at any spacing | future work |
//! | `surface` | triangles, components, distances along the surface | |
//! | `navigation` | where a robot can stand, and its ways | future work |
//! | `update` | the same with another scan, from the neurons that there are | |
//! | `adjacency` | the neighbours of every neuron | |
//! | `contract` | what every model can do | |
//! | `constants` | tuned constants, each with its reason | |

mod adjacency;
mod coding;
mod constants;
mod contract;
mod decode;
mod describe;
mod finish;
mod learn;
mod model;
mod navigation;
mod network;
mod options;
mod ordered;
mod polish;
mod surface;
mod update;
mod winners;

pub use finish::{GasFigures, GasReport};
pub use learn::learn;
pub use model::{GasHeader, GasModel, MAX_COORDINATE, MAX_EXPONENT, NORMAL_BITS, Neuron};
pub use navigation::{NavigationGraph, Robot};
pub use network::{Graph, Network, Rates};
pub use options::{GasOptions, MAX_NEURONS, Search};
pub use winners::{BruteForce, Index, Winner, Winners};

/// Distance between two positions, metres.
fn distance(p: [f32; 3], q: [f32; 3]) -> f64 {
    crate::vector::distance(p.map(f64::from), q.map(f64::from))
}
