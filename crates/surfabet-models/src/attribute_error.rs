//! How far the attributes of a model are off.

use surfabet_geom::{KdTree, PointCloud, Progress};

use crate::contract::{DecodeOptions, SurfaceModel};
use crate::error::Result;
use crate::report::AttributeFigures;
use crate::stages::Stages;

/// Points that are compared, about: of as many the root mean square is exact to about a percent.
const COMPARED: usize = 20_000;

/// The `figures` with their errors: those of the model's cloud, decoded with `options`. Without any, nothing is decoded.
///
/// # Errors
/// Those of decoding.
pub(crate) fn measured<M: SurfaceModel>(
    model: &M,
    mut figures: Vec<AttributeFigures>,
    options: DecodeOptions,
    cloud: &PointCloud,
    stages: &mut Stages<'_>,
) -> Result<Vec<AttributeFigures>> {
    if figures.is_empty() {
        return Ok(figures);
    }
    stages.run("measuring attributes", |progress| {
        let decoded = model.decode(options, progress)?;
        measure(&mut figures, cloud, &decoded, progress)?;
        Ok(figures)
    })
}

/// Notes in `figures` by how much colours and intensities of `cloud` differ from those of the nearest point of the
/// `decoded` cloud, for points in even steps through the cloud.
///
/// # Errors
/// [`crate::Error::Cancelled`].
fn measure(
    figures: &mut [AttributeFigures],
    cloud: &PointCloud,
    decoded: &PointCloud,
    progress: &dyn Progress,
) -> Result<()> {
    if decoded.is_empty() {
        return Ok(());
    }
    let tree = KdTree::new(&decoded.positions_about(cloud.origin()))?;
    let compared: Vec<usize> =
        (0..cloud.len()).step_by(cloud.len().div_ceil(COMPARED).max(1)).collect();
    let positions: Vec<[f32; 3]> = compared.iter().map(|&i| cloud.positions()[i]).collect();
    let nearest = tree.nearest_batch(&positions, progress)?;
    let pairs = || compared.iter().zip(&nearest).map(|(&i, near)| (i, near.index()));
    for of in figures {
        of.rmse = match of.name.as_str() {
            "colors" => cloud.colors().zip(decoded.colors()).and_then(|(given, kept)| {
                root_mean_square(pairs().flat_map(|(i, j)| {
                    let difference = move |c: usize| f64::from(given[i][c]) - f64::from(kept[j][c]);
                    (0..3).map(difference)
                }))
            }),
            "intensities" => {
                cloud.intensities().zip(decoded.intensities()).and_then(|(given, kept)| {
                    root_mean_square(pairs().map(|(i, j)| f64::from(given[i]) - f64::from(kept[j])))
                })
            }
            _ => None,
        };
    }
    Ok(())
}

/// Root of the mean square of some values; `None` without any.
fn root_mean_square(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (sum, n) = values.fold((0.0, 0_u64), |(sum, n), v| (sum + v * v, n + 1));
    (n > 0).then(|| (sum / n as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use surfabet_geom::{CloudParts, Silent};

    use super::*;

    fn cloud(x: &[f32], intensities: &[f32], red: &[u8]) -> PointCloud {
        let parts = CloudParts {
            positions: x.iter().map(|&x| [x, 0.0, 0.0]).collect(),
            intensities: Some(intensities.to_vec()),
            colors: Some(red.iter().map(|&r| [r, 0, 0]).collect()),
            ..CloudParts::default()
        };
        PointCloud::from_parts(parts).unwrap().0
    }

    #[test]
    fn errors_are_those_to_the_nearest_decoded_point() {
        let given = cloud(&[0.0, 0.1, 1.0], &[1.0, 2.0, 9.0], &[10, 20, 30]);
        let decoded = cloud(&[0.0, 1.0], &[2.0, 7.0], &[10, 24]);
        let named = |name: &str| AttributeFigures {
            name: name.to_owned(),
            bytes: 1.0,
            rmse: None,
            equal: None,
        };
        let mut figures = [named("colors"), named("intensities")];
        measure(&mut figures, &given, &decoded, &Silent).unwrap();
        // Squares of 0, 10 and 6 over nine channels; of 1, 0 and 2 over three values.
        assert_eq!(figures[0].rmse, Some((136.0_f64 / 9.0).sqrt()));
        assert_eq!(figures[1].rmse, Some((5.0_f64 / 3.0).sqrt()));
    }
}
