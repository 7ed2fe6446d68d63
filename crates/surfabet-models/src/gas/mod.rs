//! Growing neural gas.
mod accumulated;
mod edges;
mod grow;
mod index;
mod network;
mod options;
mod signals;
pub use options::{GasOptions, MAX_NEURONS, Search};

/// probe
pub fn probe(points: &[[f32; 3]], o: &GasOptions) -> (Vec<[f32; 3]>, usize, Vec<f64>) {
    use index::*;
    let mut s = signals::Signals::new(&[(points, 1.0)], o.random_state);
    let two = s.two_places().unwrap();
    let n = o.n_neurons as u64 * u64::from(o.patterns);
    let stop = grow::Stop { n_neurons: o.n_neurons, target_error: None, signals: n, at_most: 2 * n };
    let p = &surfabet_geom::Silent;
    let g = match o.search {
        Search::Indexed => grow::grow(network::Network::new(Index::new(), o.into(), &two), s, o.patterns, stop, p),
        Search::BruteForce => grow::grow(network::Network::new(BruteForce::default(), o.into(), &two), s, o.patterns, stop, p),
    }.unwrap();
    (g.graph.positions, g.graph.edges.len(), g.trace)
}
