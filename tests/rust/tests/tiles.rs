//! Maps in tiles: each learned alone, together the map without tiles; and their files, hostile ones too.
#![allow(missing_docs, clippy::unwrap_used)]

use std::collections::HashSet;

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use surfabet::patches::{Cubes, Known, TilePlan, TileTask, learn_tile, plan};
use surfabet::{
    AnyModel, CloudParts, DecodeOptions, Limits, Model, Part, PatchModel, PatchesOptions,
    PointCloud, Region, Silent, TiledModel,
};

const PIXEL: f64 = 0.01;
const SIDE: f64 = 0.64;

/// Floor and two walls of 1.2 m, turned, a point every 6 mm, with noise of 2 mm and colours; the corner lies where borders of
/// tiles would be if their place did not follow from the points.
fn corner() -> PointCloud {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let (sine, cosine) = 0.4_f32.sin_cos();
    let (mut positions, mut colors) = (Vec::new(), Vec::new());
    for i in 0..200 {
        for j in 0..200 {
            let (a, b) = (i as f32 * 0.006, j as f32 * 0.006);
            for axis in 0..3 {
                let off: f64 = rng.sample(StandardNormal);
                let mut p = [0.0; 3];
                p[axis] = (0.002 * off) as f32;
                p[(axis + 1) % 3] = a;
                p[(axis + 2) % 3] = b;
                positions.push([cosine * p[0] - sine * p[1], sine * p[0] + cosine * p[1], p[2]]);
                colors.push([(a * 200.0) as u8, (b * 200.0) as u8, 80 * axis as u8]);
            }
        }
    }
    let parts = CloudParts { positions, colors: Some(colors), ..CloudParts::default() };
    PointCloud::from_parts(parts).unwrap().0
}

fn options() -> PatchesOptions {
    PatchesOptions { resolution: Some(PIXEL), completeness: 0.0, ..PatchesOptions::default() }
}

fn plan_of(cloud: &PointCloud, options: &PatchesOptions) -> TilePlan {
    let (low, high) = cloud.bounds().unwrap();
    plan(cloud, [low, high], &[], Some(SIDE), 1, options, &Silent).unwrap()
}

/// The tile in a cube, of points that all weigh the same.
fn tile(
    cloud: &PointCloud,
    cube: [i32; 3],
    plan: &TilePlan,
    options: &PatchesOptions,
) -> Option<PatchModel> {
    let task = TileTask { cloud, known: Known::default(), cube, plan, options };
    learn_tile(&task, &Silent).unwrap()
}

/// All tiles, with their cubes.
fn tiles(
    cloud: &PointCloud,
    plan: &TilePlan,
    options: &PatchesOptions,
) -> Vec<([i32; 3], PatchModel)> {
    let mut found = Vec::new();
    for i in 0..7 * 7 * 7 {
        let cube = [i % 7 - 3, i / 7 % 7 - 3, i / 49 - 3];
        found.extend(tile(cloud, cube, plan, options).map(|model| (cube, model)));
    }
    found
}

fn merged(plan: &TilePlan, tiles: &[([i32; 3], PatchModel)]) -> TiledModel {
    let of = |(cube, model): &([i32; 3], PatchModel)| {
        TiledModel::of_tile(plan, *cube, &[Some(model.clone())]).unwrap()
    };
    TiledModel::merge(&tiles.iter().map(of).collect::<Vec<_>>(), &Silent).unwrap()
}

fn open(bytes: &[u8], part: Part) -> Result<Option<TiledModel>, surfabet::OpenError> {
    let mut source = bytes;
    TiledModel::open(&mut source, &Limits::default(), part)
}

#[test]
fn tiles_hold_every_point_once_and_the_surface_once() {
    let cloud = corner();
    let options = options();
    let plan = plan_of(&cloud, &options);
    let tiles = tiles(&cloud, &plan, &options);
    assert!(tiles.len() >= 4, "{}", tiles.len());
    let n_points: u64 = tiles.iter().map(|(_, model)| model.n_points()).sum();
    assert_eq!(n_points, cloud.len() as u64);
    // No square of the lattice has two patches at about one depth, from whatever tiles.
    let mut seen: HashSet<(u8, u32, [i32; 2], i32)> = HashSet::new();
    let mut pixels = 0_u64;
    for (_, model) in &tiles {
        for leaf in model.leaves() {
            let depth = leaf.patch.coefficients[0] * model.lattice().depth_step as i32 / 16;
            assert!(seen.insert((leaf.side, leaf.level, leaf.corner, depth.div_euclid(16))));
        }
        let of = |level: u32| 1_u64 << (2 * (model.lattice().levels - 1 - level));
        pixels += model
            .level_sizes()
            .iter()
            .zip(0..)
            .map(|(size, level)| size.set_pixels * of(level))
            .sum::<u64>();
    }
    // One cube around everything, of the same lattice.
    let cubes = Cubes { side: 4096, offset: [2048; 3] };
    let one = TilePlan { cubes, ..plan.clone() };
    let whole = tile(&cloud, [-1; 3], &one, &options).unwrap();
    assert_eq!(whole.n_points(), cloud.len() as u64);
    let wanted: u64 = whole
        .level_sizes()
        .iter()
        .zip(0..)
        .map(|(size, level)| size.set_pixels << (2 * (whole.lattice().levels - 1 - level)))
        .sum();
    let ratio = pixels as f64 / wanted as f64;
    assert!((0.98..1.02).contains(&ratio), "{pixels} of {wanted} pixels");
}

