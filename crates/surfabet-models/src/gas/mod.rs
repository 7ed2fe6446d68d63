//! Growing neural gas: a map as neurons that spread over its surface and know who is next to them.
//!
//! B. Fritzke: *A Growing Neural Gas Network Learns Topologies*, NIPS 1995, as used for maps by V. Morell,
//! M. Cazorla, S. Orts-Escolano, J. Garcia-Rodriguez: *3D Maps Representation Using GNG*, 2014. A cloud runs
//! through the files of this folder in this order:
//!
//! | file | step | paper |
//! |---|---|---|
//! | `options` | what to learn | |
//! | `signals` | points drawn at random | step 2 |
//! | `index` | winner and second winner, exactly | step 3 |
//! | `edges` | edges with ages | steps 4, 7, 8 |
//! | `accumulated` | errors that decay, and the largest | steps 5, 9, 10 |
//! | `network` | the ten steps | 1995, section 2 |
//! | `grow` | from signal to signal until there is enough | stopping criterion |
//! | `statistics`, `orient` | colour, normal, number of points, radius and thickness of every neuron | future work |
//! | `order`, `model`, `syntax` | the result, in the integers that a file stores | |
//! | `decode` | back to a cloud at any spacing | future work |
//! | `mesh`, `topology` | triangles, components, ways along the surface | |
//! | `learn` | all of it, and the update with another scan | |

mod adjacency;
mod coding;
mod contract;
mod decode;
mod describe;
mod learn;
mod model;
mod network;
mod options;
mod surface;
mod winners;

pub use learn::learn;
pub use model::{GasHeader, GasModel, MAX_COORDINATE, MAX_EXPONENT, NORMAL_BITS, Neuron};
pub use network::{Graph, Network, Rates};
pub use options::{GasOptions, MAX_NEURONS, Search};
pub use winners::index::{BruteForce, Index, Winner, Winners};
