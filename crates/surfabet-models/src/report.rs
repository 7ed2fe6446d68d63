//! What a learning run reports, whatever the method.

use surfabet_geom::PointCloud;

/// One stage of a run.
#[derive(Debug, Clone, PartialEq)]
pub struct Stage {
    /// What was done.
    pub name: &'static str,
    /// Wall-clock seconds it took.
    pub seconds: f64,
}

/// Counts and measures of a run by name, in the order in which they are shown.
pub type Named = Vec<(&'static str, f64)>;

/// The figures that a method reports.
pub trait Figures: std::fmt::Debug + Clone + PartialEq + Default + Send + Sync + 'static {
    /// All figures of the whole run that there are.
    fn named(&self) -> Named;
}

impl Figures for Named {
    fn named(&self) -> Named {
        self.clone()
    }
}

/// A model read from a file has no figures.
impl<F: Figures> Figures for Option<F> {
    fn named(&self) -> Named {
        self.as_ref().map(F::named).unwrap_or_default()
    }
}

/// A value in a record of figures; `None` where a run has no such figure.
pub(crate) trait Figure {
    /// The value as a number.
    fn value(self) -> Option<f64>;
}

impl Figure for f64 {
    fn value(self) -> Option<f64> {
        Some(self)
    }
}

impl Figure for usize {
    fn value(self) -> Option<f64> {
        Some(self as f64)
    }
}

impl Figure for u64 {
    fn value(self) -> Option<f64> {
        Some(self as f64)
    }
}

impl<T: Figure> Figure for Option<T> {
    fn value(self) -> Option<f64> {
        self.and_then(T::value)
    }
}

/// Declares the record of figures of a method: each field with the name that it is shown by.
macro_rules! figures {
    (
        $(#[$about:meta])*
        pub struct $Record:ident {
            $($(#[$what:meta])* pub $field:ident: $Value:ty = $name:literal,)*
        }
    ) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Default)]
        pub struct $Record {
            $($(#[$what])* pub $field: $Value,)*
        }

        impl $crate::report::Figures for $Record {
            fn named(&self) -> $crate::report::Named {
                use $crate::report::Figure as _;
                let all = [$(($name, self.$field.value())),*];
                all.into_iter().filter_map(|(name, value)| Some((name, value?))).collect()
            }
        }
    };
}
pub(crate) use figures;

/// How a model came about. It is not part of the file: a model read back has an empty report.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Report<F = Named> {
    /// Seconds per stage, in order, over all levels.
    pub stages: Vec<Stage>,
    /// Counts and measures of the method: points in, patches, atoms, ...
    pub figures: F,
    /// Counts and measures of each level of a hierarchy, coarsest first.
    pub levels: Vec<Vec<(&'static str, f64)>>,
    /// Objective per iteration, by the name of what was minimised.
    pub objectives: Vec<(String, Vec<f64>)>,
    /// Iterations per objective, summed.
    pub iterations: usize,
    /// Why learning ended.
    pub stop_reason: &'static str,
    /// What the cloud had and the model does not keep.
    pub not_kept: Vec<String>,
}

impl<F: Figures> Report<F> {
    /// The same report with the figures by name, for programs that do not care for the method.
    pub fn by_name(&self) -> Report<Named> {
        Report {
            stages: self.stages.clone(),
            figures: self.figures.named(),
            levels: self.levels.clone(),
            objectives: self.objectives.clone(),
            iterations: self.iterations,
            stop_reason: self.stop_reason,
            not_kept: self.not_kept.clone(),
        }
    }
}

impl Report {
    /// Adds to the figure `name`.
    pub(crate) fn add_figure(&mut self, name: &'static str, value: f64) {
        match self.figures.iter_mut().find(|figure| figure.0 == name) {
            Some(figure) => figure.1 += value,
            None => self.figures.push((name, value)),
        }
    }
}

/// A value carried beside a model: models that differ in it alone are equal.
#[derive(Debug, Clone, Default)]
pub(crate) struct Beside<T>(pub T);

impl<T> PartialEq for Beside<T> {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// What `cloud` has beyond positions and is not among `kept`, by name.
pub(crate) fn lost(cloud: &PointCloud, kept: &[&str]) -> Vec<String> {
    let crs = cloud.crs().map(|_| "crs");
    let present = cloud.attributes().into_iter().chain(crs);
    present.filter(|name| !kept.contains(name)).map(str::to_owned).collect()
}

#[cfg(test)]
mod tests {
    use surfabet_geom::CloudParts;

    use super::*;

    figures! {
        /// Of a run that did not reduce.
        pub struct SomeFigures {
            /// A count.
            pub points: usize = "points",
            /// A measure that this run has not.
            pub reduced: Option<u64> = "points, reduced",
            /// A measure.
            pub grid_size: f64 = "grid size",
        }
    }

    #[test]
    fn lost_is_what_the_cloud_has_and_the_model_does_not_keep() {
        let parts = CloudParts {
            positions: vec![[0.0; 3]],
            colors: Some(vec![[1; 3]]),
            ranges: Some(vec![1.0]),
            extra: vec![("classification".to_owned(), vec![2_u8].into())],
            crs: Some("EPSG:25832".to_owned()),
            ..CloudParts::default()
        };
        let cloud = PointCloud::from_parts(parts).unwrap().0;
        assert_eq!(lost(&cloud, &["colors"]), ["ranges", "classification", "crs"]);
        assert_eq!(lost(&PointCloud::default(), &[]), [""; 0]);
    }

    #[test]
    fn figures_are_listed_by_name_in_order_without_those_that_a_run_has_not() {
        let figures = SomeFigures { points: 3, reduced: None, grid_size: 0.5 };
        assert_eq!(figures.named(), [("points", 3.0), ("grid size", 0.5)]);
        assert_eq!(Some(figures).named(), figures.named());
        assert_eq!(None::<SomeFigures>.named(), []);
    }
}
