//! Maps in tiles that go on: another scan of the same place, and maps of one plan as one.
//!
//! A tile is learned again from what maps hold of it, decoded with the thickness that was measured, and from the points of a
//! new scan. A decoded point counts as much as the points that it stands for: those that its tile was learned from, shared
//! evenly. Tiles that nothing new lies in keep their bytes.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use surfabet_codec::{TileEntry, TiledHeader};
use surfabet_geom::{PointCloud, Progress, Survey};
use surfabet_models::patches::{
    self, AttributeContent, AttributeHeader, KeptSheets, Known, Lattice, PatchesOptions,
    PointCoding, Recipe, ScanColumns, SheetTree, TilePlan,
};
use surfabet_models::{Error, Region};

use crate::error::Result;
use crate::tiled::{Quiet, TiledModel};

/// A map after another scan.
#[derive(Debug, Clone, PartialEq)]
pub struct Updated {
    /// The map.
    pub model: TiledModel,
    /// Number of tiles that were learned again or anew.
    pub learned: usize,
    /// Points of the scan that are far from all others, which are no part of the map.
    pub left_out: usize,
}

/// Finest pixels that a patch with its thickness may reach from its surface, with all that counts as being in it.
const THICKEST: f64 = 20.0;

type Tile = (TileEntry, Arc<[u8]>);

impl TiledModel {
    /// The map with what another scan of the same world shows. Tiles that none of its points lies in keep their bytes; points
    /// outside of all tiles make new ones. What a map was loaded without is not known. With `alone` it is a map of what the scan
    /// shows by itself, by the same plan.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for a scan without what the map keeps (attributes, sides of surfaces), and for a map that
    /// does not hold how it was learned, was loaded with one of several levels of detail, or keeps a bound on its error, which
    /// cannot be kept without the points; [`Error::Cancelled`].
    pub fn update(
        &self,
        cloud: &PointCloud,
        alone: bool,
        progress: &dyn Progress,
    ) -> Result<Updated> {
        let rules = Rules::of(self, "model")?;
        let strays = Survey::of(cloud, &Quiet(progress))?.strays;
        let scan = Scan::new(&without(cloud, &strays)?, &rules)?;
        let cubes = rules.plan.cubes_of(&scan.cloud);
        let own = [self];
        let maps = if alone { &own[..0] } else { &own[..] };
        let learner = Learner { rules: &rules, maps, scan: Some(&scan) };
        let held = maps.iter().flat_map(|map| map.held());
        let mut tiles: Vec<Tile> =
            held.filter(|(entry, _)| !cubes.contains_key(&entry.cube)).collect();
        learner.add(&cubes, &mut tiles, progress)?;
        let model = Self::of_tiles(self.header().clone().renewed(), tiles)?;
        Ok(Updated { model, learned: cubes.len(), left_out: strays.len() })
    }

    /// What [`TiledModel::update`] learns of one tile, for scans that are larger than the memory: a map of this tile alone, from
    /// points of a scan among which are all within [`TiledModel::scan_margin`] of it; `None` where none lies in it. `mean_weight`
    /// is that of all points of the scan, from [`TiledModel::scan_weight`].
    ///
    /// # Errors
    /// As [`TiledModel::update`].
    pub fn updated_tile(
        &self,
        points: &PointCloud,
        cube: [i32; 3],
        mean_weight: f64,
        alone: bool,
        progress: &dyn Progress,
    ) -> Result<Option<Self>> {
        let rules = Rules::of(self, "model")?;
        let scan = Scan { mean_weight, ..Scan::new(points, &rules)? };
        let Some(&n_new) = rules.plan.cubes_of(&scan.cloud).get(&cube) else { return Ok(None) };
        let own = [self];
        let maps = if alone { &own[..0] } else { &own[..] };
        let learner = Learner { rules: &rules, maps, scan: Some(&scan) };
        let tiles = learner.tile(cube, n_new, &Quiet(progress))?;
        Ok(Some(Self::of_tiles(self.header().clone().renewed(), tiles)?))
    }

