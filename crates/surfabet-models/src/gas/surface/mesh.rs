//! The surface between the neurons: triangles of the induced graph, all seen from the same side.

use std::collections::HashMap;

use crate::gas::constants::{LARGEST_HOLE, LEAST_TRIANGLE_COSINE};
use crate::gas::model::GasModel;
use crate::vector::{cross, dot, minus};

impl GasModel {
    /// Triangles of neurons, anticlockwise seen from where their normals point to.
    ///
    /// Three neurons joined to each other are a triangle of the induced triangulation. Where more of them meet than
    /// a surface has room for, smaller ones go first. An edge is used by at most one triangle in each direction,
    /// so that the orientation is consistent. Holes of up to twelve edges, which the graph has where four neurons or more are
    /// about equally far from each other, are closed.
    pub fn mesh(&self) -> Vec<[u32; 3]> {
        let mut mesh = Mesh {
            model: self,
            positions: self.positions(),
            sides: HashMap::new(),
            triangles: Vec::new(),
        };
        for (_, [i, j, k]) in mesh.cliques() {
            let triangle = match mesh.cosine([i, j, k]) {
                Some(c) if c >= LEAST_TRIANGLE_COSINE => [i, j, k],
                Some(c) if c <= -LEAST_TRIANGLE_COSINE => [i, k, j],
                Some(_) => continue,
                // The side is unknown: whichever fits.
                None if mesh.has_room([i, j, k]) => [i, j, k],
                None => [i, k, j],
            };
            mesh.add(triangle);
        }
        mesh.close_holes();
        mesh.triangles
    }
}

/// The triangles so far.
struct Mesh<'a> {
    model: &'a GasModel,
    positions: Vec<[f32; 3]>,
    /// Directed edges of the triangles so far, and the third corner of each.
    sides: HashMap<[u32; 2], u32>,
    triangles: Vec<[u32; 3]>,
}

/// The directed edges of a triangle.
fn sides([i, j, k]: [u32; 3]) -> [[u32; 2]; 3] {
    [[i, j], [j, k], [k, i]]
}

impl Mesh<'_> {
    /// Neurons joined to each other, by the sum of squared edges in position steps.
    fn cliques(&self) -> Vec<(i64, [u32; 3])> {
        let adjacency = &self.model.adjacency;
        let mut found = Vec::new();
        for i in 0..adjacency.len() {
            let later: Vec<u32> =
                adjacency.of(i).iter().copied().filter(|&j| j as usize > i).collect();
            for (at, &j) in later.iter().enumerate() {
                for &k in
                    later[at + 1..].iter().filter(|&&k| adjacency.joined(j as usize, k as usize))
                {
                    let triangle = [i as u32, j, k];
                    let size = sides(triangle).iter().map(|&e| self.squared(e)).sum();
                    found.push((size, triangle));
                }
            }
        }
        found.sort_unstable();
        found
    }

    /// Squared length of an edge in position steps.
    fn squared(&self, [a, b]: [u32; 2]) -> i64 {
        let [p, q] = [a, b].map(|i| self.model.neurons[i as usize].position);
        (0..3).map(|i| (i64::from(p[i]) - i64::from(q[i])).pow(2)).sum()
    }

    /// Cosine between a triangle's normal and that of its corners; `None` where one of both is unknown.
    fn cosine(&self, triangle: [u32; 3]) -> Option<f64> {
        let [p, q, r] = triangle.map(|i| self.positions[i as usize].map(f64::from));
        let across = cross(minus(q, p), minus(r, p));
        let mut normal = [0.0; 3];
        for i in triangle {
            let n = self.model.normal(i as usize);
            (0..3).for_each(|a| normal[a] += f64::from(n[a]));
        }
        let lengths = (dot(across, across) * dot(normal, normal)).sqrt();
        (lengths > 0.0).then(|| dot(across, normal) / lengths)
    }

    /// True when no side of the triangle is used in its direction.
    fn has_room(&self, triangle: [u32; 3]) -> bool {
        sides(triangle).iter().all(|side| !self.sides.contains_key(side))
    }

    /// Adds a triangle where there is room for it.
    fn add(&mut self, triangle: [u32; 3]) -> bool {
        let fits = self.has_room(triangle);
        if fits {
            let [i, j, k] = triangle;
            self.sides.extend(sides(triangle).into_iter().zip([k, i, j]));
            self.triangles.push(triangle);
        }
        fits
    }

    /// Fills rings of edges that are used in one direction only.
    fn close_holes(&mut self) {
        // The sides that a triangle would have to use: the rim the other way round.
        let mut open: Vec<[u32; 2]> = self
            .sides
            .keys()
            .filter(|[a, b]| !self.sides.contains_key(&[*b, *a]))
            .map(|&[a, b]| [b, a])
            .collect();
        open.sort_unstable();
        for [start, second] in open {
            // Filling a ring before may have used this side.
            if self.sides.contains_key(&[start, second]) {
                continue;
            }
            let mut ring = vec![start];
            let mut last = [start, second];
            while last[1] != start && ring.len() < LARGEST_HOLE {
                ring.push(last[1]);
                last = self.next_open(last);
            }
            // A rim may hold a neuron more than once.
            if last[1] == start && ring.len() >= 4 {
                self.fill(ring);
            }
        }
    }

    /// The side of the rim that follows an open one: the other end of the fan of triangles about its end.
    fn next_open(&self, [a, b]: [u32; 2]) -> [u32; 2] {
        let mut to = a;
        while let Some(&third) = self.sides.get(&[b, to]) {
            to = third;
        }
        [b, to]
    }

    /// Triangulates a ring: cuts off the ear with the shortest new side, as long as there is one along the surface.
    fn fill(&mut self, mut ring: Vec<u32>) {
        while ring.len() >= 3 {
            let n = ring.len();
            let ear = |i: usize| [ring[(i + n - 1) % n], ring[i], ring[(i + 1) % n]];
            let best = (0..n)
                .filter(|&i| ear(i)[0] != ear(i)[2])
                .filter(|&i| self.cosine(ear(i)).is_some_and(|c| c >= LEAST_TRIANGLE_COSINE))
                .filter(|&i| self.has_room(ear(i)))
                .min_by_key(|&i| (self.squared([ear(i)[2], ear(i)[0]]), ring[i]));
            let Some(i) = best else { return };
            self.add(ear(i));
            if n == 3 {
                return;
            }
            ring.remove(i);
        }
    }
}
