//! What a learning run reports, whatever the method.

use surfabet_geom::{PointCloud, Survey};

use crate::start::ChosenOption;

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

/// What an attribute takes, and how far it is off.
#[derive(Debug, Clone, PartialEq)]
pub struct AttributeFigures {
    /// Its name in the cloud.
    pub name: String,
    /// Bytes of its stream.
    pub bytes: f64,
    /// Of numbers: root mean square difference of the input points to what the model has where they are, in the unit of
    /// the attribute; of colours over the three channels.
    pub rmse: Option<f64>,
    /// Of labels: share of the input points with the label that the model has where they are.
    pub equal: Option<f64>,
}

impl AttributeFigures {
    /// Of a model whose last two streams are colours and intensities, of which `present` are, by the bytes of all its
    /// streams; their errors are not measured.
    pub(crate) fn of_last_streams(bytes: &[f64], present: [bool; 2]) -> Vec<Self> {
        let last = &bytes[bytes.len().saturating_sub(2)..];
        let all = ["colors", "intensities"].into_iter().zip(last).zip(present);
        all.filter(|(_, is_present)| *is_present)
            .map(|((name, &bytes), _)| Self {
                name: name.to_owned(),
                bytes,
                rmse: None,
                equal: None,
            })
            .collect()
    }
}

/// The figures that a method reports.
pub trait Figures: std::fmt::Debug + Send + Sync + 'static {
    /// All figures of the whole run that there are.
    fn named(&self) -> Named;
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
        $visible:vis struct $Record:ident {
            $($(#[$what:meta])* pub $field:ident: $Value:ty = $name:literal,)*
        }
    ) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Default)]
        $visible struct $Record {
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
///
/// A program that does not care for the method sees it as `&Report<dyn Figures>`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Report<F: ?Sized> {
    /// Seconds per stage, in order, over all levels.
    pub stages: Vec<Stage>,
    /// Counts and measures of each level of a hierarchy, coarsest first.
    pub levels: Vec<Named>,
    /// Objective per iteration, by the name of what was minimised.
    pub objectives: Vec<(String, Vec<f64>)>,
    /// Iterations per objective, summed.
    pub iterations: usize,
    /// Why learning ended.
    pub stop_reason: &'static str,
    /// What each attribute that the model keeps takes, and how far it is off.
    pub attributes: Vec<AttributeFigures>,
    /// What the cloud had and the model does not keep.
    pub not_kept: Vec<String>,
    /// Options that were not given, and what the data made of them.
    pub chosen: Vec<ChosenOption>,
    /// Points that were left out as outliers.
    pub left_out: usize,
    /// The figures of the cloud, which the options that were not given follow from.
    pub survey: Survey,
    /// How far from a point its surface may be decoded and still show it, metres: two spacings, three standard deviations
    /// of the noise, or two thirds of a pixel that was asked for, whichever is most. Zero where a method does not ask.
    pub tolerance: f64,
    /// Counts and measures of the method: points in, patches, atoms, ...
    pub figures: F,
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