    /// The map with some tiles in place of its own, as [`TiledModel::updated_tile`] gives them; with `alone` of these alone.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for tiles of another plan.
    pub fn with_tiles(&self, tiles: &[Self], alone: bool) -> Result<Self> {
        if let Some(what) = tiles.iter().find_map(|tile| difference(self.header(), tile.header())) {
            return Err(Error::invalid("tiles", what, "learned by the plan of the map").into());
        }
        let cubes: BTreeSet<[i32; 3]> =
            tiles.iter().flat_map(Self::held).map(|(entry, _)| entry.cube).collect();
        let own = (!alone).then(|| self.held()).into_iter().flatten();
        let kept = own.filter(|(entry, _)| !cubes.contains(&entry.cube));
        let all = kept.chain(tiles.iter().flat_map(Self::held)).collect();
        Self::of_tiles(self.header().clone().renewed(), all)
    }

    /// What tiles of the map are learned by.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] for a map that cannot be learned on, as [`TiledModel::update`].
    pub fn tile_plan(&self) -> Result<TilePlan> {
        Ok(Rules::of(self, "model")?.plan)
    }

    /// How far from a tile points of a scan matter to it, metres.
    ///
    /// # Errors
    /// As [`TiledModel::tile_plan`].
    pub fn scan_margin(&self) -> Result<f64> {
        let plan = self.tile_plan()?;
        Ok(plan.margin() + THICKEST * plan.lattice.pixel_size)
    }

    /// Points that the tile in a cube decodes to when it is learned again; 0 without one.
    ///
    /// # Errors
    /// For a damaged tile.
    pub fn remembered_points(&self, cube: [i32; 3]) -> Result<f64> {
        let last = self.header().details.len() - 1;
        let mut own = self.held().filter(|(entry, _)| entry.level == last && entry.cube == cube);
        own.next()
            .map_or(Ok(0.0), |(entry, bytes)| Ok(self.read_tile(&entry, &bytes)?.n_measured()))
    }

    /// Sum of the weights of points of a scan, by their ranges.
    ///
    /// # Errors
    /// As [`TiledModel::tile_plan`].
    pub fn scan_weight(&self, points: &PointCloud) -> Result<f64> {
        Ok(sum(&Rules::of(self, "model")?.weights(points)))
    }

    /// The map of all tiles of some maps of one plan, in any order. A tile that one of them has, or that is the same in all,
    /// keeps its bytes; where tiles of several differ, one is learned from them all.
    ///
    /// # Errors
    /// [`Error::InvalidParameter`] without maps, and for maps of different plans; where tiles differ as
    /// [`TiledModel::update`].
    pub fn merge(maps: &[Self], progress: &dyn Progress) -> Result<Self> {
        let Some(first) = maps.first() else { return Err(Error::EmptyCloud.into()) };
        for map in &maps[1..] {
            if let Some(what) = difference(first.header(), map.header()) {
                let requirement = "made with one plan: add the scan of one to the other with update, or decode one as \
                    measured and update the other with that";
                return Err(Error::invalid("models", what, requirement).into());
            }
        }
        let mut of_places: BTreeMap<(usize, [i32; 3]), Vec<Tile>> = BTreeMap::new();
        for tile in maps.iter().flat_map(Self::held) {
            let same = of_places.entry((tile.0.level, tile.0.cube)).or_default();
            if !same.iter().any(|other| is_copy(other, &tile)) {
                same.push(tile);
            }
        }
        // A cube that differs at one level of detail is learned again at all of them.
        let cubes: BTreeMap<[i32; 3], u64> = of_places
            .iter()
            .filter(|(_, tiles)| tiles.len() > 1)
            .map(|(&(_, cube), _)| (cube, 0))
            .collect();
        let alone = of_places.into_iter().filter(|((_, cube), _)| !cubes.contains_key(cube));
        let mut tiles: Vec<Tile> = alone.flat_map(|(_, tiles)| tiles).collect();
        let is_learned = !cubes.is_empty();
        if is_learned {
            let rules: Vec<Rules> =
                maps.iter().map(|map| Rules::of(map, "models")).collect::<Result<_>>()?;
            let all: Vec<&Self> = maps.iter().collect();
            let learner = Learner { rules: &rules[0], maps: &all, scan: None };
            learner.add(&cubes, &mut tiles, progress)?;
        }
        let is_renewed = is_learned || maps.iter().any(|map| map.header().is_renewed());
        let header = first.header().clone();
        Self::of_tiles(if is_renewed { header.renewed() } else { header }, tiles)
    }
}

