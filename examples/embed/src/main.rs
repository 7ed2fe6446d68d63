//! Compresses a list of `x y z` lines into a model file and tells how far its surface is from the points.

use surfabet::geom::{EvaluateOptions, evaluate};
use surfabet::{DecodeOptions, Model, PatchesOptions, PointCloud, Silent, patches};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(input), Some(output)) = (arguments.next(), arguments.next()) else {
        return Err("usage: embed IN.xyz OUT.sfb".into());
    };
    let mut points = Vec::new();
    for line in std::fs::read_to_string(&input)?.lines() {
        let mut numbers = line.split_whitespace().map(str::parse::<f32>);
        if let (Some(x), Some(y), Some(z)) = (numbers.next(), numbers.next(), numbers.next()) {
            points.push([x?, y?, z?]);
        }
    }
    let (cloud, _) = PointCloud::from_positions(points);
    let model = Model::from(patches::learn(&cloud, &PatchesOptions::default(), &Silent)?);
    let bytes = model.save(&output)?;
    let decoded = model.decode(DecodeOptions::default(), &Silent)?;
    let quality = evaluate(&cloud, &decoded, &EvaluateOptions::default(), &Silent)?;
    println!("{} points, {bytes} bytes, rmse {:.4} m", cloud.len(), quality.rmse);
    Ok(())
}
