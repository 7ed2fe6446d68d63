//! A scene with some of its things moved or gone.

use super::{Builder, Model, Scene};
use crate::pose::{Frame, Pose, frame_of};
use surfabet_geom::{Error, Result};

impl Scene {
    /// The scene with some instances in other poses, or without them where the pose is `None`. All else stays as it is; rows of
    /// instances behind one that is gone move up.
    ///
    /// # Errors
    /// [`surfabet_geom::Error::InvalidParameter`] for a row that does not exist and for a pose that is not rigid.
    pub fn rearranged(&self, changes: &[(u32, Option<Pose>)]) -> Result<Self> {
        let n = self.instances.len();
        let mut frames: Vec<Option<Frame>> =
            self.instance_inverses.iter().map(|inverse| Some(inverse.inverse())).collect();
        for (row, pose) in changes {
            let place = frames.get_mut(*row as usize);
            let place =
                place.ok_or_else(|| Error::invalid("instance", row, format!("below {n}")))?;
            *place = pose.as_ref().map(frame_of).transpose()?;
        }
        let mut builder = Builder::default();
        for (row, (instance, frame)) in self.instances.iter().zip(frames).enumerate() {
            if let Some(frame) = frame {
                builder.place(instance.class, instance.model, &self.model_of(row), &frame);
            }
        }
        Ok(builder.finish(self.lamp, self.interior))
    }

    /// The solids of an instance in its own frame.
    fn model_of(&self, row: usize) -> Model {
        let inverse = &self.instance_inverses[row];
        let own = self.solids.iter().filter(|solid| solid.instance as usize == row);
        let solids = own.map(|s| (s.shape, inverse * s.frame, s.texture, s.hidden));
        Model { solids: solids.collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RoomOptions;

    #[test]
    fn things_move_and_go_and_all_else_stays() {
        let scene = Scene::room(&RoomOptions::default()).unwrap();
        let of = |class: &str| {
            let row = scene.instances().iter().position(|i| i.class == class);
            row.unwrap() as u32
        };
        let (chair, bin) = (of("chair"), of("bin"));
        let mut pose = scene.instances()[chair as usize].pose;
        pose[2][3] += 0.7;
        let changed = scene.rearranged(&[(chair, Some(pose)), (bin, None)]).unwrap();
        assert_eq!(changed.instances().len(), scene.instances().len() - 1);
        // Rows behind the bin move up.
        let row = (chair - u32::from(bin < chair)) as usize;
        let (old, new) = (&scene.instances()[chair as usize], &changed.instances()[row]);
        for a in 0..3 {
            let up = if a == 2 { 0.7 } else { 0.0 };
            assert!((new.bounds.0[a] - old.bounds.0[a] - up).abs() < 1e-9);
            assert!((new.extent.1[a] - old.extent.1[a]).abs() < 1e-9);
        }
        let kept = |s: &Scene| {
            let rest = s.instances().iter().filter(|i| i.class != "bin" && i.class != "chair");
            rest.map(|i| (i.class, i.model)).collect::<Vec<_>>()
        };
        assert_eq!(kept(&scene), kept(&changed));
        // Nothing changes: the same rays.
        let same = scene.rearranged(&[]).unwrap();
        for i in 0..40 {
            let angle = f64::from(i) * 0.157;
            let direction = [angle.cos(), angle.sin(), -0.3 + 0.01 * f64::from(i)];
            let [a, b] = [&scene, &same].map(|s| s.cast([0.1, 0.2, 1.6], direction));
            let places = [a, b].map(|hit| hit.map(|hit| (hit.instance, hit.surface)));
            assert_eq!(places[0], places[1]);
            let lengths = [a, b].map(|hit| hit.map_or(0.0, |hit| hit.distance));
            assert!((lengths[0] - lengths[1]).abs() < 1e-9);
        }
        assert!(scene.rearranged(&[(10_000, None)]).is_err());
        assert!(scene.rearranged(&[(chair, Some([[2.0; 4]; 4]))]).is_err());
    }
}