/// True for two tiles that hold the same.
fn is_copy((a, of_a): &Tile, (b, of_b): &Tile) -> bool {
    (a.level, a.cube, a.n_points) == (b.level, b.cube, b.n_points) && of_a == of_b
}

/// The cloud without some of its points.
fn without(cloud: &PointCloud, strays: &[u32]) -> Result<PointCloud> {
    if strays.is_empty() {
        return Ok(cloud.clone());
    }
    let mut out = strays.iter().map(|&i| i as usize).peekable();
    let kept: Vec<usize> = (0..cloud.len()).filter(|i| out.next_if_eq(i).is_none()).collect();
    Ok(cloud.select(&kept)?)
}

/// What differs between the plans of two maps, in words; `None` for one plan.
fn difference(a: &TiledHeader, b: &TiledHeader) -> Option<String> {
    let lattices = [a, b].map(|h| h.details.last().map(|d| d.lattice).unwrap_or_default());
    let [one, other] = lattices;
    let is_placed = |l: Lattice| (l.origin, l.orientation.quaternion);
    let kept = |h: &TiledHeader| {
        let detail = h.details.last();
        let colors = detail.and_then(|d| d.color);
        (colors, detail.map(|d| d.attributes.clone()))
    };
    let mut plans = [a.clone(), b.clone()];
    plans.iter_mut().flat_map(|h| &mut h.details).for_each(|detail| {
        // What tiles that were learned by one plan may differ in.
        (detail.n_points, detail.point_coding) = (0, PointCoding::default());
    });
    Some(if one.pixel_size != other.pixel_size {
        format!("maps with pixels of {} and {} m", one.pixel_size, other.pixel_size)
    } else if is_placed(one) != is_placed(other) {
        "maps whose axes, or the places that these are counted from, differ".into()
    } else if a.cubes != b.cubes {
        let side = |h: &TiledHeader| f64::from(h.cubes.side) * one.pixel_size;
        format!("maps with tiles of {:.3} and {:.3} m, or at other places", side(a), side(b))
    } else if kept(a) != kept(b) {
        "maps that keep other attributes, or round them differently".into()
    } else if plans[0] != plans[1] {
        "maps whose points or options ask for other rules of learning".into()
    } else {
        return None;
    })
}

/// What tiles of a map are learned by.
struct Rules {
    plan: TilePlan,
    options: PatchesOptions,
}

