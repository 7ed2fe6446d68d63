//! Whether anything is in the way of a robot.

use crate::gas::constants::{CLEARANCE_SPACING, CLEARANCE_STRIDE, CROSSED_GAP};
use surfabet_geom::{KdTree, Progress};

use super::robot::Robot;
use crate::contract::DecodeOptions;
use crate::error::{Error, Result};
use crate::gas::model::GasModel;
use crate::vector::{cross, dot, least_axis, length, unit};

/// A point of a surface.
pub(super) struct SurfacePoint {
    /// Metres about the model's origin.
    pub position: [f32; 3],
    pub normal: [f32; 3],
}

/// What the map holds, as points, and the room that a robot needs.
pub(super) struct Clearance {
    robot: Robot,
    /// Two level directions and the one upwards.
    axes: [[f64; 3]; 3],
    /// The surfaces of the map.
    surface: Vec<SurfacePoint>,
    tree: KdTree,
    /// Distance between points of the surfaces, metres.
    spacing: f64,
    /// Level distance from the middle of the robot within which a point is in the way, metres.
    reach: f64,
}

impl Clearance {
    pub fn of(
        model: &GasModel,
        robot: Robot,
        up: [f64; 3],
        progress: &dyn Progress,
    ) -> Result<Self> {
        let size = length(up);
        if !(size.is_finite() && size > 0.0) {
            return Err(Error::invalid("up", format!("{up:?}"), "a direction"));
        }
        let up = up.map(|c| c / size);
        let level = unit(cross(up, least_axis(up)));
        let spacing = CLEARANCE_SPACING * robot.radius;
        let options =
            DecodeOptions { resolution: Some(spacing), normals: true, ..DecodeOptions::default() };
        let decoded = model.decode(options, progress)?;
        let positions = decoded.positions_about(model.origin());
        let tree = KdTree::new(&positions)?;
        let normals = decoded.normals().unwrap_or_default();
        let point = |(position, &normal)| SurfacePoint { position, normal };
        // The surface between points reaches into the cylinder by less than half of their distance.
        let reach = robot.radius + 0.5 * spacing;
        let axes = [level, cross(up, level), up];
        let surface = positions.into_iter().zip(normals).map(point).collect();
        Ok(Self { robot, axes, surface, tree, spacing, reach })
    }

    /// The surfaces of the map, where the robot may stand.
    pub fn surface(&self) -> &[SurfacePoint] {
        &self.surface
    }

    /// Distance between nodes that lie side by side, at most, metres.
    pub fn stride(&self) -> f64 {
        CLEARANCE_STRIDE * self.spacing
    }

    /// The longest way across a gap in the ground, with the step or the slope that the robot climbs there, metres.
    pub fn across_gap(&self) -> f64 {
        let gap = CROSSED_GAP * self.robot.radius;
        gap.hypot(self.climb(gap))
    }

    /// Whether the robot crosses a gap between two pieces of ground as wide as that between two points.
    pub fn is_narrow(&self, from: [f32; 3], to: [f32; 3]) -> bool {
        let way = self.turned(std::array::from_fn(|a| f64::from(to[a]) - f64::from(from[a])));
        way[0].hypot(way[1]) <= CROSSED_GAP * self.robot.radius
    }

    /// What the robot climbs on a level distance: a step, and the slope.
    fn climb(&self, run: f64) -> f64 {
        self.robot.max_step + self.robot.max_slope.to_radians().tan() * run
    }

    /// Whether the robot can drive on a surface with this normal.
    pub fn is_level(&self, normal: [f32; 3]) -> bool {
        let upwards = dot(normal.map(f64::from), self.axes[2]).abs();
        upwards >= self.robot.max_slope.to_radians().cos()
    }

    /// Whether the robot can move straight from ground to ground, or stand there where both are the same.
    ///
    /// A point is in the way when it is within reach of the line between them, seen from above, and above the ground there by
    /// less than the robot is high, and by more than what it climbs: a step, and the slope from the middle of the robot to
    /// the point.
    pub fn is_free(&self, from: [f32; 3], to: [f32; 3]) -> bool {
        let height = self.robot.height;
        let [from, to] = [from, to].map(|p| p.map(f64::from));
        let way = self.turned(std::array::from_fn(|a| to[a] - from[a]));
        let run = way[0].hypot(way[1]);
        if way[2].abs() > self.climb(run) {
            return false;
        }
        let middle = std::array::from_fn(|a| {
            (0.5 * (from[a] + to[a]) + 0.5 * height * self.axes[2][a]) as f32
        });
        let radius = (0.5 * run + self.reach).hypot(0.5 * (height + way[2].abs()));
        let mut near = Vec::new();
        self.tree.within(middle, radius as f32, &mut near);
        near.iter().all(|n| {
            let point = self.surface[n.index()].position;
            let offset = self.turned(std::array::from_fn(|a| f64::from(point[a]) - from[a]));
            // The share of the way where the robot passes the point.
            let along =
                (offset[0] * way[0] + offset[1] * way[1]) / (run * run).max(f64::MIN_POSITIVE);
            let along = along.clamp(0.0, 1.0);
            let aside = (offset[0] - along * way[0]).hypot(offset[1] - along * way[1]);
            let above = offset[2] - along * way[2];
            aside > self.reach || above <= self.climb(aside) || above >= height
        })
    }

    /// A vector along the two level directions and upwards.
    fn turned(&self, vector: [f64; 3]) -> [f64; 3] {
        self.axes.map(|axis| dot(axis, vector))
    }
}