#[test]
fn points_beyond_the_margin_make_no_difference() {
    let cloud = corner();
    let options = options();
    let plan = plan_of(&cloud, &options);
    let all = tiles(&cloud, &plan, &options);
    for (cube, model) in all.iter().take(3) {
        // The ball about the tile that holds it and its margin.
        let rows = plan.lattice.orientation.rotation();
        let corner = plan.cubes.corner(*cube).map(|c| (c as f64 + 32.0) * PIXEL);
        let middle: [f64; 3] = std::array::from_fn(|k| {
            plan.lattice.origin[k] + (0..3).map(|a| rows[k][a] * corner[a]).sum::<f64>()
        });
        let radius = 3.0_f64.sqrt() * (0.5 * SIDE + plan.margin());
        let near = |i: &usize| {
            let p = cloud.world(*i);
            (0..3).map(|a| (p[a] - middle[a]).powi(2)).sum::<f64>() <= radius * radius
        };
        let near: Vec<usize> = (0..cloud.len()).filter(near).collect();
        assert!(near.len() < cloud.len());
        let part = cloud.select(&near).unwrap();
        let again = tile(&part, *cube, &plan, &options).unwrap();
        assert_eq!(&again, model);
    }
}

#[test]
fn files_come_back_and_parts_are_parts_of_the_whole() {
    let cloud = corner();
    let options = PatchesOptions { completeness: 0.999, ..options() };
    let plan = plan_of(&cloud, &options);
    let tiles = tiles(&cloud, &plan, &options);
    let model = merged(&plan, &tiles);
    let bytes = model.to_bytes().unwrap();
    let again = open(&bytes, Part::default()).unwrap().unwrap();
    assert!(again == model, "read back, the model is another");
    assert_eq!(again.to_bytes().unwrap(), bytes);
    assert_eq!(again.n_points(), cloud.len() as u64);
    // In whatever order the tiles came.
    let mut backwards = tiles.clone();
    backwards.reverse();
    assert_eq!(merged(&plan, &backwards).to_bytes().unwrap(), bytes);
    for as_measured in [false, true] {
        let decoding = DecodeOptions { as_measured, normals: true, ..DecodeOptions::default() };
        let whole = AnyModel::decode(&again, decoding, &Silent).unwrap();
        let region = Region::new([-0.2, 0.1, -0.1], [0.5, 0.7, 0.4]).unwrap();
        let part = Part { region: Some(region), level: None };
        let read = open(&bytes, part).unwrap().unwrap();
        let wanted = region.crop(&whole).unwrap();
        assert!(wanted.len() > 1000);
        assert!(read.tiles().count() < again.tiles().count());
        assert_eq!(AnyModel::decode(&read, decoding, &Silent).unwrap(), wanted);
        assert_eq!(again.decode_within(&region, decoding, &Silent).unwrap(), wanted);
    }
    let error = Model::from_bytes(&bytes, &Limits::default()).unwrap_err().to_string();
    assert!(error.contains("tiles"), "{error}");
}

/// Damage ends in an error, or the same model where nothing was harmed that a reader needs.
#[test]
fn every_cut_and_every_flip_is_an_error_or_harmless() {
    let positions = (0..10_000).map(|i| [(i % 200) as f32 * 0.005, (i / 200) as f32 * 0.02, 1.0]);
    let cloud = PointCloud::from_positions(positions.collect()).0;
    let options = options();
    let plan = plan_of(&cloud, &options);
    let tiles = tiles(&cloud, &plan, &options);
    let model = merged(&plan, &tiles);
    let bytes = model.to_bytes().unwrap();
    for len in 0..bytes.len() {
        assert!(open(&bytes[..len], Part::default()).is_err(), "cut to {len}");
    }
    let decode = |model: &TiledModel| {
        AnyModel::decode(model, DecodeOptions::default(), &Silent).map(|cloud| cloud.len())
    };
    for bit in 0..8 * bytes.len() {
        let mut flipped = bytes.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        if let Ok(Some(read)) = open(&flipped, Part::default()) {
            assert!(read == model, "bit {bit}");
            assert_eq!(decode(&read).unwrap(), decode(&model).unwrap());
        }
    }
}