impl Rules {
    /// Those of a map; `name` is the argument that it is.
    fn of(map: &TiledModel, name: &'static str) -> Result<Self> {
        let header = map.header();
        let refuse = |what: &str, requirement: &'static str| {
            Err(Error::invalid(name, what, requirement).into())
        };
        let Some(detail) = header.details.last() else {
            return refuse("without levels of detail", "of one or more");
        };
        if header.details.len() > 1 && map.is_of_one_level() {
            return refuse("loaded with one level of detail", "loaded with all of them");
        }
        let Some(recipe) = &header.recipe else {
            return refuse(
                "a file that does not say how its tiles were learned",
                "made by this version of surfabet",
            );
        };
        if detail.max_error.is_some() || detail.max_error_forward.is_some() {
            return refuse(
                "learned with max_error or max_error_forward",
                "without: a bound on the error holds for points that are no longer there",
            );
        }
        let recipe: &Recipe = recipe;
        let n_details = header.details.len() as u32;
        let (plan, options) = recipe.plan_of(detail, header.cubes, n_details);
        plan.check()?;
        let lattices = (0..n_details).map(|level| plan.of_detail(level, &options).0.lattice);
        if !lattices.eq(header.details.iter().map(|detail| detail.lattice)) {
            return refuse(
                "with levels of detail of other pixels than this version learns",
                "with pixels four times as large from level to level",
            );
        }
        Ok(Self { plan, options })
    }

    /// Weights of points of a scan, by their ranges.
    fn weights(&self, cloud: &PointCloud) -> Vec<f32> {
        let sensor = self.options.sensor;
        match cloud.ranges() {
            Some(ranges) => ranges.iter().map(|&range| sensor.weight(range)).collect(),
            None => vec![1.0; cloud.len()],
        }
    }

    /// The box of a tile and all points that matter to it, and so many pixels about them: half of one is more than rounding to
    /// single precision takes.
    fn region(&self, cube: [i32; 3], about: f64) -> Result<Region> {
        let lattice = &self.plan.lattice;
        let rotation = lattice.orientation.rotation();
        let corner = self.plan.cubes.corner(cube).map(|c| c as f64 * lattice.pixel_size);
        let margin = self.plan.margin() + about * lattice.pixel_size;
        let middle = corner.map(|c| c + 0.5 * self.plan.side());
        let half = 0.5 * self.plan.side() + margin;
        let world = |k: usize| {
            let at: f64 = (0..3).map(|a| rotation[k][a] * middle[a]).sum();
            let reach: f64 = (0..3).map(|a| rotation[k][a].abs() * half).sum();
            (lattice.origin[k] + at, reach)
        };
        let ends = [0, 1, 2].map(world);
        Ok(Region::new(ends.map(|(at, reach)| at - reach), ends.map(|(at, reach)| at + reach))?)
    }
}

/// A scan as tiles of a plan are learned from it.
struct Scan {
    cloud: PointCloud,
    /// Weights of its points, by their ranges.
    weights: Vec<f32>,
    /// Mean weight of a point of the whole scan.
    mean_weight: f64,
}

fn sum(weights: &[f32]) -> f64 {
    weights.iter().map(|&w| f64::from(w)).sum()
}

impl Scan {
    fn new(cloud: &PointCloud, rules: &Rules) -> Result<Self> {
        if cloud.is_empty() {
            return Err(Error::EmptyCloud.into());
        }
        let names = rules.options.attributes.iter().flatten();
        if let Some(name) = names.clone().find(|name| !cloud.attributes().contains(&name.as_str()))
        {
            let requirement = "with all attributes that the map keeps";
            return Err(Error::invalid("cloud", format!("one without {name}"), requirement).into());
        }
        rules.plan.attributes.iter().try_for_each(|known| check_column(cloud, known))?;
        let weights = rules.weights(cloud);
        let mean_weight = sum(&weights) / weights.len() as f64;
        Ok(Self { cloud: rules.plan.prepared(cloud)?, weights, mean_weight })
    }
}

/// How much of what may be left out of a scan may be left out of what a map holds when it is learned again. Each time that costs some
/// surface, since what is rare was left out before; without it, what patches decode to beside the surface stays for good, and points
/// beside the patches are many: a second scan of three rooms adds 32 percent of its bytes in place of 3, and one part 4 percent less
/// with 2 percent more rmse than a half.
const AGAIN: f64 = 0.5;

/// The completeness of a tile with `own` points: of those `n_new` from a scan some may be left out, of those `n_again` that the map
/// holds and that are learned again fewer.
fn completeness(share: f64, [n_new, n_again]: [u64; 2], own: u64) -> f64 {
    if share == 0.0 {
        return 0.0;
    }
    let may_be = n_new as f64 + AGAIN * n_again as f64;
    1.0 - (1.0 - share) * may_be / own.max(1) as f64
}

/// Refuses a column that is no more of what the map keeps.
fn check_column(cloud: &PointCloud, known: &AttributeHeader) -> Result<()> {
    let Some((name, column)) = cloud.extra().iter().find(|(name, _)| *name == known.name) else {
        return Ok(());
    };
    let refuse = |given: String, requirement: String| {
        Err(Error::invalid("cloud", given, requirement).into())
    };
    if column.typed() != known.dtype {
        let given = format!("one with {name} of type {}", column.typed().name());
        return refuse(given, format!("with the type of the map, {}", known.dtype.name()));
    }
    let AttributeContent::Labels(labels) = &known.content else { return Ok(()) };
    let is_new = |label: &i64| labels.binary_search(label).is_err();
    match (0..cloud.len()).filter_map(|i| column.integer(i)).find(is_new) {
        Some(label) => refuse(
            format!("one with {label} in {name}"),
            format!("with labels that the map has: {labels:?}"),
        ),
        None => Ok(()),
    }
}

/// Learns tiles from maps and a scan.
struct Learner<'a> {
    rules: &'a Rules,
    maps: &'a [&'a TiledModel],
    scan: Option<&'a Scan>,
}

impl Learner<'_> {
    /// Adds tiles, given with the number of points of the scan in each.
    fn add(
        &self,
        cubes: &BTreeMap<[i32; 3], u64>,
        tiles: &mut Vec<Tile>,
        progress: &dyn Progress,
    ) -> Result<()> {
        for (i, (&cube, &n_points)) in cubes.iter().enumerate() {
            progress.check().map_err(Error::from)?;
            progress.update("learning tiles", i as f32 / cubes.len() as f32);
            tiles.extend(self.tile(cube, n_points, &Quiet(progress))?);
        }
        progress.update("learning tiles", 1.0);
        Ok(())
    }

    /// A tile at all levels of detail; none where no point lies in it.
    fn tile(&self, cube: [i32; 3], n_new: u64, progress: &dyn Progress) -> Result<Vec<Tile>> {
        let Input { cloud, weights, n_measured, n_known, sheets, n_kept } =
            self.points(cube, progress)?;
        let Rules { plan, options } = self.rules;
        let own = plan.cubes_of(&cloud).get(&cube).copied().unwrap_or_default();
        let n_again = own.saturating_sub(n_new + n_kept as u64);
        let completeness = completeness(options.completeness, [n_new, n_again], own);
        let options = &PatchesOptions { completeness, ..options.clone() };
        let known = Known {
            weights: Some(&weights),
            n_measured: Some(&n_measured),
            sheets: &sheets,
            n_kept,
        };
        let task = patches::TileTask { cloud: &cloud, known, cube, plan, options };
        let models = patches::learn_details(&task, progress)?;
        if models.is_empty() {
            return Ok(Vec::new());
        }
        let map = TiledModel::of_tile(plan, cube, &models)?;
        let n_points = n_known + n_new;
        Ok(map.held().map(|(entry, bytes)| (TileEntry { n_points, ..entry }, bytes)).collect())
    }

    /// What a tile is learned from.
    fn points(&self, cube: [i32; 3], progress: &dyn Progress) -> Result<Input> {
        let region = self.rules.region(cube, 0.5)?;
        let near = self.scan.map(|scan| self.near(scan, cube)).transpose()?;
        let of_scan = self.scan.map_or(1.0, |scan| scan.mean_weight);
        let mut input = Input::default();
        let (mut kept, mut clouds) = (Weighed::default(), Weighed::default());
        let mut seen: Vec<Tile> = Vec::new();
        for map in self.maps {
            let last = map.header().details.len() - 1;
            for tile in map.held_in(&region).filter(|(entry, _)| entry.level == last) {
                // Maps may have a tile from one that both go on from.
                if seen.iter().any(|other| is_copy(other, &tile)) {
                    continue;
                }
                let (entry, bytes) = &tile;
                let model = map.read_tile(entry, bytes)?;
                let share = entry.n_points.max(1) as f64 / model.n_measured().max(1.0);
                let weight =
                    Weight { of_point: (of_scan * share) as f32, n_measured: share as f32 };
                let is_own = entry.cube == cube;
                if is_own {
                    input.n_known += entry.n_points;
                }
                match near.as_ref().filter(|_| is_own) {
                    Some(near) => {
                        let KeptSheets { sheets, patches } = model.untouched(&near.cloud);
                        let [stays, rest] =
                            model.remembered_apart(&region, &near.columns, &patches, progress)?;
                        kept.add(self.prepared(stays)?, weight);
                        clouds.add(self.prepared(rest)?, weight);
                        input.sheets.extend(sheets);
                    }
                    None => {
                        let columns = near.as_ref().map(|near| &near.columns);
                        let cloud = model.remembered(&region, columns, progress)?;
                        clouds.add(self.prepared(cloud)?, weight);
                    }
                }
                seen.push(tile);
            }
        }
        input.n_kept = kept.weights.len();
        kept.append(clouds);
        if let Some(scan) = self.scan {
            let inside = region.numbers_in(&scan.cloud);
            kept.weights.extend(inside.iter().map(|&i| scan.weights[i]));
            kept.n_measured.resize(kept.weights.len(), 1.0);
            kept.clouds.push(scan.cloud.select(&inside)?);
        }
        input.cloud = PointCloud::concat(&kept.clouds).0;
        input.weights = kept.weights;
        input.n_measured = kept.n_measured;
        Ok(input)
    }

    /// What of a scan lies about a cube: patches may reach beyond what matters to it by their thickness.
    fn near(&self, scan: &Scan, cube: [i32; 3]) -> Result<Near> {
        let region = self.rules.region(cube, THICKEST)?;
        let cloud = scan.cloud.select(&region.numbers_in(&scan.cloud))?;
        let columns = ScanColumns::new(&self.rules.plan.lattice, &cloud);
        Ok(Near { cloud, columns })
    }

    /// Decoded points like those of a scan.
    fn prepared(&self, cloud: PointCloud) -> Result<PointCloud> {
        if cloud.is_empty() {
            return Ok(cloud);
        }
        Ok(self.rules.plan.prepared(&cloud)?)
    }
}

/// What of a scan lies about a tile.
struct Near {
    cloud: PointCloud,
    columns: ScanColumns,
}

/// What a tile is learned from.
#[derive(Default)]
struct Input {
    cloud: PointCloud,
    weights: Vec<f32>,
    /// How many measured points each stands for.
    n_measured: Vec<f32>,
    /// Points that the maps' tiles there were learned from.
    n_known: u64,
    /// Sheets that stay as they are.
    sheets: Vec<SheetTree>,
    /// So many of the first points are what these decode to.
    n_kept: usize,
}

/// Clouds and the weights of their points.
#[derive(Default)]
struct Weighed {
    clouds: Vec<PointCloud>,
    weights: Vec<f32>,
    n_measured: Vec<f32>,
}

/// How much a point counts.
#[derive(Clone, Copy)]
struct Weight {
    of_point: f32,
    /// How many measured points it stands for.
    n_measured: f32,
}

impl Weighed {
    /// Adds a cloud whose points all have one weight.
    fn add(&mut self, cloud: PointCloud, weight: Weight) {
        let n = self.weights.len() + cloud.len();
        self.weights.resize(n, weight.of_point);
        self.n_measured.resize(n, weight.n_measured);
        self.clouds.push(cloud);
    }

    fn append(&mut self, other: Self) {
        self.weights.extend(other.weights);
        self.n_measured.extend(other.n_measured);
        self.clouds.extend(other.clouds);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_what_a_map_holds_less_is_left_out_and_nothing_of_what_stays() {
        assert_eq!(completeness(0.99, [0, 0], 500), 1.0);
        assert_eq!(completeness(0.99, [500, 0], 500), 0.99);
        assert!((completeness(0.9, [100, 0], 400) - 0.975).abs() < 1e-12);
        assert!((completeness(0.9, [100, 300], 400) - 0.9375).abs() < 1e-12);
        assert_eq!(completeness(0.0, [100, 300], 400), 0.0);
        assert_eq!(completeness(1.0, [0, 0], 0), 1.0);
    }
}
